// The culling tests of rays: one ray against the eight lanes of a block, in single precision. Per SIMD target; include
// it below hwy/foreach_target.h. The tests have scalar references.
//
// A ray o + s E, s >= 0, and an ellipsoid {c + L u : |u| <= 1}, r = c - o: with ANY direction n,
//     every common point has   s n.E >= g,   g = n.r - |L^T n|,                                                    (1)
// so an inexact n costs decisions, never correctness.
//
// General rays: seen from the ellipsoid as the unit ball, y = L^-1 (o - c), v = L^-1 E, the line comes nearest to the
// center at s = -y.v / v.v, and enters sqrt((1 - nearest^2) / v.v) before. The point of entry if it is hit ahead, else
// the nearest point of the half line, z = y + s v, s >= 0, gives n = -L^-T z, which decides exactly. With d = n.E the
// ray, s <= limit, misses if g > max(0, limit d); else g / d, if d > 0, bounds the parameter of entry from below.
//
// Why single precision suffices: as in lanes-inl.hpp, u = 2^-24, in the lattice coordinates of the tree, where c and L
// are exact. With o and E right within 2^-44 reach before they are rounded:
//   r       |dr| <= u (|o| + |r|) + 2^-44 reach
//   n.r     3 u |n| |r| + |n| |dr|
//   |L^T n| 7 u |n| |L|
//   s d     s <= 1: 5 u |n| |E| + 2^-44 |n| reach; the quotient g / d, or the product, u |n| |E| more
//   g - s d two roundings more:  2 u |n| (|r| + |L| + |E|)
// With |r| <= |o| + |c| the two sides of (1) are wrong by at most |n| (u (7 |o| + 6 |c| + 9 |L| + 8 |E|) + 2^-43 reach)
// together, and g is taken kLaneMargin |n|_1 (|o|_1 + |c| + |L|_1 + |E|_1) + 2^-42 |n|_1 reach smaller: 32 u, more than
// three times as much, which pays for the rounding of the bound itself. Underflow and NaN: as in lanes-inl.hpp. A ray
// of thickness m takes another m |n| off: m is rounded up by 2^-20, which pays for 6 u m |n| of rounding.
//
// Boxes: the slabs between their sides (Kay and Kajiya 1986). In lattice coordinates a side, b_i + q, is exact, b_i
// where the block's box coordinates begin, and is moved outwards by m + kLaneMargin (|o|_1 + |E|_1 + |c| + |b_i - o_i|)
// + 2^-42 reach. Of s = q / E_i + (b_i - o_i) / E_i, that costs, times |E_i|: u |o_i| for the rounded origin, 3 u |b_i
// - o_i| for the second term, u |q| <= u (|b_i - o_i| + s |E_i|) for the first, 4 u s |E_i| for the rounded span, its
// inverse and the sums, and 4 u of itself for the margin: at s <= 1 a fraction of that margin, and beyond it s stays
// above 1. Nothing here is a NaN: place_in_lattice() sees to it that the ray is finite.
//
// Cost: about 60 vector operations for the boxes, and 110 with 6 divisions and 2 square roots for the ellipsoids.
#include "query/inside/axis_lanes-inl.hpp"
#include "query/raycast/lanes.hpp"

#include <limits>

// clang-format off
#if defined(PROLATE_QUERY_RAY_LANES_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef PROLATE_QUERY_RAY_LANES_INL_HPP
#undef PROLATE_QUERY_RAY_LANES_INL_HPP
#else
#define PROLATE_QUERY_RAY_LANES_INL_HPP
#endif
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace prolate::query::HWY_NAMESPACE {

/// Far below the slack, in lattice steps.
inline constexpr float kLeastSpan = 0x1p-60f;
/// Bounds all numbers of a ray: the slack is no less than kLaneMargin times each, and their products are floats.
inline constexpr float kMostSlack = 0x1p40f;
inline constexpr double kRoundThicknessUp = 1 + 0x1p-20; // also pays for the rounding of thickness |n|

/// From lattice coordinates that are right within 2^-44 reach. A ray too far away or too long for floats, or one of
/// NaN, becomes one that meets everything at 0.
HWY_INLINE void place_in_lattice(const double (&origin)[4], const double (&span)[4], double reach, double thickness,
                                 LatticeRay& out) {
    using Axes = hn::CappedTag<double, 4>;
    const hn::Rebind<float, Axes> f;
    const hn::RebindToSigned<decltype(f)> i32;
    alignas(16) float lengths[4];
    for (size_t at = 0; at < 4; at += hn::MaxLanes(f)) {
        const auto o = hn::DemoteTo(f, hn::LoadU(Axes(), origin + at)),
                   e = hn::DemoteTo(f, hn::LoadU(Axes(), span + at));
        const auto least = hn::CopySign(hn::Set(f, kLeastSpan), e);
        const auto inverse = hn::Set(f, 1) / hn::IfThenElse(hn::Abs(e) < hn::Set(f, kLeastSpan), least, e);
        const auto backward = hn::RebindMask(i32, inverse < hn::Zero(f));
        const auto low = hn::Set(i32, int32_t{kBlockBoxLow}), high = hn::Set(i32, int32_t{kBlockBoxHigh});
        hn::Store(o, f, out.origin + at), hn::Store(e, f, out.span + at), hn::Store(inverse, f, out.inverse + at);
        hn::Store(hn::IfThenElse(backward, high, low), i32, out.near_side + at);
        hn::Store(hn::IfThenElse(backward, low, high), i32, out.far_side + at);
        hn::Store(hn::Abs(o) + hn::Abs(e), f, lengths + at);
    }
    out.thickness = static_cast<float>(thickness * kRoundThicknessUp);
    out.slack =
        kLaneMargin * (kLargestCenter + lengths[0] + lengths[1] + lengths[2]) + static_cast<float>(0x1p-42 * reach);
    if (!(out.thickness + out.slack < kMostSlack)) {
        for (size_t i = 0; i < 4; ++i) out.origin[i] = out.span[i] = out.inverse[i] = out.margin[i] = 0;
        out.thickness = 0, out.slack = std::numeric_limits<float>::max();
        return;
    }
    const auto certain = hn::Set(f, out.thickness + out.slack);
    for (size_t at = 0; at < 4; at += hn::MaxLanes(f))
        hn::Store(certain * hn::Abs(hn::Load(f, out.inverse + at)), f, out.margin + at);
}

/// A ray as a block's boxes see it: it passes the side of a box at x box steps where s = x per_step + near, or + far
/// for the sides that it leaves through.
struct BoxRay {
    alignas(16) float near[4], far[4], per_step[4]; // the fourth means nothing
};
HWY_INLINE BoxRay box_ray(const std::byte* block, const LatticeRay& ray) {
    using IntegerTag = hn::RebindToSigned<QuadTag>;
    BoxRay out;
    for (size_t at = 0; at < 4; at += kQuadLanes) {
        const Quad from = hn::ConvertTo(QuadTag(), load_stored<int32_t>(QuadTag(), block + kBlockBoxOrigin + 4 * at)),
                   begins = from - load<Quad>(ray.origin + at), inverse = load<Quad>(ray.inverse + at);
        const auto exponent =
            hn::PromoteTo(IntegerTag(), load_stored<uint8_t>(QuadTag(), block + kBlockBoxExponent + at));
        const Quad step = hn::BitCast(QuadTag(), hn::ShiftLeft<23>(exponent + hn::Set(IntegerTag(), 127)));
        const Quad parameter = begins * inverse, margin = load<Quad>(ray.margin + at) + kLaneMargin * abs(parameter);
        store(parameter - margin, out.near + at);
        store(parameter + margin, out.far + at);
        store(inverse * step, out.per_step + at);
    }
    return out;
}

/// When the ray is in the boxes of some lanes, before `limit` <= 1: from lower bounds of the parameters at which it
/// enters, to upper bounds of those at which it leaves. It misses those whose `enter` is greater.
struct BoxTimes {
    Float enter, leave;
};
HWY_INLINE BoxTimes box_times(const std::byte* block, size_t first, const LatticeRay& ray, const BoxRay& boxes,
                              Float limit) {
    BoxTimes out{set(0), limit};
    for (size_t i = 0; i < 3; ++i) {
        const auto side = [&](int32_t array) {
            return box_sides(block, static_cast<size_t>(array), i, first) * boxes.per_step[i];
        };
        out.enter = max(out.enter, side(ray.near_side[i]) + boxes.near[i]);
        out.leave = min(out.leave, side(ray.far_side[i]) + boxes.far[i]);
    }
    return out;
}

/// The ellipsoids, larger by a factor each. Rounding: u |L|, one of the 9 above more.
HWY_INLINE LaneNodes grown(const LaneNodes& e, Float factor) {
    return {e.center, e.factor * factor};
}

/// A direction n that decides whether the ray meets the ellipsoids; `r` is c - o.
HWY_INLINE Float3 entry_direction(const Lower3& l, const Float3& r, const Float3& span) {
    // -y and v by forward substitution.
    const Float i1 = 1 / l.l11, i2 = 1 / l.l22, i3 = 1 / l.l33;
    const auto solve = [&](const Float3& x) {
        const Float u = x.x * i1, v = (x.y - l.l21 * u) * i2;
        return Float3{u, v, (x.z - l.l31 * u - l.l32 * v) * i3};
    };
    const Float3 y = solve(r), v = solve(span);
    // z: nearest point of the line, drawn back to where it enters, or to the origin. All are negative like y.
    const Float vv = dot(v, v), nearest = dot(y, v) / vv;
    const Float3 m = y - v * nearest;
    const Float inside = max(1 - dot(m, m), set(0)), back = sqrt(inside / vv);
    const Float3 z = choose(nearest > back, m + v * back, y);
    // n = -L^-T z by back substitution.
    const Float nz = z.z * i3, ny = (z.y - l.l32 * nz) * i2;
    return {(z.x - l.l21 * ny - l.l31 * nz) * i1, ny, nz};
}

/// Lower bounds of the parameters at which the ray enters the ellipsoids; infinite if certainly not before `limit`
/// <= 1. kThick: ray.thickness is not 0.
template <bool kThick> HWY_INLINE Float entry_lanes(const LaneNodes& e, const LatticeRay& ray, Float limit) {
    const Float3 r = e.center - set(ray.origin), span = set(ray.span);
    const Float3 n = entry_direction(e.factor, r, span);
    const Float norm = one_norm(n);
    Float g = dot(n, r) - width(e, n) - (ray.slack + kLaneMargin * entry_sum(e.factor)) * norm;
    if constexpr (kThick) g = g - ray.thickness * length(n);
    const Float along = dot(n, span);
    // Written so that a NaN gives 0, which claims nothing.
    const Mask positive = (norm > kLaneDirection) & (g > 0);
    const Float bound = choose(positive & (along > 0), g / along, set(0));
    return choose(positive & (g > limit * along), set(std::numeric_limits<float>::infinity()), bound);
}

} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif // PROLATE_QUERY_RAY_LANES_INL_HPP
