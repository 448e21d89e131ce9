// Ellipsoids inside the solid whose union is large.
#pragma once

#include "builder/distance_field.hpp"
#include "builder/triangle_tree.hpp"

#include <functional>
#include <vector>

namespace prolate {

struct InnerSetOptions {
    uint32_t count;  ///< at most
    bool balls;      ///< instead of ellipsoids
    Quality quality; ///< how many are tried
    uint64_t seed;
    std::function<void(double)> progress; ///< is called now and then with the share that is done
};

/// At most `count` ellipsoids inside the solid, those first that add most to the union's volume; fewer where more would
/// add nothing, none if the solid is too thin for the lattice of `field`. No triangle meets one, but for rounding. The
/// same for any number of threads.
std::vector<Fit> inner_set(const TriangleTree& surface, const DistanceField& field, const InnerSetOptions& options);

} // namespace prolate
