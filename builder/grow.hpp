// The top-down loop (paper, Algorithm 1): from the root ellipsoid to all levels.
#pragma once

#include "builder/split.hpp"

#include <prolate/build.hpp>

#include <functional>
#include <vector>

namespace prolate {

/// A node of the growing tree.
struct GrownNode {
    Cluster cluster;
    uint32_t level = 0;
    uint32_t parent = 0;                       ///< of the root: itself
    uint32_t first_child = 0, child_count = 0; ///< indices into the same array
    double outside = 0;                        ///< E_vol, cubic metres
    double surface_error = 0;                  ///< E_sur, metres
};

struct GrowOptions {
    BuildOptions build;
    SplitOptions split;
    /// Volume of (union of these leaves \ solid) / volume of the solid; called for a tolerance only.
    std::function<double(const std::vector<Fit>&)> outside_ratio;
    /// Called after each finished split with the share of the work done and the number of nodes; false cancels.
    std::function<bool(double, uint32_t)> progress;
};

struct Grown {
    std::vector<GrownNode> nodes; ///< the root first; children of a node are consecutive
    bool goal_reached = true;     ///< false: no leaf could be split further before the goal was met
    std::vector<double> seconds;  ///< wall time by level of the children made
};

/// Grows the tree over all cells of `voxels`. Splits of one round run in parallel, each with its own random numbers, so
/// the result does not depend on the number of threads. After a cancellation the result is incomplete.
Grown grow(const Voxels& voxels, const GrowOptions& options);

} // namespace prolate
