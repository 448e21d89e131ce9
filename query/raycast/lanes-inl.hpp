// The culling tests of rays: one ray against the eight lanes of a block, in single precision. Per SIMD target; include
// it below hwy/foreach_target.h. query/raycast/lanes.cpp does the same operations on one lane in plain C++.
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

/// Lower bounds of the parameters at which the ray enters the boxes of lanes `first` and following; infinite if it does
/// not before `limit` <= 1. NaN, which a ray that is not finite makes, is passed over.
HWY_INLINE Lanes box_entries(const std::byte* block, size_t first, const BoxRay& ray, Lanes limit) {
    const LaneTag d;
    const auto side = [&](size_t at) {
        const hn::Rebind<uint8_t, LaneTag> d8;
        const auto bytes = hn::LoadU(d8, reinterpret_cast<const uint8_t*>(block + at + first));
        return hn::ConvertTo(d, hn::PromoteTo(hn::Rebind<int32_t, LaneTag>(), bytes));
    };
    Lanes enter = hn::Zero(d), leave = limit;
    for (size_t i = 0; i < 3; ++i) {
        const Lanes inverse = hn::Set(d, ray.inverse[i]);
        const Lanes in = hn::Mul(hn::Sub(side(ray.near_side[i]), hn::Set(d, ray.near[i])), inverse);
        const Lanes out = hn::Mul(hn::Sub(side(ray.far_side[i]), hn::Set(d, ray.far[i])), inverse);
        enter = hn::IfThenElse(hn::Gt(in, enter), in, enter), leave = hn::IfThenElse(hn::Lt(out, leave), out, leave);
    }
    return hn::IfThenElse(hn::Gt(enter, leave), hn::Set(d, std::numeric_limits<float>::infinity()), enter);
}

/// The ellipsoids, larger by a factor each. Rounding: u |L|, one of the 9 above more.
HWY_INLINE LaneNodes grown(LaneNodes e, Lanes factor) {
    for (Lanes* l : {&e.l11, &e.l21, &e.l22, &e.l31, &e.l32, &e.l33}) *l = hn::Mul(*l, factor);
    return e;
}

/// Lower bounds of the parameters at which the ray enters the ellipsoids; infinite if certainly not before `limit`
/// <= 1. kThick: ray.thickness is not 0.
template <bool kThick> HWY_INLINE Lanes entry_lanes(const LaneNodes& e, const LatticeRay& ray, Lanes limit) {
    const LaneTag d;
    const auto set = [d](float value) { return hn::Set(d, value); };
    const Lanes zero = hn::Zero(d), one = set(1), ex = set(ray.span[0]), ey = set(ray.span[1]), ez = set(ray.span[2]);
    const Lanes rx = hn::Sub(e.x, set(ray.origin[0])), ry = hn::Sub(e.y, set(ray.origin[1])),
                rz = hn::Sub(e.z, set(ray.origin[2]));
    // -y and v by forward substitution.
    const Lanes i1 = hn::Div(one, e.l11), i2 = hn::Div(one, e.l22), i3 = hn::Div(one, e.l33);
    const auto solve = [&](Lanes x, Lanes y, Lanes z, Lanes& u, Lanes& v, Lanes& w) {
        u = hn::Mul(x, i1);
        v = hn::Mul(hn::Sub(y, hn::Mul(e.l21, u)), i2);
        w = hn::Mul(hn::Sub(hn::Sub(z, hn::Mul(e.l31, u)), hn::Mul(e.l32, v)), i3);
    };
    Lanes y1, y2, y3, v1, v2, v3;
    solve(rx, ry, rz, y1, y2, y3);
    solve(ex, ey, ez, v1, v2, v3);
    // z: nearest point of the line, drawn back to where it enters, or to the origin. All are negative like y.
    const Lanes vv = sum_of_squares(v1, v2, v3);
    const Lanes nearest = hn::Div(dot(y1, y2, y3, v1, v2, v3), vv);
    const Lanes m1 = hn::Sub(y1, hn::Mul(nearest, v1)), m2 = hn::Sub(y2, hn::Mul(nearest, v2)),
                m3 = hn::Sub(y3, hn::Mul(nearest, v3));
    const Lanes inside = hn::Max(hn::Sub(one, sum_of_squares(m1, m2, m3)), zero);
    const Lanes back = hn::Sqrt(hn::Div(inside, vv));
    const auto ahead = hn::Gt(nearest, back);
    const Lanes z1 = hn::IfThenElse(ahead, hn::Add(m1, hn::Mul(back, v1)), y1),
                z2 = hn::IfThenElse(ahead, hn::Add(m2, hn::Mul(back, v2)), y2),
                z3 = hn::IfThenElse(ahead, hn::Add(m3, hn::Mul(back, v3)), y3);
    // n = -L^-T z by back substitution, and (1).
    const Lanes nz = hn::Mul(z3, i3);
    const Lanes ny = hn::Mul(hn::Sub(z2, hn::Mul(e.l32, nz)), i2);
    const Lanes nx = hn::Mul(hn::Sub(hn::Sub(z1, hn::Mul(e.l21, ny)), hn::Mul(e.l31, nz)), i1);
    const Lanes width = hn::Sqrt(sum_of_squares(dot(e.l11, e.l21, e.l31, nx, ny, nz),
                                                sum_of_products(e.l22, ny, e.l32, nz), hn::Mul(e.l33, nz)));
    const Lanes length = hn::Add(hn::Add(hn::Abs(nx), hn::Abs(ny)), hn::Abs(nz));
    const Lanes margin = hn::Add(set(ray.slack), hn::Mul(set(kLaneMargin), entry_sum(e)));
    Lanes g = hn::Sub(hn::Sub(dot(nx, ny, nz, rx, ry, rz), width), hn::Mul(margin, length));
    if constexpr (kThick) g = hn::Sub(g, hn::Mul(set(ray.thickness), hn::Sqrt(sum_of_squares(nx, ny, nz))));
    const Lanes along = dot(nx, ny, nz, ex, ey, ez);
    // Written so that a NaN gives 0, which claims nothing.
    const auto sound = hn::Gt(length, set(kLaneDirection));
    const auto positive = hn::And(sound, hn::Gt(g, zero));
    const Lanes bound = hn::IfThenElse(hn::And(positive, hn::Gt(along, zero)), hn::Div(g, along), zero);
    const auto misses = hn::And(positive, hn::Gt(g, hn::Mul(limit, along)));
    return hn::IfThenElse(misses, set(std::numeric_limits<float>::infinity()), bound);
}

} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif // PROLATE_QUERY_RAY_LANES_INL_HPP
