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
    TreeSide side;
    const PlacedRay ray;
    const LatticeRay lattice_ray;
    const QueryOptions options; // sound
    const bool any;             ///< stop at the first hit that is found
    const float* const growth;  ///< of raycast_cut(): by slots; else null
    Scratch::Entry* const stack;
    QueryStats stats;
    bool found = false;
    RayHit best{};           ///< of the placed ray
    double clear = HUGE_VAL; ///< of the placed ray: the least bound of what was left aside
    uint32_t node = 0, triangle = kNoTriangle;

    /// Decides on the leaf `at`, or on a node that max_level lets stand for what is below it. True if a hit is the best
    /// now.
    bool meet(uint32_t at) noexcept;
    /// Tests left of the budget.
    uint64_t left() const noexcept { return tests_left(options.max_pair_tests, stats.tests()); }
};

/// The traversal: finds the first hit, or any. False if the budget ran out.
bool traverse(RaycastSearch& search) noexcept;

} // namespace prolate::query
