// Certified lower bounds of the distance of one node from the eight of a block. Per SIMD target; include it below
// hwy/foreach_target.h.
//
// With the terms of lanes-inl.hpp, the gap g(n) = n.r - |L1^T n| - |L2^T n| along any unit n bounds the distance from
// below. It is greatest where (Q1 / a + Q2 / b + g I) n = r (gap.hpp); with a and b as for spheres, |L| / sqrt(3), and
// g = |r| - a - b or 0, that is one solution of a linear system:
//     n = adj(Q) r / |adj(Q) r|,   Q = Q1 / |L1| + Q2 / |L2| + (max(0, sqrt(3) |r| - |L1| - |L2|) / 3) I.
// For bodies near each other it is the direction of lanes-inl.hpp, for bodies far apart that of r. The best direction
// would save 4 to 12 % of the tests.
//
// A node lies in its box, too, so along n it reaches no farther than the nearer of the two: that saves 7 to 20 % of the
// tests, and up to a quarter of the leaves. (The gaps of boxes along their axes would save another 3 %, and cost more.)
//
// Why the bound holds. n is whatever floats the kernel has found; u = 2^-24, norms Euclidean or Frobenius.
//   p       n.r in double, r from the center of `one` in double: within 2^-44 |n| (reach + |c2|) by LatticePose, and
//           2^-50 |n| (reach + |c2|) for r, three products and two sums. So bodies far apart lose nothing
//   a, b    in float: |da| <= 14 u |n| |L1|, |db| <= 7 u |n| |L2| (lanes-inl.hpp), and what squares below 2^-126 lose,
//           less than 2^-72; kLaneMargin (|L1| + |L2|), 32 u, is more than twice that
//   boxes   of `one`: m = center + sum t_i axis_i, in which center and axes are wrong by at most 10 u of themselves
//   (the
//           float rotation, three products, two sums), and what the stored box loses when it is decoded in float is in
//           half the sides (kBoxMargin); the support takes 3 products and 2 sums a term and 3 sums: 6 u. PlacedBox::
//           slack is 32 u. Of the lane: with sides s = (origin - c2) + step q, wrong by u (2 |origin| + |c2| + |s|),
//           and 3 products and 2 sums: less than 8 u (|origin| + 65535 + 255 step) an axis, which is kBoxMargin times
//           it
//   p - a - b less these is therefore a lower bound of |n| g(n / |n|) if |n| <= 1 + 2^-20
//   1/|n|   >= (3 - |n|^2) / 2, the tangent at |n| = 1; taken in double, clipped at 0 and less 2^-48 of itself, it pays
//           for its own rounding and that of the product. For |n| > 1 + 2^-20 nothing is claimed: the factor is made 0.
// NaN fails every comparison of the callers.
//
// Cost: about 250 vector operations, four square roots and two quotients for eight pairs.
#include "query/node/hull_lanes-inl.hpp"

#include <limits>

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

/// Of each lane: the bound, in steps of the block's lattice, which is that along n, from the single to the lane; not
/// positive if the nodes are not found apart. Lanes without a node have any.
struct LaneBounds {
    alignas(64) double lower[kBlockLanes];
    alignas(64) float x[kBlockLanes], y[kBlockLanes], z[kBlockLanes]; ///< n, of length 1 but for rounding
    alignas(64) float size[kBlockLanes];                              ///< |L2|
    /// If boxes were given: how far the single reaches along n, and the lane along -n, from their centers; L1^T n and
    /// L2^T n, and their lengths.
    alignas(64) float reach_a[kBlockLanes], reach_b[kBlockLanes];
    alignas(64) float in_a[3][kBlockLanes], in_b[3][kBlockLanes], width_a[kBlockLanes], width_b[kBlockLanes];
    uint32_t near; ///< bit i: lower[i] is not known to be `enough`
};

/// Bytes at any address, as floats.
HWY_INLINE Lanes load_bytes(const std::byte* from) {
#if HWY_TARGET == HWY_SCALAR
    return hn::Set(LaneTag(), static_cast<float>(load_le<uint8_t>(from)));
#else
    const hn::Rebind<uint8_t, LaneTag> d8;
    return hn::ConvertTo(LaneTag(), hn::PromoteTo(hn::Rebind<int32_t, LaneTag>(),
                                                  hn::LoadU(d8, reinterpret_cast<const uint8_t*>(from))));
#endif
}

/// The boxes of a block.
struct LaneBoxes {
    const std::byte* block;
    float origin[3], step[3];

    HWY_INLINE explicit LaneBoxes(const std::byte* from) : block(from) {
        for (size_t i = 0; i < 3; ++i) {
            origin[i] = static_cast<float>(load_le<int32_t>(block + kBlockBoxOrigin + 4 * i));
            step[i] = std::bit_cast<float>((127 + int32_t{load_le<uint8_t>(block + kBlockBoxExponent + i)}) << 23);
        }
    }
    /// Sides along an axis, from the box origin, of the lanes from `first` on.
    HWY_INLINE Lanes low(size_t axis, size_t first) const { return side(kBlockBoxLow, axis, first); }
    HWY_INLINE Lanes high(size_t axis, size_t first) const { return side(kBlockBoxHigh, axis, first); }
    /// What the support of a lane's box may be wrong by.
    float slack() const {
        float sum = 0;
        for (size_t i = 0; i < 3; ++i) sum += std::abs(origin[i]) + (65535 + 255 * step[i]);
        return kBoxMargin * sum;
    }

private:
    HWY_INLINE Lanes side(size_t array, size_t axis, size_t first) const {
        return hn::Mul(load_bytes(block + array + kBlockLanes * axis + first), hn::Set(LaneTag(), step[axis]));
    }
};

/// How far a box reaches along -n, from its lane's center; n, and the center are of the lanes from `first` on.
HWY_INLINE Lanes support(const LaneBoxes& boxes, size_t first, const LaneNodes& e, const LaneVector& n) {
    const auto along = [&](size_t axis, Lanes center, Lanes component) {
        const Lanes from = hn::Sub(hn::Set(LaneTag(), boxes.origin[axis]), center);
        return hn::Min(hn::Mul(component, hn::Add(from, boxes.low(axis, first))),
                       hn::Mul(component, hn::Add(from, boxes.high(axis, first))));
    };
    return hn::Neg(hn::Add(hn::Add(along(0, e.x, n.x), along(1, e.y, n.y)), along(2, e.z, n.z)));
}
/// How far the single's box reaches along n, from its ellipsoid's center.
HWY_INLINE Lanes support(const PlacedBox& box, const LaneVector& n) {
    const LaneTag d;
    const auto along = [&](const float(&v)[4]) {
        return dot(hn::Set(d, v[0]), hn::Set(d, v[1]), hn::Set(d, v[2]), n.x, n.y, n.z);
    };
    const Lanes sides =
        hn::Add(hn::Add(hn::Abs(along(box.axis[0])), hn::Abs(along(box.axis[1]))), hn::Abs(along(box.axis[2])));
    return hn::Add(along(box.center), sides);
}
/// The lesser, and x for a NaN in y.
HWY_INLINE Lanes lesser(Lanes x, Lanes y) {
    return hn::IfThenElse(hn::Lt(y, x), y, x);
}

/// `enough`: a bound that need not be improved, in steps. Without `box`, and that of the lanes, if it is null.
HWY_INLINE void bound_lanes(const std::byte* block, int32_t step_exponent, const Single& one, const PlacedBox* box,
                            double enough, LaneBounds& out) {
    const LaneTag d;
    const auto set = [d](float value) { return hn::Set(d, value); };
    alignas(64) float widths[kBlockLanes];
    alignas(64) float cx[kBlockLanes], cy[kBlockLanes], cz[kBlockLanes];
    const LaneBoxes boxes(block);
    const Lanes margin = set(kLaneMargin), box_slack = set(boxes.slack());
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
        const LaneVector in_a = transposed_times(one, n), in_b = transposed_times(e, n);
        const Lanes width_a = length(in_a), width_b = length(in_b);
        if (box != nullptr) {
            const Lanes a =
                lesser(hn::Add(width_a, hn::Mul(margin, set(one.size))), hn::Add(support(*box, n), set(box->slack)));
            const Lanes b =
                lesser(hn::Add(width_b, hn::Mul(margin, q.size)), hn::Add(support(boxes, i, e, n), box_slack));
            hn::Store(hn::Add(a, b), d, widths + i);
            hn::Store(a, d, out.reach_a + i), hn::Store(b, d, out.reach_b + i);
            hn::Store(in_a.x, d, out.in_a[0] + i), hn::Store(in_a.y, d, out.in_a[1] + i);
            hn::Store(in_a.z, d, out.in_a[2] + i), hn::Store(in_b.x, d, out.in_b[0] + i);
            hn::Store(in_b.y, d, out.in_b[1] + i), hn::Store(in_b.z, d, out.in_b[2] + i);
            hn::Store(width_a, d, out.width_a + i), hn::Store(width_b, d, out.width_b + i);
        } else {
            hn::Store(hn::Add(hn::Add(width_a, width_b), hn::Mul(margin, sizes)), d, widths + i);
        }
        hn::Store(n.x, d, out.x + i), hn::Store(n.y, d, out.y + i), hn::Store(n.z, d, out.z + i);
        hn::Store(e.x, d, cx + i), hn::Store(e.y, d, cy + i), hn::Store(e.z, d, cz + i);
        hn::Store(q.size, d, out.size + i);
    }
    const double rounding = 0x1p-43 * (one.reach + double{kLargestCenter});
    out.near = 0;
    const WideTag w;
    const hn::Rebind<float, WideTag> narrow;
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
        const auto lower = hn::Mul(gap, factor);
        hn::Store(lower, w, out.lower + i);
        uint8_t bits[8] = {};
        hn::StoreMaskBits(w, hn::Not(hn::Ge(lower, hn::Set(w, enough))), bits);
        out.near |= uint32_t{bits[0]} << i;
    }
}

/// What hulls of the nodes (null: not known) add to a lane's bound along n, steps; never negative. The terms of their
/// errors are those of hull_lanes-inl.hpp, and of the product above: that factor is at least 1 - 2^-20.
HWY_INLINE double hulls_add(const LaneBounds& at, uint32_t lane, float size, const std::byte* hull_one,
                            const std::byte* hull_lane) {
    const double x = at.x[lane], y = at.y[lane], z = at.z[lane];
    if (!(x * x + y * y + z * z <= 1 + 0x1p-20)) return 0; // nothing is claimed
    float saved = 0;
    if (hull_one != nullptr) {
        const float reach =
            hull_reach_here(hull_one, at.in_a[0][lane], at.in_a[1][lane], at.in_a[2][lane], at.width_a[lane]);
        saved += std::max(0.0f, at.reach_a[lane] - (reach + kLaneMargin * size));
    }
    if (hull_lane != nullptr) {
        const float reach =
            hull_reach_here(hull_lane, -at.in_b[0][lane], -at.in_b[1][lane], -at.in_b[2][lane], at.width_b[lane]);
        saved += std::max(0.0f, at.reach_b[lane] - (reach + kLaneMargin * at.size[lane]));
    }
    return double{saved} * (1 - 0x1p-20);
}

/// The same of the ellipsoids alone.
HWY_INLINE void bound_lanes(const std::byte* block, int32_t step_exponent, const Single& one, LaneBounds& out) {
    bound_lanes(block, step_exponent, one, nullptr, std::numeric_limits<double>::infinity(), out);
}

} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif // PROLATE_QUERY_DISTANCE_LANES_INL_HPP
