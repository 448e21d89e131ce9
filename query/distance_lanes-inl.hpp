// Certified lower bounds of the distance of one ellipsoid from the eight of a block. Per SIMD target; include it below
// hwy/foreach_target.h. lane_distance() in query/lanes.cpp does the same operations on one lane in plain C++.
//
// With the terms of lanes-inl.hpp, the gap g(n) = n.r - |L1^T n| - |L2^T n| along any unit n bounds the distance from
// below. It is greatest where (Q1 / a + Q2 / b + g I) n = r (gap.hpp); with a and b as for spheres, |L| / sqrt(3), and
// g = |r| - a - b or 0, that is one solution of a linear system:
//     n = adj(Q) r / |adj(Q) r|,   Q = Q1 / |L1| + Q2 / |L2| + (max(0, sqrt(3) |r| - |L1| - |L2|) / 3) I.
// For bodies near each other it is the direction of lanes-inl.hpp, for bodies far apart that of r. A better direction
// from a second such step cuts the tests by 3 to 5 % and costs a third more.
//
// Why the bound holds. n is whatever floats the kernel has found; u = 2^-24, norms Euclidean or Frobenius.
//   p       n.r in double, r from the center of `one` in double: within 2^-44 |n| (reach + |c2|) by LatticePose, and
//           2^-50 |n| (reach + |c2|) for r, three products and two sums. So bodies far apart lose nothing
//   a, b    in float: |da| <= 14 u |n| |L1|, |db| <= 7 u |n| |L2| (lanes-inl.hpp), and what squares below 2^-126 lose,
//           less than 2^-72
//   p - a - b less kLaneMargin (|L1| + |L2|) + 2^-43 (reach + |c2|) is therefore a lower bound of |n| g(n / |n|) if
//           |n| <= 1 + 2^-20, with at least half of the margin to spare for |L1| and |L2| as computed
//   1/|n|   >= (3 - |n|^2) / 2, the tangent at |n| = 1; taken in double, clipped at 0 and less 2^-48 of itself, it pays
//           for its own rounding and that of the product. For |n| > 1 + 2^-20 nothing is claimed: the factor is made 0.
// NaN fails every comparison of the callers.
//
// Cost: about 170 vector operations, three square roots and two quotients for eight pairs.
#include "query/lanes-inl.hpp"

// clang-format off
#if defined(PROLATE_QUERY_DISTANCE_LANES_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef PROLATE_QUERY_DISTANCE_LANES_INL_HPP
#undef PROLATE_QUERY_DISTANCE_LANES_INL_HPP
#else
#define PROLATE_QUERY_DISTANCE_LANES_INL_HPP
#endif
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace prolate::query::HWY_NAMESPACE {

using WideTag = hn::CappedTag<double, kBlockLanes>;

/// Of each lane: the bound, in steps of the block's lattice, which is that along n, from the single to the lane;
/// negative if the ellipsoids overlap as seen along it. Lanes without a node have NaN.
struct LaneBounds {
    alignas(64) double lower[kBlockLanes];
    alignas(64) float x[kBlockLanes], y[kBlockLanes], z[kBlockLanes]; ///< n, of length 1 but for rounding
    alignas(64) float size[kBlockLanes];                              ///< |L2|
};

HWY_INLINE void bound_lanes(const std::byte* block, int32_t step_exponent, const Single& one, LaneBounds& out) {
    const LaneTag d;
    const auto set = [d](float value) { return hn::Set(d, value); };
    alignas(64) float widths[kBlockLanes];
    alignas(64) float cx[kBlockLanes], cy[kBlockLanes], cz[kBlockLanes];
    for (size_t i = 0; i < kBlockLanes; i += hn::Lanes(d)) {
        const LaneNodes e = load_nodes(block, i, step_exponent);
        const LaneShapes q = shapes_of(e);
        const LaneVector r = between(e, one);
        const Lanes sizes = hn::Add(q.size, set(one.size));
        const Lanes apart = hn::Mul(set(1.7320508f), hn::Sqrt(sum_of_squares(r.x, r.y, r.z)));
        const Lanes beyond = hn::Sub(apart, sizes), excess = hn::IfThenElseZero(hn::Gt(beyond, hn::Zero(d)), beyond);
        // Scaled so that the trace, |L1| + |L2| + excess, becomes 1.
        const Lanes w2 = hn::Div(set(1), hn::Mul(q.size, hn::Add(sizes, excess)));
        const Lanes w1 = hn::Mul(q.size, w2), round = hn::Mul(set(0.33333334f), hn::Mul(excess, w1));
        LaneShapes mix = mixed(q, w1, w2, one);
        mix.xx = hn::Add(mix.xx, round), mix.yy = hn::Add(mix.yy, round), mix.zz = hn::Add(mix.zz, round);
        LaneVector n = adjugate_times(mix, r);
        const Lanes scale = hn::Div(set(1), hn::Sqrt(sum_of_squares(n.x, n.y, n.z)));
        n = {hn::Mul(n.x, scale), hn::Mul(n.y, scale), hn::Mul(n.z, scale)};
        const Lanes margin = hn::Mul(set(kLaneMargin), sizes);
        hn::Store(hn::Add(hn::Add(width(one, n), width(e, n)), margin), d, widths + i);
        hn::Store(n.x, d, out.x + i), hn::Store(n.y, d, out.y + i), hn::Store(n.z, d, out.z + i);
        hn::Store(e.x, d, cx + i), hn::Store(e.y, d, cy + i), hn::Store(e.z, d, cz + i);
        hn::Store(q.size, d, out.size + i);
    }
    const WideTag w;
    const hn::Rebind<float, WideTag> narrow;
    const double rounding = 0x1p-43 * (one.reach + double{kLargestCenter});
    for (size_t i = 0; i < kBlockLanes; i += hn::Lanes(w)) {
        const auto load = [&](const float* from) { return hn::PromoteTo(w, hn::Load(narrow, from + i)); };
        const auto nx = load(out.x), ny = load(out.y), nz = load(out.z);
        const auto rx = hn::Sub(load(cx), hn::Set(w, one.exact[0])), ry = hn::Sub(load(cy), hn::Set(w, one.exact[1]));
        const auto rz = hn::Sub(load(cz), hn::Set(w, one.exact[2]));
        const auto sum = [](auto a, auto b, auto c) { return hn::Add(hn::Add(a, b), c); };
        const auto p = sum(hn::Mul(nx, rx), hn::Mul(ny, ry), hn::Mul(nz, rz));
        const auto square = sum(hn::Mul(nx, nx), hn::Mul(ny, ny), hn::Mul(nz, nz));
        const auto gap = hn::Sub(hn::Sub(p, load(widths)), hn::Set(w, rounding));
        const auto tangent = hn::Mul(hn::Sub(hn::Set(w, 3.0), square), hn::Set(w, 0.5 - 0x1p-49));
        const auto factor = hn::IfThenElse(hn::Le(square, hn::Set(w, 1 + 0x1p-20)), tangent, hn::Zero(w));
        hn::Store(hn::Mul(gap, factor), w, out.lower + i);
    }
}

} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif // PROLATE_QUERY_DISTANCE_LANES_INL_HPP
