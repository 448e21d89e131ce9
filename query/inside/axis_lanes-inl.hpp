// The culling test of rays along an axis: a point against the eight lanes of a block, in single precision. Per SIMD
// target; include it below hwy/foreach_target.h. The tests have a scalar reference.
//
// A ray o + s E, s >= 0, and an ellipsoid {c + L u : |u| <= 1}, r = c - o: with ANY direction n,
//     every common point has   s n.E >= g,   g = n.r - |L^T n|,                                                    (1)
// so an inexact n costs decisions, never correctness.
//
// Rays along an axis k (inside.hpp) take n in the plane of the other two axes, i and j, where the ellipsoid's shadow
// has the shape P = F F^T, F = rows i and j of L: n = adj(P) (r_i, r_j) decides exactly, and the line misses if g > 0.
// The half lines are told apart by the axis itself: nothing lies ahead if r_k + |row k of L| < 0.
//
// Rounding: as for general rays, of which these are a special case (query/raycast/lanes-inl.hpp).
//
// Cost: about 50 vector operations and a square root.
#include "query/inside/axis_lanes.hpp"
#include "query/node/lanes-inl.hpp"

// clang-format off
#if defined(PROLATE_QUERY_AXIS_LANES_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef PROLATE_QUERY_AXIS_LANES_INL_HPP
#undef PROLATE_QUERY_AXIS_LANES_INL_HPP
#else
#define PROLATE_QUERY_AXIS_LANES_INL_HPP
#endif
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace prolate::query::HWY_NAMESPACE {

/// Sum of the moduli of L's entries: bounds |L|.
HWY_INLINE Float entry_sum(const Lower3& l) {
    return l.l11 + l.l22 + l.l33 + (abs(l.l21) + abs(l.l31) + abs(l.l32));
}

/// Lanes that rays from `point` along an axis and its opposite may meet, as bits from lane `first` on; all others are
/// set too.
template <size_t kAxis> HWY_INLINE AxisMask axis_lanes(const LaneNodes& e, const LatticePoint& point, size_t first) {
    const Lower3& l = e.factor;
    const Float3 from = e.center - set(point.position);
    const Float r[3] = {from.x, from.y, from.z};
    // P = {{a, b}, {b, c}}, scaled so that squares of n cannot overflow, and |row k|.
    const Sym3 q = shape_of(l);
    Float a, b, c, half;
    if constexpr (kAxis == 0) {
        a = q.yy, b = q.yz, c = q.zz, half = l.l11;
    } else if constexpr (kAxis == 1) {
        a = q.zz, b = q.xz, c = q.xx, half = sqrt(q.yy);
    } else {
        a = q.xx, b = q.xy, c = q.yy, half = sqrt(q.zz);
    }
    const Float ri = r[(kAxis + 1) % 3], rj = r[(kAxis + 2) % 3], rk = r[kAxis];
    const Float si = ri * kAxisScale, sj = rj * kAxisScale;
    const Float ni = c * si - b * sj, nj = a * sj - b * si;
    Float square; // |F^T n|^2
    if constexpr (kAxis == 0) {
        const Float3 along{l.l21 * ni + l.l31 * nj, l.l22 * ni + l.l32 * nj, l.l33 * nj};
        square = dot(along, along);
    } else if constexpr (kAxis == 1) {
        const Float3 along{l.l31 * ni + l.l11 * nj, l.l32 * ni, l.l33 * ni};
        square = dot(along, along);
    } else {
        const Float u = l.l11 * ni + l.l21 * nj, v = l.l22 * nj;
        square = u * u + v * v;
    }
    const Float margin = point.slack + kLaneMargin * entry_sum(l), length = abs(ni) + abs(nj);
    const Float g = ni * ri + nj * rj - sqrt(square) - margin * length;
    const Mask misses = (g > 0) & (length > kLaneDirection);
    const Float widened = half + margin;
    const uint32_t line = ~(bits(misses) << first);
    const uint32_t none_ahead = bits(widened + rk < 0) << first, none_behind = bits(widened - rk < 0) << first;
    return {line & ~none_ahead, line & ~none_behind};
}

/// All eight lanes of a block.
template <size_t kAxis>
HWY_INLINE AxisMask axis_block(const std::byte* block, int32_t step_exponent, const LatticePoint& point) {
    AxisMask mask{0xff, 0xff};
    for (size_t i = 0; i < kBlockLanes; i += kFloatLanes) {
        const AxisMask part = axis_lanes<kAxis>(load_nodes(block, i, step_exponent), point, i);
        mask.ahead &= part.ahead, mask.behind &= part.behind;
    }
    return mask;
}

} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif // PROLATE_QUERY_AXIS_LANES_INL_HPP
