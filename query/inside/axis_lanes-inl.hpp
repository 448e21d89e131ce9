// The culling test of rays along an axis: a point against the eight lanes of a block, in single precision. Per SIMD
// target; include it below hwy/foreach_target.h. query/inside/axis_lanes.cpp does the same operations on one lane in
// plain C++.
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

HWY_INLINE Lanes sum_of_products(Lanes x, Lanes y, Lanes z, Lanes w) {
    return hn::Add(hn::Mul(x, y), hn::Mul(z, w));
}

/// Sum of the moduli of L's entries: bounds |L|.
HWY_INLINE Lanes entry_sum(const LaneNodes& e) {
    const Lanes diagonal = hn::Add(hn::Add(e.l11, e.l22), e.l33);
    return hn::Add(diagonal, hn::Add(hn::Add(hn::Abs(e.l21), hn::Abs(e.l31)), hn::Abs(e.l32)));
}

/// Lanes that rays from `point` along an axis and its opposite may meet, as bits from lane `first` on; all others are
/// set too.
template <size_t kAxis> HWY_INLINE AxisMask axis_lanes(const LaneNodes& e, const LatticePoint& point, size_t first) {
    const LaneTag d;
    const auto set = [d](float value) { return hn::Set(d, value); };
    const Lanes r[3] = {hn::Sub(e.x, set(point.position[0])), hn::Sub(e.y, set(point.position[1])),
                        hn::Sub(e.z, set(point.position[2]))};
    // P = {{a, b}, {b, c}}, scaled so that squares of n cannot overflow, and |row k|.
    Lanes a, b, c, half;
    if constexpr (kAxis == 0) {
        a = sum_of_products(e.l21, e.l21, e.l22, e.l22), b = sum_of_products(e.l21, e.l31, e.l22, e.l32);
        c = sum_of_squares(e.l31, e.l32, e.l33), half = e.l11;
    } else if constexpr (kAxis == 1) {
        a = sum_of_squares(e.l31, e.l32, e.l33), b = hn::Mul(e.l31, e.l11), c = hn::Mul(e.l11, e.l11);
        half = hn::Sqrt(sum_of_products(e.l21, e.l21, e.l22, e.l22));
    } else {
        a = hn::Mul(e.l11, e.l11), b = hn::Mul(e.l11, e.l21), c = sum_of_products(e.l21, e.l21, e.l22, e.l22);
        half = hn::Sqrt(sum_of_squares(e.l31, e.l32, e.l33));
    }
    const Lanes ri = r[(kAxis + 1) % 3], rj = r[(kAxis + 2) % 3], rk = r[kAxis];
    const Lanes si = hn::Mul(ri, set(kAxisScale)), sj = hn::Mul(rj, set(kAxisScale));
    const Lanes ni = minor(c, si, b, sj), nj = minor(a, sj, b, si);
    Lanes square; // |F^T n|^2
    if constexpr (kAxis == 0) {
        square = sum_of_squares(sum_of_products(e.l21, ni, e.l31, nj), sum_of_products(e.l22, ni, e.l32, nj),
                                hn::Mul(e.l33, nj));
    } else if constexpr (kAxis == 1) {
        square = sum_of_squares(sum_of_products(e.l31, ni, e.l11, nj), hn::Mul(e.l32, ni), hn::Mul(e.l33, ni));
    } else {
        const Lanes u = sum_of_products(e.l11, ni, e.l21, nj), v = hn::Mul(e.l22, nj);
        square = sum_of_products(u, u, v, v);
    }
    const Lanes margin = hn::Add(set(point.slack), hn::Mul(set(kLaneMargin), entry_sum(e)));
    const Lanes length = hn::Add(hn::Abs(ni), hn::Abs(nj));
    const Lanes g = hn::Sub(hn::Sub(sum_of_products(ni, ri, nj, rj), hn::Sqrt(square)), hn::Mul(margin, length));
    const auto misses = hn::And(hn::Gt(g, hn::Zero(d)), hn::Gt(length, set(kLaneDirection)));
    const Lanes widened = hn::Add(half, margin);
    const uint32_t line = ~bits_of(misses, first);
    const uint32_t none_ahead = bits_of(hn::Lt(hn::Add(widened, rk), hn::Zero(d)), first);
    const uint32_t none_behind = bits_of(hn::Lt(hn::Sub(widened, rk), hn::Zero(d)), first);
    return {line & ~none_ahead, line & ~none_behind};
}

/// All eight lanes of a block.
template <size_t kAxis>
HWY_INLINE AxisMask axis_block(const std::byte* block, int32_t step_exponent, const LatticePoint& point) {
    AxisMask mask{0xff, 0xff};
    for (size_t i = 0; i < kBlockLanes; i += hn::Lanes(LaneTag())) {
        const AxisMask part = axis_lanes<kAxis>(load_nodes(block, i, step_exponent), point, i);
        mask.ahead &= part.ahead, mask.behind &= part.behind;
    }
    return mask;
}

} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif // PROLATE_QUERY_AXIS_LANES_INL_HPP
