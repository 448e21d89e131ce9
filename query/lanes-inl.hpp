// The culling test: one ellipsoid against the eight lanes of a block, in single precision. Per SIMD target; include it
// below hwy/foreach_target.h. lane_gap() in query/lanes.cpp does the same operations on one
// lane in plain C++.
//
// The mathematics is that of query/separation.hpp: with r = c2 - c1 and Q = w1 Q1 + w2 Q2, the direction
//     n = adj(Q) r,     w1 : w2 = 1/|L1| : 1/|L2| (exact for spheres), scaled so that trace(Q) = 1,
// and the ellipsoids are separated by a plane with normal n if
//     p - a - b > 0,    p = n.r,  a = |L1^T n|,  b = |L2^T n|                                                      (1)
// for ANY n; (p - a - b) / |n| then bounds their distance from below. One evaluation leaves 8 % of the pairs undecided
// that a perfect direction would separate; the descent goes on for those.
//
// Why single precision suffices. Everything is in the lattice coordinates of the block's tree, where its centers c2 are
// integers below 2^16 and L2 = integers * 2^k: both exact. u = 2^-24, norms Euclidean or Frobenius.
//   c1      computed in double (within 2^-44 reach, LatticePose), rounded once:      |dc1| <= u |c1| + 2^-44 reach
//   r       one subtraction:                                                         |dr|  <= |dc1| + u |r|
//   L1      rounded rotation (u) times exact factor, 3 products and 2 sums:          |dL1| <= 4 sqrt(3) u |L1|
//   p       3 products, 2 sums:                        |dp| <= |n| (3 u |r| + |dr|) <= |n| (4 u |r| + |dc1|)
//   a       the same and sum of squares, square root:                                |da|  <= 14 u |n| |L1|
//   b                                                                                |db|  <= 7 u |n| |L2|
//   p - a - b  two roundings more:                                                   2 u |n| (|r| + |L1| + |L2|)
// With |r| <= |c1| + |c2| the computed left side of (1) is wrong by at most
//     |n| (u (7 |c1| + 6 |c2| + 16 |L1| + 9 |L2|) + 2^-44 reach) + O(u^2),
// and (1) is taken for true only beyond kLaneMargin |n|_1 (|c1| + |c2| + |L1| + |L2|) + 2^-43 |n|_1 reach, kLaneMargin
// = 32 u, |n| <= |n|_1: twice that, which pays for the rounding of the bound itself. This holds for every axis ratio:
// the factor form has no cancellation (the shape-matrix form n^T Q n, cheaper, does, and separates needles that
// overlap).
//
// Underflow: entries of Q are at most 1; a square below 2^-126 loses digits, which costs a and b at most 2^-74 each,
// far below the margin (at least 32 u 65535 |n|_1 > 0.1 |n|_1) if |n|_1 > 2^-60, which is demanded. Overflow, and NaN
// from whatever source, fail the comparison and so never separate.
//
// Cost: about 140 vector operations and two square roots for eight pairs.
#include "query/lanes.hpp"
#include "src/block.hpp"
#include "src/bytes.hpp"

#include <hwy/highway.h>

#include <cmath>
#include <cstdint>

// clang-format off
#if defined(PROLATE_QUERY_LANES_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef PROLATE_QUERY_LANES_INL_HPP
#undef PROLATE_QUERY_LANES_INL_HPP
#else
#define PROLATE_QUERY_LANES_INL_HPP
#endif
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace prolate::query::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// All eight lanes on every target: in one vector, or in parts of it.
using LaneTag = hn::CappedTag<float, kBlockLanes>;
using Lanes = hn::Vec<LaneTag>;

/// The ellipsoids of a block, from lane `first` on.
struct LaneNodes {
    Lanes x, y, z; ///< centers
    Lanes l11, l21, l22, l31, l32, l33;
};

// 16-bit integers at any address, as floats.
template <class T> HWY_INLINE Lanes load_integers(const std::byte* from) {
    const hn::Rebind<T, LaneTag> d16;
#if HWY_TARGET == HWY_SCALAR
    const auto stored = hn::Set(d16, load_le<T>(from));
#else
    const hn::Repartition<uint8_t, decltype(d16)> d8;
    const auto stored = hn::BitCast(d16, hn::LoadU(d8, reinterpret_cast<const uint8_t*>(from)));
#endif
    return hn::ConvertTo(LaneTag(), hn::PromoteTo(hn::Rebind<int32_t, LaneTag>(), stored));
}

HWY_INLINE LaneNodes load_nodes(const std::byte* block, size_t first, int32_t step_exponent) {
    const LaneTag d;
    const hn::Rebind<int32_t, LaneTag> d32;
    const hn::Rebind<int8_t, LaneTag> d8;
    const auto at = [block, first](size_t offset, size_t row) {
        return block + offset + 2 * (kBlockLanes * row + first);
    };
    const auto stored =
        hn::PromoteTo(d32, hn::LoadU(d8, reinterpret_cast<const int8_t*>(block + kBlockExponent + first)));
    const auto exponent =
        hn::Min(hn::Max(hn::Sub(stored, hn::Set(d32, 16 + step_exponent)), hn::Set(d32, kLowestExponent)),
                hn::Set(d32, kHighestExponent));
    const Lanes one = hn::BitCast(d, hn::ShiftLeft<23>(hn::Add(exponent, hn::Set(d32, 127))));
    const Lanes two = hn::Add(one, one); // off-diagonal integers count twice as much
    LaneNodes out;
    out.x = load_integers<uint16_t>(at(kBlockCenter, 0));
    out.y = load_integers<uint16_t>(at(kBlockCenter, 1));
    out.z = load_integers<uint16_t>(at(kBlockCenter, 2));
    out.l11 = hn::Mul(load_integers<uint16_t>(at(kBlockDiagonal, 0)), one);
    out.l22 = hn::Mul(load_integers<uint16_t>(at(kBlockDiagonal, 1)), one);
    out.l33 = hn::Mul(load_integers<uint16_t>(at(kBlockDiagonal, 2)), one);
    out.l21 = hn::Mul(load_integers<int16_t>(at(kBlockOffDiagonal, 0)), two);
    out.l31 = hn::Mul(load_integers<int16_t>(at(kBlockOffDiagonal, 1)), two);
    out.l32 = hn::Mul(load_integers<int16_t>(at(kBlockOffDiagonal, 2)), two);
    return out;
}

/// place() of lanes.hpp, which has the same operations: the columns of the factor as vectors of four.
HWY_INLINE Single place_here(const std::byte* block, uint32_t lane, const LatticePose& pose) {
    const LaneNode e = load_node(block, lane, pose.exponent_from);
    Single s;
    place_center(e, pose, s);
#if HWY_TARGET == HWY_SCALAR
    place_factor(e, pose, s);
#else
    const hn::FixedTag<float, 4> d;
    const auto r0 = hn::LoadU(d, pose.linear_rounded[0]), r1 = hn::LoadU(d, pose.linear_rounded[1]),
               r2 = hn::LoadU(d, pose.linear_rounded[2]);
    const auto set = [d](float value) { return hn::Set(d, value); };
    const auto f0 = hn::Add(hn::Add(hn::Mul(r0, set(e.l11)), hn::Mul(r1, set(e.l21))), hn::Mul(r2, set(e.l31)));
    const auto f1 = hn::Add(hn::Mul(r1, set(e.l22)), hn::Mul(r2, set(e.l32))), f2 = hn::Mul(r2, set(e.l33));
    hn::StoreU(f0, d, s.factor[0]), hn::StoreU(f1, d, s.factor[1]), hn::StoreU(f2, d, s.factor[2]);
    const auto column = [&](auto x, auto y, auto z) {
        return hn::Add(hn::Add(hn::Mul(f0, x), hn::Mul(f1, y)), hn::Mul(f2, z));
    };
    const auto q0 = column(hn::Broadcast<0>(f0), hn::Broadcast<0>(f1), hn::Broadcast<0>(f2));
    const auto q1 = column(hn::Broadcast<1>(f0), hn::Broadcast<1>(f1), hn::Broadcast<1>(f2));
    const auto q2 = column(hn::Broadcast<2>(f0), hn::Broadcast<2>(f1), hn::Broadcast<2>(f2));
    hn::StoreU(q0, d, s.shape[0]), hn::StoreU(q1, d, s.shape[1]), hn::StoreU(q2, d, s.shape[2]);
#endif
    place_size(pose.reach, s);
    place_box(s);
    cut_box(block, lane, pose, s);
    return s;
}

/// Bit i: the boxes do not tell lane i apart from the single.
HWY_INLINE uint32_t boxes_meet(const std::byte* block, const Single& s, float margin) {
    uint32_t meet = (1u << kBlockLanes) - 1;
    for (size_t i = 0; i < 3; ++i) {
        const auto [least, most] = box_thresholds(block, i, s, margin);
        if (least > 255 || most < 0) return 0;
        const auto row = [block, i](size_t array) { return block + array + kBlockLanes * i; };
#if HWY_TARGET == HWY_SCALAR
        for (uint32_t lane = 0; lane < kBlockLanes; ++lane)
            if (int32_t{load_le<uint8_t>(row(kBlockBoxLow) + lane)} > most ||
                int32_t{load_le<uint8_t>(row(kBlockBoxHigh) + lane)} < least)
                meet &= ~(1u << lane);
#else
        const hn::FixedTag<uint8_t, kBlockLanes> d;
        const auto load = [&](size_t array) { return hn::LoadU(d, reinterpret_cast<const uint8_t*>(row(array))); };
        const auto apart = hn::Or(hn::Gt(load(kBlockBoxLow), hn::Set(d, static_cast<uint8_t>(most))),
                                  hn::Lt(load(kBlockBoxHigh), hn::Set(d, static_cast<uint8_t>(least))));
        uint8_t bits[8] = {};
        hn::StoreMaskBits(d, apart, bits);
        meet &= ~uint32_t{bits[0]};
#endif
    }
    return meet;
}

HWY_INLINE Lanes sum_of_squares(Lanes x, Lanes y, Lanes z) {
    return hn::Add(hn::Add(hn::Mul(x, x), hn::Mul(y, y)), hn::Mul(z, z));
}
HWY_INLINE Lanes dot(Lanes x, Lanes y, Lanes z, Lanes u, Lanes v, Lanes w) {
    return hn::Add(hn::Add(hn::Mul(x, u), hn::Mul(y, v)), hn::Mul(z, w));
}
/// x y - z w
HWY_INLINE Lanes minor(Lanes x, Lanes y, Lanes z, Lanes w) {
    return hn::Sub(hn::Mul(x, y), hn::Mul(z, w));
}

/// Q2 = L2 L2^T of each lane, and |L2|.
struct LaneShapes {
    Lanes xx, yy, zz, yz, xz, xy;
    Lanes size;
};
HWY_INLINE LaneShapes shapes_of(const LaneNodes& e) {
    LaneShapes q;
    q.xx = hn::Mul(e.l11, e.l11), q.xy = hn::Mul(e.l21, e.l11), q.xz = hn::Mul(e.l31, e.l11);
    q.yy = hn::Add(hn::Mul(e.l21, e.l21), hn::Mul(e.l22, e.l22));
    q.yz = hn::Add(hn::Mul(e.l31, e.l21), hn::Mul(e.l32, e.l22));
    q.zz = sum_of_squares(e.l31, e.l32, e.l33);
    q.size = hn::Sqrt(hn::Add(hn::Add(q.xx, q.yy), q.zz));
    return q;
}

struct LaneVector {
    Lanes x, y, z;
};
/// c2 - c1.
HWY_INLINE LaneVector between(const LaneNodes& e, const Single& s) {
    const LaneTag d;
    return {hn::Sub(e.x, hn::Set(d, s.center[0])), hn::Sub(e.y, hn::Set(d, s.center[1])),
            hn::Sub(e.z, hn::Set(d, s.center[2]))};
}
/// adj(Q) r.
HWY_INLINE LaneVector adjugate_times(const LaneShapes& q, const LaneVector& r) {
    const Lanes xx = minor(q.yy, q.zz, q.yz, q.yz), yy = minor(q.xx, q.zz, q.xz, q.xz);
    const Lanes zz = minor(q.xx, q.yy, q.xy, q.xy), xy = minor(q.xz, q.yz, q.xy, q.zz);
    const Lanes xz = minor(q.xy, q.yz, q.xz, q.yy), yz = minor(q.xy, q.xz, q.xx, q.yz);
    return {dot(xx, xy, xz, r.x, r.y, r.z), dot(xy, yy, yz, r.x, r.y, r.z), dot(xz, yz, zz, r.x, r.y, r.z)};
}
/// w1 Q1 / |L1| + w2 Q2.
HWY_INLINE LaneShapes mixed(const LaneShapes& q, Lanes w1, Lanes w2, const Single& s) {
    const LaneTag d;
    const Lanes weight = hn::Mul(w1, hn::Set(d, s.weight));
    const auto mix = [&](float q1, Lanes q2) { return hn::Add(hn::Mul(weight, hn::Set(d, q1)), hn::Mul(w2, q2)); };
    return {mix(s.shape[0][0], q.xx),
            mix(s.shape[1][1], q.yy),
            mix(s.shape[2][2], q.zz),
            mix(s.shape[1][2], q.yz),
            mix(s.shape[0][2], q.xz),
            mix(s.shape[0][1], q.xy),
            q.size};
}
/// a = |L1^T n|.
HWY_INLINE Lanes width(const Single& s, const LaneVector& n) {
    const auto along = [&](size_t column) {
        const LaneTag d;
        return dot(hn::Set(d, s.factor[column][0]), hn::Set(d, s.factor[column][1]), hn::Set(d, s.factor[column][2]),
                   n.x, n.y, n.z);
    };
    return hn::Sqrt(sum_of_squares(along(0), along(1), along(2)));
}
/// b = |L2^T n|.
HWY_INLINE Lanes width(const LaneNodes& e, const LaneVector& n) {
    const Lanes second = hn::Add(hn::Mul(e.l22, n.y), hn::Mul(e.l32, n.z));
    return hn::Sqrt(sum_of_squares(dot(e.l11, e.l21, e.l31, n.x, n.y, n.z), second, hn::Mul(e.l33, n.z)));
}

/// The terms of (1) for one direction in each lane.
struct LaneTerms {
    Lanes p, a, b;
    Lanes length;  ///< |n|_1
    Lanes x, y, z; ///< n
    Lanes size;    ///< |L2|
    Lanes gap;     ///< p - a - b less the margin
    Lanes sum;     ///< a + b
};

HWY_INLINE LaneTerms evaluate(const LaneNodes& e, const Single& s) {
    const LaneTag d;
    const auto set = [d](float value) { return hn::Set(d, value); };
    const LaneShapes q = shapes_of(e);
    const Lanes w2 = hn::Div(set(1), hn::Mul(q.size, hn::Add(q.size, set(s.size)))); // the trace of Q1 / |L1| is |L1|
    const LaneVector r = between(e, s), n = adjugate_times(mixed(q, hn::Mul(q.size, w2), w2, s), r);
    LaneTerms t;
    t.x = n.x, t.y = n.y, t.z = n.z;
    t.size = q.size;
    t.a = width(s, n), t.b = width(e, n);
    t.p = dot(n.x, n.y, n.z, r.x, r.y, r.z);
    t.sum = hn::Add(t.a, t.b);
    t.length = hn::Add(hn::Add(hn::Abs(n.x), hn::Abs(n.y)), hn::Abs(n.z));
    const Lanes slack = hn::Add(set(s.slack), hn::Mul(set(kLaneMargin), q.size));
    t.gap = hn::Sub(hn::Sub(t.p, t.sum), hn::Mul(slack, t.length));
    return t;
}

/// Lanes that are certainly farther apart than `margin`, in steps of the block's lattice.
template <bool kMargin> HWY_INLINE auto separated(const LaneTerms& t, Lanes margin) {
    const LaneTag d;
    Lanes threshold = hn::Zero(d);
    if constexpr (kMargin) threshold = hn::Mul(margin, hn::Sqrt(sum_of_squares(t.x, t.y, t.z)));
    return hn::And(hn::Gt(t.gap, threshold), hn::Gt(t.length, hn::Set(d, kLaneDirection)));
}

template <class Mask> HWY_INLINE uint32_t bits_of(Mask mask, size_t first) {
    uint8_t bits[8] = {};
    hn::StoreMaskBits(LaneTag(), mask, bits);
    return uint32_t{bits[0]} << first;
}

} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif // PROLATE_QUERY_LANES_INL_HPP
