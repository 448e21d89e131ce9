// What the culling tests of shapes (shape_lanes-inl.hpp) take and give, and the same tests on one lane in plain C++:
// the operations of the SIMD kernels in the same order, so that both give the same bits. Tests compare the two; nothing
// else uses the twins.
#pragma once

#include "query/node/lanes.hpp"
#include "query/shapes/rounded_box.hpp"

#include <cstddef>
#include <cstdint>

namespace prolate::query {

/// A rounded box in the lattice coordinates of a tree.
struct LaneRoundedBox {
    Single single;     ///< an ellipsoid of about its shape, which proposes directions; low and high are the box's own
    float edges[3][3]; ///< half edges
    float radius;
    float slack; ///< the lane-independent part of the margin, a multiple of |n|_1
};
LaneRoundedBox lane_rounded_box(const RoundedBox& box, const LatticeInfo& lattice) noexcept;

struct LaneHalfSpace {
    float normal[3];
    float offset;
    float slack; ///< the lane-independent part of the margin, a multiple of |n|
};
LaneHalfSpace lane_half_space(const PlacedHalfSpace& half_space, const LatticeInfo& lattice) noexcept;

/// One lane's outcome.
struct ShapeGap {
    float gap; ///< positive only if they are apart; else possibly NaN
    float key; ///< the less, the deeper they overlap
};
ShapeGap shape_gap(const std::byte* block, uint32_t lane, int32_t step_exponent, const LaneRoundedBox& box) noexcept;
ShapeGap shape_gap(const std::byte* block, uint32_t lane, int32_t step_exponent,
                   const LaneHalfSpace& half_space) noexcept;

} // namespace prolate::query
