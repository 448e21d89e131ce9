// One raycast() query: what the vectorised traversal (search.cpp) and the decisions at its leaves (leaves.cpp) share.
#pragma once

#include "query/node/limits.hpp"
#include "query/node/tree_side.hpp"
#include "query/raycast/lanes.hpp"
#include "query/raycast/ray.hpp"

#include <prolate/raycast.hpp>

#include <cmath>
#include <cstdint>

namespace prolate::query {

struct RaycastSearch {
    // Of all rays.
    TreeSide side;
    const QueryOptions options; // sound
    const float* const growth;  ///< of raycast_cut(): by slots; else null
    Scratch::Entry* const stack;
    const double reach; ///< at least that of every triangle
    // Of one.
    PlacedRay ray;
    LatticeRay lattice_ray;
    bool any; ///< stop at the first hit that is found
    QueryStats stats;
    bool found;
    RayHit best;  ///< of the placed ray
    double clear; ///< of the placed ray: the least bound of what was left aside
    uint32_t node, triangle;

    RaycastSearch(const TreeSide& tree_side, const QueryOptions& sound, const float* grown, Scratch::Entry* scratch,
                  double triangle_reach) noexcept
        : side(tree_side), options(sound), growth(grown), stack(scratch), reach(triangle_reach) {}
    /// Makes ready for a ray.
    void begin(const PlacedRay& placed, bool any_hit) noexcept;

    /// Decides on the ellipsoid of the leaf `at`, or of a node that stands for what is below it. True if a hit is the
    /// best now.
    bool meet(uint32_t at) noexcept;
    /// The same of one triangle of a leaf.
    bool meet_triangle(uint32_t leaf, uint32_t triangle) noexcept;
    /// Tests left of the budget.
    uint64_t left() const noexcept { return tests_left(options.max_pair_tests, stats.tests()); }
};

/// The traversal: finds the first hit, or any. False if the budget ran out.
bool traverse(RaycastSearch& search) noexcept;

} // namespace prolate::query
