// From the solid to a tree of ellipsoids (paper, Algorithm 1).
//
// Each level is a set of its own, as tight as its number of ellipsoids allows (flat_set.hpp): no level limits another.
// Where levels are asked for, there is one such set for each, and the tree says which of their ellipsoids are below
// which (stack.hpp). Where a number of leaves, a tolerance or a distance is, there is one set, and a tree of looser
// ellipsoids above it (tree_above.hpp).
#pragma once

#include "builder/flat_set.hpp"
#include "builder/grown.hpp"
#include "builder/passages.hpp"

#include <functional>
#include <vector>

namespace prolate {

struct GrowOptions {
    BuildOptions build;
    Effort effort;
    double min_radius; ///< metres
    /// The leaves' largest distance from the solid, metres; HUGE_VAL: whatever it is.
    double most_distance;
    /// That the leaves have to leave free, or null.
    const Passages* passages;
    /// Called now and then with the share of the work done and the number of nodes.
    std::function<void(double, uint32_t)> progress;
};

struct Grown {
    std::vector<GrownNode> nodes; ///< breadth-first: the root first, children of a node are consecutive
    bool goal_reached = true;     ///< false: more ellipsoids made nothing better before the goal was met
    std::vector<double> seconds;  ///< wall time by level
};

/// The same for any number of threads.
Grown grow(const Solid& solid, const GrowOptions& options);

} // namespace prolate
