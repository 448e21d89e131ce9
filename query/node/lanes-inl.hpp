// The culling test: one ellipsoid against the eight lanes of a block, in single precision. Per SIMD target; include it
// below hwy/foreach_target.h. lane_gap() in query/node/lanes.cpp does the same operations on one
// lane in plain C++.
//
// The mathematics is that of query/ellipsoid/separation.hpp: with r = c2 - c1 and Q = w1 Q1 + w2 Q2, the direction
//     n = adj(Q) r,     w1 : w2 = 1/|L1| : 1/|L2| (exact for spheres), scaled so that trace(Q) = 1,
// and the ellipsoids are separated by a plane with normal n if
//     p - a - b > 0,    p = n.r,  a = |L1^T n|,  b = |L2^T n|                                                      (1)
// for ANY n; (p - a - b) / |n| then bounds their distance from below. One evaluation leaves 8 % of the pairs undecided
// that a perfect direction would separate; the descent goes on for those.
//
// Why single precision suffices. Everything is in the lattice coordinates of the block's tree, where its centers c2 are
// integers below 2^16, and L2 is what the format says it is, a float each: both exact. u = 2^-24, norms Euclidean or
// Frobenius.
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
// Underflow: no entry of L2 is below 2^-60 (kMinNodeSize) but for 0. Entries of Q are at most 1; a square below 2^-126
// loses digits, which costs a and b at most 2^-74 each, far below the margin (at least 32 u 65535 |n|_1 > 0.1 |n|_1) if
// |n|_1 > 2^-60, which is demanded. Overflow, and NaN from whatever source, fail the comparison and so never separate.
//
// Cost: about 140 vector operations and two square roots for eight pairs.
#include "query/node/lanes.hpp"
#include "src/block.hpp"
#include "src/bytes.hpp"

#include <hwy/highway.h>

#include <algorithm>
#include <bit>
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

static_assert(
    HWY_TARGET == HWY_SCALAR || std::endian::native == std::endian::little,
    "vectors take the file's little-endian numbers as they stand: disable this target in query/simd/targets.hpp");

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
    const Lanes unit =
        hn::BitCast(d, hn::ShiftLeft<23>(hn::Add(stored, hn::Set(d32, kFactorBias - step_exponent)))); // factor_unit()
    const auto diagonal = [&](size_t row) {
        const Lanes q = load_integers<uint16_t>(at(kBlockDiagonal, row));
        return hn::Mul(hn::Mul(q, unit), q);
    };
    const auto off_diagonal = [&](size_t row) {
        const Lanes q = load_integers<int16_t>(at(kBlockOffDiagonal, row));
        return hn::Mul(hn::Mul(q, unit), hn::Abs(q));
    };
    LaneNodes out{};
    out.x = load_integers<uint16_t>(at(kBlockCenter, 0));
    out.y = load_integers<uint16_t>(at(kBlockCenter, 1));
    out.z = load_integers<uint16_t>(at(kBlockCenter, 2));
    out.l11 = diagonal(0), out.l22 = diagonal(1), out.l33 = diagonal(2);
    out.l21 = off_diagonal(0), out.l31 = off_diagonal(1), out.l32 = off_diagonal(2);
    return out;
}

// The sum of the first three components, in the first.
template <class V> HWY_INLINE V sum_of_three(V v) {
#if HWY_TARGET == HWY_SCALAR
    return v; // not used
#else
    return hn::Add(hn::Add(v, hn::Shuffle0321(v)), hn::Shuffle1032(v));
#endif
}

/// place() of lanes.hpp, which has the same operations: vectors of four hold x, y, z.
HWY_INLINE Single place_here(const std::byte* block, uint32_t lane, const LatticePose& pose, PlacedBox* box = nullptr) {
#if HWY_TARGET == HWY_SCALAR
    return place(block, lane, pose, box);
#else
    const hn::FixedTag<float, 4> d;
    const hn::FixedTag<int32_t, 4> d32;
    const hn::FixedTag<uint8_t, 16> d8;
    // The node as stored, each number of the factor in all four components.
    const auto unit = hn::Set(d, factor_unit(load_le<int8_t>(block + kBlockExponent + lane), pose.exponent_from));
    const auto diagonal = [&](size_t row) {
        const auto twice =
            hn::Set(hn::FixedTag<uint16_t, 8>(), load_le<uint16_t>(block + block_offset(kBlockDiagonal, row, lane)));
        const auto stored = hn::ShiftRight<16>(hn::BitCast(hn::FixedTag<uint32_t, 4>(), twice));
        const auto q = hn::ConvertTo(d, hn::BitCast(d32, stored));
        return hn::Mul(hn::Mul(q, unit), q);
    };
    const auto off_diagonal = [&](size_t row) {
        const auto twice =
            hn::Set(hn::FixedTag<int16_t, 8>(), load_le<int16_t>(block + block_offset(kBlockOffDiagonal, row, lane)));
        const auto q = hn::ConvertTo(d, hn::ShiftRight<16>(hn::BitCast(d32, twice)));
        return hn::Mul(hn::Mul(q, unit), hn::Abs(q));
    };
    const auto l21 = off_diagonal(0), l31 = off_diagonal(1), l32 = off_diagonal(2);
    const auto coordinate = [&](size_t row) {
        return int32_t{load_le<uint16_t>(block + block_offset(kBlockCenter, row, lane))};
    };
    const int32_t stored_x = coordinate(0), stored_y = coordinate(1), stored_z = coordinate(2);
    const auto stored_center = hn::InsertLane(hn::InsertLane(hn::Set(d32, stored_x), 1, stored_y), 2, stored_z);

    Single s;
    const hn::CappedTag<double, 4> d64;
    const auto wide = [d64](int32_t stored) { return hn::Set(d64, static_cast<double>(stored)); };
    const auto x = wide(stored_x), y = wide(stored_y), z = wide(stored_z);
    for (size_t i = 0; i < 4; i += hn::Lanes(d64)) {
        const auto column = [&](size_t c) { return hn::Load(d64, pose.linear[c] + i); };
        const auto exact = hn::Add(hn::Add(hn::Mul(column(0), x), hn::Mul(column(1), y)),
                                   hn::Add(hn::Mul(column(2), z), hn::Load(d64, pose.offset + i)));
        const hn::Rebind<float, decltype(d64)> rounded;
        hn::Store(exact, d64, s.exact + i), hn::StoreU(hn::DemoteTo(rounded, exact), rounded, s.center + i);
    }
    const auto center = hn::Load(d, s.center);

    const auto r0 = hn::Load(d, pose.linear_rounded[0]), r1 = hn::Load(d, pose.linear_rounded[1]),
               r2 = hn::Load(d, pose.linear_rounded[2]);
    const auto along = [&](auto a, auto b, auto c, auto at_x, auto at_y, auto at_z) {
        return hn::Add(hn::Add(hn::Mul(a, at_x), hn::Mul(b, at_y)), hn::Mul(c, at_z));
    };
    const auto f0 = along(r0, r1, r2, diagonal(0), l21, l31);
    const auto f1 = hn::Add(hn::Mul(r1, diagonal(1)), hn::Mul(r2, l32)), f2 = hn::Mul(r2, diagonal(2));
    hn::Store(f0, d, s.factor[0]), hn::Store(f1, d, s.factor[1]), hn::Store(f2, d, s.factor[2]);
    const auto squares = along(f0, f1, f2, f0, f1, f2);
    hn::Store(squares, d, s.diagonal);
    hn::Store(along(f0, f1, f2, hn::Shuffle0321(f0), hn::Shuffle0321(f1), hn::Shuffle0321(f2)), d, s.off_diagonal);

    const auto size = hn::Sqrt(sum_of_three(squares));
    s.size = hn::GetLane(size), s.weight = hn::GetLane(hn::Div(hn::Set(d, 1), size));
    const auto slack =
        hn::Broadcast<0>(hn::Add(hn::Mul(hn::Set(d, kLaneMargin), hn::Add(sum_of_three(hn::Abs(center)), size)),
                                 hn::Set(d, common_slack(pose.reach))));
    s.slack = hn::GetLane(slack), s.reach = pose.reach;
    const auto half_ellipsoid = hn::Add(hn::Sqrt(squares), slack);
    const auto low = hn::Sub(center, half_ellipsoid), high = hn::Add(center, half_ellipsoid);

    // The box: its corners' bytes stand eight apart in a row.
    const auto load = [&](size_t offset) { return hn::LoadU(d8, reinterpret_cast<const uint8_t*>(block + offset)); };
    constexpr uint8_t o = 0x80; // gives a zero
    alignas(16) static constexpr uint8_t kTwoRows[] = {0, o, o, o, 8, o, o, o, o, o, o, o, o, o, o, o};
    alignas(16) static constexpr uint8_t kLastRow[] = {o, o, o, o, o, o, o, o, 8, o, o, o, o, o, o, o};
    const auto move_on = hn::Set(d8, static_cast<uint8_t>(lane));
    const auto two_rows = hn::Add(hn::Load(d8, kTwoRows), move_on), last_row = hn::Add(hn::Load(d8, kLastRow), move_on);
    const auto corner = [&](size_t array) {
        return hn::BitCast(d32, hn::Or(hn::TableLookupBytesOr0(load(array), two_rows),
                                       hn::TableLookupBytesOr0(load(array + kBlockLanes), last_row)));
    };
    const auto box_low = corner(kBlockBoxLow), box_high = corner(kBlockBoxHigh);
    const hn::Rebind<uint8_t, decltype(d32)> four;
    const auto box_exponent =
        hn::PromoteTo(d32, hn::LoadU(four, reinterpret_cast<const uint8_t*>(block + kBlockBoxExponent)));
    const auto half_step = hn::BitCast(d, hn::ShiftLeft<23>(hn::Add(box_exponent, hn::Set(d32, 126))));
    const auto origin = hn::ConvertTo(d, hn::BitCast(d32, load(kBlockBoxOrigin)));
    const auto box_center = hn::Add(origin, hn::Mul(hn::ConvertTo(d, hn::Add(box_low, box_high)), half_step));
    const auto away = hn::Sub(box_center, hn::ConvertTo(d, stored_center));
    const auto half = hn::Add(hn::Mul(hn::ConvertTo(d, hn::Sub(box_high, box_low)), half_step),
                              hn::Add(hn::Mul(hn::Set(d, kBoxMargin), hn::Abs(box_center)), hn::Set(d, kBoxSlack)));
    const auto half_x = hn::Broadcast<0>(half), half_y = hn::Broadcast<1>(half), half_z = hn::Broadcast<2>(half);
    const auto turned = along(r0, r1, r2, hn::Broadcast<0>(away), hn::Broadcast<1>(away), hn::Broadcast<2>(away));
    const auto around = along(hn::Abs(r0), hn::Abs(r1), hn::Abs(r2), half_x, half_y, half_z);
    const auto at = hn::Add(center, turned), half_box = hn::Add(slack, around);
    const auto from = hn::Sub(at, half_box), to = hn::Add(at, half_box);
    hn::Store(hn::IfThenElse(hn::Gt(from, low), from, low), d, s.low);
    hn::Store(hn::IfThenElse(hn::Lt(to, high), to, high), d, s.high);
    if (box != nullptr) {
        hn::Store(turned, d, box->center);
        hn::Store(hn::Mul(r0, half_x), d, box->axis[0]), hn::Store(hn::Mul(r1, half_y), d, box->axis[1]);
        hn::Store(hn::Mul(r2, half_z), d, box->axis[2]);
        box->slack = kLaneMargin * hn::GetLane(sum_of_three(hn::Add(hn::Abs(turned), around)));
    }
    return s;
#endif
}

/// Bit i: the boxes do not tell lane i apart from the single.
HWY_INLINE uint32_t boxes_meet(const std::byte* block, const Single& s, float margin) {
#if HWY_TARGET == HWY_SCALAR
    uint32_t meet = 0;
    for (uint32_t lane = 0; lane < kBlockLanes; ++lane) meet |= uint32_t{!boxes_apart(block, lane, s, margin)} << lane;
    return meet;
#else
    // Along an axis, a lane's box meets the single's if its upper end is at least `least` and its lower end at most
    // `most`, box steps: integers, rounded so that too many meet rather than too few. NaN lets all meet. What rounding
    // costs in the differences, 2 u of the lengths, is a fraction of the slack in s.low and s.high.
    const hn::FixedTag<float, 4> d;
    const hn::FixedTag<int32_t, 4> d32;
    const hn::Rebind<uint8_t, decltype(d32)> four;
    const auto exponent =
        hn::PromoteTo(d32, hn::LoadU(four, reinterpret_cast<const uint8_t*>(block + kBlockBoxExponent)));
    const auto per_step = hn::BitCast(d, hn::ShiftLeft<23>(hn::Sub(hn::Set(d32, 127), exponent)));
    const hn::FixedTag<uint8_t, 16> d8;
    const auto origin =
        hn::ConvertTo(d, hn::BitCast(d32, hn::LoadU(d8, reinterpret_cast<const uint8_t*>(block + kBlockBoxOrigin))));
    const auto inflation = hn::Set(d, margin), zero = hn::Zero(d), last = hn::Set(d, 255);
    const auto low = hn::Mul(hn::Sub(hn::Sub(hn::Load(d, s.low), inflation), origin), per_step);
    const auto high = hn::Mul(hn::Sub(hn::Add(hn::Load(d, s.high), inflation), origin), per_step);
    const auto least =
        hn::Min(hn::IfThenElse(hn::Gt(low, zero), hn::Add(low, hn::Set(d, kAlmostOne)), zero), hn::Set(d, 256));
    const auto most = hn::Max(hn::IfThenElse(hn::Lt(high, last), high, last), hn::Set(d, -1));
    const hn::FixedTag<int16_t, kBlockLanes> d16;
    const hn::Rebind<uint8_t, decltype(d16)> eight;
    // Of each of them, the word that all lanes of an axis are compared with.
    alignas(16) static constexpr uint8_t kWord[3][16] = {{0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1},
                                                         {4, 5, 4, 5, 4, 5, 4, 5, 4, 5, 4, 5, 4, 5, 4, 5},
                                                         {8, 9, 8, 9, 8, 9, 8, 9, 8, 9, 8, 9, 8, 9, 8, 9}};
    const auto bound = [&](auto v, size_t i) {
        return hn::BitCast(d16, hn::TableLookupBytes(hn::BitCast(d8, hn::ConvertTo(d32, v)), hn::Load(d8, kWord[i])));
    };
    const auto apart = [&](size_t i) {
        const auto ends = [&](size_t array) {
            return hn::PromoteTo(d16,
                                 hn::LoadU(eight, reinterpret_cast<const uint8_t*>(block + array + kBlockLanes * i)));
        };
        return hn::Or(hn::Gt(bound(least, i), ends(kBlockBoxHigh)), hn::Gt(ends(kBlockBoxLow), bound(most, i)));
    };
    uint8_t bits[8] = {};
    hn::StoreMaskBits(d16, hn::Or(apart(0), hn::Or(apart(1), apart(2))), bits);
    return ~uint32_t{bits[0]} & ((1u << kBlockLanes) - 1);
#endif
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
    LaneShapes q{};
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
    return {mix(s.diagonal[0], q.xx),
            mix(s.diagonal[1], q.yy),
            mix(s.diagonal[2], q.zz),
            mix(s.off_diagonal[1], q.yz),
            mix(s.off_diagonal[2], q.xz),
            mix(s.off_diagonal[0], q.xy),
            q.size};
}
HWY_INLINE Lanes length(const LaneVector& v) {
    return hn::Sqrt(sum_of_squares(v.x, v.y, v.z));
}
/// L1^T n.
HWY_INLINE LaneVector transposed_times(const Single& s, const LaneVector& n) {
    const auto along = [&](size_t column) {
        const LaneTag d;
        return dot(hn::Set(d, s.factor[column][0]), hn::Set(d, s.factor[column][1]), hn::Set(d, s.factor[column][2]),
                   n.x, n.y, n.z);
    };
    return {along(0), along(1), along(2)};
}
/// L2^T n.
HWY_INLINE LaneVector transposed_times(const LaneNodes& e, const LaneVector& n) {
    return {dot(e.l11, e.l21, e.l31, n.x, n.y, n.z), hn::Add(hn::Mul(e.l22, n.y), hn::Mul(e.l32, n.z)),
            hn::Mul(e.l33, n.z)};
}

/// How far an ellipsoid reaches along n from its center: a = |L1^T n|, or b = |L2^T n|.
template <class E> HWY_INLINE Lanes width(const E& e, const LaneVector& n) {
    return length(transposed_times(e, n));
}

/// The terms of (1) for one direction in each lane.
struct LaneTerms {
    Lanes p, a, b;
    Lanes length;          ///< |n|_1
    Lanes x, y, z;         ///< n
    Lanes size;            ///< |L2|
    Lanes gap;             ///< p - a - b less the margin
    Lanes sum;             ///< a + b
    LaneVector in_a, in_b; ///< L1^T n, L2^T n: a and b are their lengths
};

HWY_INLINE LaneTerms evaluate(const LaneNodes& e, const Single& s) {
    const LaneTag d;
    const auto set = [d](float value) { return hn::Set(d, value); };
    const LaneShapes q = shapes_of(e);
    const Lanes w2 = hn::Div(set(1), hn::Mul(q.size, hn::Add(q.size, set(s.size)))); // the trace of Q1 / |L1| is |L1|
    const LaneVector r = between(e, s), n = adjugate_times(mixed(q, hn::Mul(q.size, w2), w2, s), r);
    LaneTerms t{};
    t.x = n.x, t.y = n.y, t.z = n.z;
    t.size = q.size;
    t.in_a = transposed_times(s, n), t.in_b = transposed_times(e, n);
    t.a = length(t.in_a), t.b = length(t.in_b);
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
