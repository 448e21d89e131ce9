// What a mesh can be baked into, each choice measured: for "prolate compare".
#pragma once

#include "cli/failure.hpp"

#include <prolate/build.hpp>

#include <functional>
#include <string>
#include <vector>

namespace prolate::cli {

/// One way to stand in for the mesh.
struct Choice {
    std::string name;         ///< "32 ellipsoids"
    Tree tree;                ///< of one hull, an exact tree of it
    Mesh hull;                ///< the hull, or empty
    double outside_ratio = 0; ///< NaN where the mesh encloses nothing
    double clearance = 0;     ///< how far it sticks out, metres; of a hull, its surface
    double nanoseconds = 0;   ///< that one query takes, see nanoseconds_a_query()
};

/// Bakes the mesh into 8, 16, 32 and 64 ellipsoids, 64 spheres, and its convex hull (unless it is flat), and measures
/// them. Of `options`, whatever is no goal counts. `progress` is given the name of what is made and the share done.
Outcome<std::vector<Choice>> make_choices(const std::string& path, const CleanMesh& mesh, BuildOptions options,
                                          const std::function<bool(const std::string&, double)>& progress);

} // namespace prolate::cli
