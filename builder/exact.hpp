// Exact trees: triangles in the leaves, ellipsoids that only cull.
#pragma once

#include "builder/effort.hpp"
#include "builder/eigen.hpp"

#include "src/format.hpp"

#include <prolate/mesh.hpp>

#include <functional>
#include <vector>

namespace prolate {

struct ExactOptions {
    uint32_t degree;
    uint32_t leaf_triangles; ///< at most, 1 ... kMaxLeafTriangles
    double min_radius;       ///< metres; keeps flat nodes from flat ellipsoids
    double margin;           ///< metres; ellipsoids hold all points within it of their triangles
    ExactEffort effort;
    /// Called now and then with the share that is done.
    std::function<void(double)> progress;
};

/// All that an exact tree's file holds.
struct ExactTree {
    format::Lattice lattice;
    std::vector<format::PackedLevel> levels; ///< figures unknown (NaN)
    std::vector<Vec3> vertices;
    std::vector<Triangle> triangles;
    uint32_t components = 0;
    format::PackedTriangles packed() const { return {vertices, triangles, components}; }
};

/// Builds the exact tree of a cleaned mesh; the same for any number of threads. Fails with bad_mesh if the format
/// cannot hold the mesh's size.
Result<ExactTree> grow_exact(MeshView mesh, const ExactOptions& options);

} // namespace prolate
