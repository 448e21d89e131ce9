// The culling tests of shapes: one rounded box or half-space against the eight lanes of a block, in single precision.
// Per SIMD target; include it below hwy/foreach_target.h. The tests have scalar references.
//
// The direction n is that of lanes-inl.hpp, for an ellipsoid of about the box's shape. The certificate is the box's
// own:
//     n.r - |L^T n| - sum |n.e_i| - rho |n| > 0,                                                                    (1)
// valid for any n, and tighter than any ellipsoid around the box. Before that, the lanes' boxes are compared with the
// shape's. A half-space has one direction for all lanes.
//
// Rounding, in the terms of lanes-inl.hpp, u = 2^-24:
//   n.r            |n| (4 u |r| + |dc1|), |dc1| <= u |c1| + 2^-44 reach
//   |L^T n|        7 u |n| |L|
//   |n.e_i|        rounded once (u), 3 products and 2 sums: 5 u |n| |e_i|
//   rho |n|        6 u |n| rho
//   their sums     4 u |n| (|r| + |L| + sum |e_i| + rho)
// With |r| <= |c1| + |c2|, (1) is wrong by at most |n| (u (9 |c1| + 8 |c2| + 11 |L| + 10 (sum |e_i| + rho)) + 2^-44
// reach), and is taken for true only beyond kLaneMargin |n|_1 (|c1|_1 + |c2| + |L| + sum |e_i|_1 + rho) + 2^-42 |n|_1
// reach: 32 u. Half-space: the normal is rounded once, so n.c2 is wrong by 4 u |c2|, the offset d by u |d| + 2^-44
// reach, and kLaneMargin (|c2| + |L| + |d|) + 2^-42 reach is demanded. Underflow and NaN: as in lanes-inl.hpp.
//
// Cost: about 170 vector operations for a box, 40 for a half-space.
#include "query/node/lanes-inl.hpp"
#include "query/shapes/lanes.hpp"

// clang-format off
#if defined(PROLATE_QUERY_SHAPE_LANES_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef PROLATE_QUERY_SHAPE_LANES_INL_HPP
#undef PROLATE_QUERY_SHAPE_LANES_INL_HPP
#else
#define PROLATE_QUERY_SHAPE_LANES_INL_HPP
#endif
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace prolate::query::HWY_NAMESPACE {

struct LaneGaps {
    Float gap; ///< positive only if they are separated; else possibly NaN
    Float key; ///< the less, the deeper they overlap
};

HWY_INLINE LaneGaps shape_gaps(const LaneNodes& e, const LaneRoundedBox& box) {
    const LaneTerms t = evaluate(e, box.single);
    const auto along = [&](size_t i) { return abs(dot(set(box.edges[i]), t.n)); };
    const Float sum = t.b + (along(0) + along(1) + along(2) + box.radius * length(t.n));
    const Float gap = t.p - sum - (box.slack + kLaneMargin * t.size) * t.one_norm;
    return {choose(t.one_norm > kLaneDirection, gap, set(0)), t.p / sum};
}

HWY_INLINE LaneGaps shape_gaps(const LaneNodes& e, const LaneHalfSpace& half_space) {
    const Float3 n = set(half_space.normal);
    const Float low = dot(n, e.center) - half_space.offset - width(e, n);
    const Float size = sqrt(trace(shape_of(e.factor)));
    return {low - (half_space.slack + kLaneMargin * size), low};
}

/// Bit i: the boxes do not separate lane i from the shape.
HWY_INLINE uint32_t boxes_meet_shape(const std::byte* block, const LaneRoundedBox& box) {
    return boxes_meet(block, box.single, 0);
}
HWY_INLINE uint32_t boxes_meet_shape(const std::byte*, const LaneHalfSpace&) {
    return (1u << kBlockLanes) - 1;
}

} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif // PROLATE_QUERY_SHAPE_LANES_INL_HPP
