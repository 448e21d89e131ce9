// One overlap() query of a simple shape: what the vectorised traversal (search.cpp) works on.
#pragma once

#include "query/node/limits.hpp"
#include "query/node/tree_side.hpp"
#include "query/shapes/lanes.hpp"
#include "query/shapes/rounded_box.hpp"

#include <prolate/shapes.hpp>

#include <cstdint>

namespace prolate::query {

/// One overlap() query of a RoundedBox or a PlacedHalfSpace, as its lanes see it.
template <class Shape, class LaneShape> struct ShapeSearch {
    TreeSide side;
    const Shape shape;
    const LaneShape lanes;
    const QueryOptions options; // sound
    Scratch::Entry* const stack;
    OverlapResult result;
    bool root_met = false;

    /// Decides on a leaf, in double precision. True if it meets the shape.
    bool meets(uint32_t leaf) noexcept {
        const TriangleRange triangles = side.tree.triangles(leaf);
        for (uint32_t t = triangles.first; t < triangles.first + triangles.count; ++t) {
            ++result.stats.triangle_tests;
            if (!separated(place(side.tree, t), shape)) return take(leaf, t);
        }
        return triangles.count == 0 && !separated(place(side.tree.ellipsoid(leaf), side.tree.scale()), shape) &&
               take(leaf, kNoTriangle);
    }
    /// Takes what meets the shape. Always true.
    bool take(uint32_t node, uint32_t triangle) noexcept {
        result.node = node, result.triangle = triangle;
        return true;
    }
    /// Tests left of the budget.
    uint64_t left() const noexcept { return tests_left(options.max_pair_tests, result.stats.tests()); }
};
using BoxSearch = ShapeSearch<RoundedBox, LaneRoundedBox>;
using HalfSpaceSearch = ShapeSearch<PlacedHalfSpace, LaneHalfSpace>;

/// The traversal alone.
Verdict traverse(BoxSearch& search) noexcept;
Verdict traverse(HalfSpaceSearch& search) noexcept;

} // namespace prolate::query
