// A tree against a half-space: what the vectorised traversal (search.cpp) and the queries share.
// Everything in the frame of the tree. A height is a distance from the plane, above 0 outside the half-space.
#pragma once

#include "query/node/limits.hpp"
#include "query/node/tree_side.hpp"
#include "query/shapes/lanes.hpp"
#include "query/shapes/rounded_box.hpp"

#include <prolate/query.hpp>

#include <cstdint>
#include <limits>

namespace prolate::query {

/// What is known of contacts: nodes are of interest that may reach farther out along the plane, or lie lower. In the
/// tree's lattice coordinates, from the lattice's origin on.
struct HeightOutline {
    float directions[2][3]; ///< of length 1
    float beyond[4];        ///< along these, and then against them
    float lean;             ///< what a point counts as farther out for each step that it is lower
    float below;            ///< height over the plane
    uint32_t version = 0;   ///< of these numbers; 0: nothing is known
};

struct HeightSearch {
    TreeSide side;
    const PlacedHalfSpace shape;
    const LaneHalfSpace lanes;
    const uint64_t max_tests;
    Scratch::Entry* const stack;
    QueryStats stats;

    double limit = std::numeric_limits<double>::infinity(); ///< nodes that are higher need not be looked at, metres
    double open = std::numeric_limits<double>::infinity();  ///< least height of what is left where the budget ran out

    /// Called for each leaf that is not higher than `limit`, which it may lower. False ends the search.
    bool (*leaf)(void* user, uint32_t slot) = nullptr;
    /// Nodes that are not of interest are passed over, others are looked at in the order of how far beyond it they may
    /// be. Null: in that of their heights.
    const HeightOutline* outline = nullptr;
    /// Called for nodes that were of interest to an outline before: are they still? They are no lower than `bound`,
    /// metres. Null: always.
    bool (*wanted)(void* user, uint32_t slot, double bound) = nullptr;
    void* user = nullptr;
    bool passed_over = false; ///< some node that is not of interest, though not higher than `limit`

    HeightSearch(const TreeView& tree, const PlacedHalfSpace& half_space, Scratch context,
                 const QueryOptions& options) noexcept
        : side(tree_side(tree, options.max_level)), shape(half_space),
          lanes(lane_half_space(half_space, tree.raw().lattice())), max_tests(options.max_pair_tests),
          stack(context.entries()) {}
    uint64_t left() const noexcept { return tests_left(max_tests, stats.tests()); }
};

/// Calls `leaf` for the leaves.
void traverse(HeightSearch& search) noexcept;

} // namespace prolate::query
