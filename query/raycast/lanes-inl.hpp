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
// Boxes: the slabs between their sides (Kay and Kajiya 1986). In lattice coordinates a side is exact, and is moved
// outwards by m + kLaneMargin (|o|_1 + |E|_1 + |c| + |o_i - b_i|) + 2^-42 reach, b_i where the block's box coordinates
// begin: u |o_i| and u |o_i - b_i| for the rounded origin, 3 u |E_i| for the rounded span and its inverse, and at s <=
// 1 another 3 u |E_i| for the parameter itself are a fraction of that.
//
// Cost: about 40 vector operations for the boxes, and 110 with 6 divisions and 2 square roots for the ellipsoids.
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

/// A ray as a block's boxes see it, in box steps: it passes the side of a box at x where s = (x - near) inverse, or
/// with `far` for the sides that it leaves through.
struct BoxRay {
    alignas(32) float near[4], far[4], inverse[4]; // the fourth means nothing
};
HWY_INLINE BoxRay box_ray(const std::byte* block, const LatticeRay& ray) {
    using Axes = hn::CappedTag<double, 4>;
    const hn::Rebind<float, Axes> f;
    const hn::Rebind<int32_t, Axes> i;
    BoxRay out;
    for (size_t at = 0; at < 4; at += hn::MaxLanes(f)) {
        const auto from = hn::PromoteTo(Axes(), load_stored<int32_t>(Axes(), block + kBlockBoxOrigin + 4 * at));
        const auto origin = hn::DemoteTo(f, hn::PromoteTo(Axes(), hn::Load(f, ray.origin + at)) - from);
        const auto exponent = hn::PromoteTo(i, load_stored<uint8_t>(Axes(), block + kBlockBoxExponent + at));
        const auto power = [&](auto e) { return hn::BitCast(f, hn::ShiftLeft<23>(hn::Set(i, 127) + e)); };
        const auto step = power(exponent), per_step = power(hn::Neg(exponent));
        const auto wider =
            hn::Load(f, ray.forward + at) *
            (hn::Set(f, ray.thickness) + (hn::Set(f, ray.slack) + hn::Set(f, kLaneMargin) * hn::Abs(origin)));
        hn::Store((origin + wider) * per_step, f, out.near + at);
        hn::Store((origin - wider) * per_step, f, out.far + at);
        hn::Store(hn::Load(f, ray.inverse + at) * step, f, out.inverse + at);
    }
    return out;
}

/// Lower bounds of the parameters at which the ray enters the boxes of lanes `first` and following; infinite if it does
/// not before `limit` <= 1. NaN, which a ray that is not finite makes, is passed over.
HWY_INLINE Float box_entries(const std::byte* block, size_t first, const LatticeRay& ray, const BoxRay& boxes,
                             Float limit) {
    Float enter = set(0), leave = limit;
    for (size_t i = 0; i < 3; ++i) {
        const auto side = [&](size_t array) { return box_sides(block, array, i, first); };
        enter = greater(enter, (side(ray.near_side[i]) - boxes.near[i]) * boxes.inverse[i]);
        leave = lesser(leave, (side(ray.far_side[i]) - boxes.far[i]) * boxes.inverse[i]);
    }
    return choose(enter > leave, set(std::numeric_limits<float>::infinity()), enter);
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
