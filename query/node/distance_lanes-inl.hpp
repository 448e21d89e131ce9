// Certified lower bounds of the distance of one node from the eight of a block. Per SIMD target; include it below
// hwy/foreach_target.h.
//
// With the terms of lanes-inl.hpp, the gap g(n) = n.r - |L1^T n| - |L2^T n| along any unit n bounds the distance from
// below. It is greatest where (Q1 / a + Q2 / b + g I) n = r (query/ellipsoid/gap.hpp); with a and b as for spheres, |L|
// / sqrt(3), and g = |r| - a - b or 0, that is one solution of a linear system:
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
//           (the float rotation, three products, two sums), and what the stored box loses when it is decoded in float
//           is in half the sides (kBoxMargin); the support takes 3 products and 2 sums a term and 3 sums: 6 u.
//           PlacedBox::slack is 32 u. Of the lane: with sides s = (origin - c2) + step q, wrong by u (2 |origin| + |c2|
//           + |s|), and 3 products and 2 sums: less than 8 u (|origin| + 65535 + 255 step) an axis, which is
//           kBoxMargin times it
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

/// Of each lane: the bound, in steps of the block's lattice, which is that along n, from the single to the lane; not
/// positive if the nodes are not found separated. Lanes without a node have any.
struct LaneBounds {
    alignas(64) double lower[kBlockLanes];
    alignas(64) float n[3][kBlockLanes];    ///< of length 1 but for rounding
    alignas(64) float size[kBlockLanes];    ///< |L2|
    alignas(64) float between[kBlockLanes]; ///< |c2 - c1|
    /// If boxes were given: how far the single reaches along n, and the lane along -n, from their centers; L1^T n and
    /// L2^T n, and their lengths.
    alignas(64) float reach_a[kBlockLanes], reach_b[kBlockLanes];
    alignas(64) float in_a[3][kBlockLanes], in_b[3][kBlockLanes], width_a[kBlockLanes], width_b[kBlockLanes];
    uint32_t near; ///< bit i: lower[i] is not known to be `enough`
};

/// The boxes of a block.
struct LaneBoxes {
    const std::byte* block;
    float origin[3], step[3];

    HWY_INLINE explicit LaneBoxes(const std::byte* from) : block(from) {
        const BlockBoxes boxes(from);
        for (size_t i = 0; i < 3; ++i) origin[i] = static_cast<float>(boxes.origin(i)), step[i] = boxes.step(i);
    }
    /// Sides along an axis, from the box origin, of the lanes from `first` on.
    HWY_INLINE Float low(size_t axis, size_t first) const {
        return box_sides(block, kBlockBoxLow, axis, first) * step[axis];
    }
    HWY_INLINE Float high(size_t axis, size_t first) const {
        return box_sides(block, kBlockBoxHigh, axis, first) * step[axis];
    }
    /// What the support of a lane's box may be wrong by.
    float slack() const {
        float sum = 0;
        for (size_t i = 0; i < 3; ++i) sum += std::abs(origin[i]) + (65535 + 255 * step[i]);
        return kBoxMargin * sum;
    }
};

/// How far a box reaches along -n, from its lane's center; n, and the center are of the lanes from `first` on.
HWY_INLINE Float support(const LaneBoxes& boxes, size_t first, const LaneNodes& e, const Float3& n) {
    const auto along = [&](size_t axis, Float center, Float component) {
        const Float from = boxes.origin[axis] - center;
        return min(component * (from + boxes.low(axis, first)), component * (from + boxes.high(axis, first)));
    };
    return -(along(0, e.center.x, n.x) + along(1, e.center.y, n.y) + along(2, e.center.z, n.z));
}
/// How far the single's box reaches along n, from its ellipsoid's center.
HWY_INLINE Float support(const PlacedBox& box, const Float3& n) {
    const auto along = [&](size_t axis) { return abs(dot(set(box.axis[axis]), n)); };
    return dot(set(box.center), n) + (along(0) + along(1) + along(2));
}

/// The direction n of the bound; `size` is |L2|.
HWY_INLINE Float3 bounding_direction(const LaneNodes& e, const Sym3& q2, Float size, const Single& one) {
    const Float3 r = between(e, one);
    const Float sizes = size + one.size;
    const Float beyond = 1.7320508f * length(r) - sizes, excess = choose_or_zero(beyond > 0, beyond);
    // Scaled so that the trace, |L1| + |L2| + excess, becomes 1.
    const Float w2 = 1 / (size * (sizes + excess)), w1 = size * w2;
    const Float3 n = adjugate(plus_diagonal(mixed(one, q2, w1, w2), 0.33333334f * (excess * w1))) * r;
    return n * (1 / length(n));
}

/// What both bodies reach along n, in float, and their parts if the boxes are given, from lane `first` on.
HWY_INLINE Float reach_of_both(const LaneNodes& e, Float size, const Float3& n, const Single& one, const PlacedBox* box,
                               const LaneBoxes& boxes, size_t first, LaneBounds& out) {
    const Float3 in_a = transposed_times(one, n), in_b = transposed_times(e.factor, n);
    const Float width_a = length(in_a), width_b = length(in_b);
    if (box == nullptr) return width_a + width_b + kLaneMargin * (size + one.size);
    const Float a = lesser(width_a + kLaneMargin * set(one.size), support(*box, n) + box->slack);
    const Float b = lesser(width_b + kLaneMargin * size, support(boxes, first, e, n) + boxes.slack());
    store(a, out.reach_a + first), store(b, out.reach_b + first);
    store(in_a, out.in_a, first), store(in_b, out.in_b, first);
    store(width_a, out.width_a + first), store(width_b, out.width_b + first);
    return a + b;
}

/// The bounds along out.n, in double: `reach` is what both bodies reach along it.
HWY_INLINE void bound_along(const float (&center)[3][kBlockLanes], const float (&reach)[kBlockLanes], const Single& one,
                            double enough, LaneBounds& out) {
    const hn::Rebind<float, DoubleTag> narrow;
    const double rounding = 0x1p-43 * (one.reach + double{kLargestCenter});
    out.near = 0;
    for (size_t i = 0; i < kBlockLanes; i += kDoubleLanes) {
        const auto load = [&](const float* from) { return hn::PromoteTo(DoubleTag(), hn::Load(narrow, from + i)); };
        const auto load3 = [&](const float(&rows)[3][kBlockLanes]) {
            return Vector3<Double>{load(rows[0]), load(rows[1]), load(rows[2])};
        };
        const Vector3<Double> n = load3(out.n), c2 = load3(center);
        const Vector3<Double> r{c2.x - one.exact[0], c2.y - one.exact[1], c2.z - one.exact[2]};
        const Double square = dot(n, n), gap = dot(n, r) - load(reach) - rounding;
        const Double tangent = (3 - square) * (0.5 - 0x1p-49);
        const Double lower = gap * choose(square <= 1 + 0x1p-20, tangent, hn::Zero(DoubleTag()));
        store(lower, out.lower + i);
        out.near |= bits(DoubleTag(), hn::Not(lower >= enough)) << i;
    }
}

/// `enough`: a bound that need not be improved, in steps. Without `box`, and that of the lanes, if it is null.
HWY_INLINE void bound_lanes(const std::byte* block, int32_t step_exponent, const Single& one, const PlacedBox* box,
                            double enough, LaneBounds& out) {
    alignas(64) float center[3][kBlockLanes], reach[kBlockLanes];
    const LaneBoxes boxes(block);
    for (size_t i = 0; i < kBlockLanes; i += kFloatLanes) {
        const LaneNodes e = load_nodes(block, i, step_exponent);
        const Sym3 q2 = shape_of(e.factor);
        const Float size = sqrt(trace(q2));
        const Float3 n = bounding_direction(e, q2, size, one);
        store(reach_of_both(e, size, n, one, box, boxes, i, out), reach + i);
        store(n, out.n, i), store(e.center, center, i), store(size, out.size + i);
        store(length(between(e, one)), out.between + i);
    }
    bound_along(center, reach, one, enough, out);
}

/// What hulls of the nodes (null: not known) add to a lane's bound along n, steps; never negative. The terms of their
/// errors are those of hull_lanes-inl.hpp, and of the product above: that factor is at least 1 - 2^-20.
HWY_INLINE double hulls_add(const LaneBounds& at, uint32_t lane, float size, const std::byte* hull_one,
                            const std::byte* hull_lane) {
    const double x = at.n[0][lane], y = at.n[1][lane], z = at.n[2][lane];
    if (!(x * x + y * y + z * z <= 1 + 0x1p-20)) return 0; // nothing is claimed
    float saved = 0;
    if (hull_one != nullptr) {
        const float reach =
            hull_reach(hull_one, at.in_a[0][lane], at.in_a[1][lane], at.in_a[2][lane], at.width_a[lane]);
        saved += std::max(0.0f, at.reach_a[lane] - (reach + kLaneMargin * size));
    }
    if (hull_lane != nullptr) {
        const float reach =
            hull_reach(hull_lane, -at.in_b[0][lane], -at.in_b[1][lane], -at.in_b[2][lane], at.width_b[lane]);
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
