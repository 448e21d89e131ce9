// The culling test: one ellipsoid against the eight lanes of a block, in single precision. Per SIMD target; include it
// below hwy/foreach_target.h. The tests have a scalar reference.
//
// The mathematics is that of query/ellipsoid/separation.hpp: with r = c2 - c1 and Q = w1 Q1 + w2 Q2, the direction
//     n = adj(Q) r,     w1 : w2 = 1/|L1| : 1/|L2| (exact for spheres), scaled so that trace(Q) = 1,
// and the ellipsoids are separated by a plane with normal n if
//     p - a - b > 0,    p = n.r,  a = |L1^T n|,  b = |L2^T n|                                                      (1)
// for ANY n; (p - a - b) / |n| then bounds their distance from below. One evaluation leaves 8 % of the pairs undecided
// that a perfect direction would separate; the traversal goes on for those.
//
// Why single precision suffices. Everything is in the lattice coordinates of the block's tree, where its centers c2 are
// multiples of 2^-5 up to 65535, and L2 is what the format says it is, a float each: both exact. u = 2^-24, norms
// Euclidean or Frobenius.
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
#include "query/node/block_box-inl.hpp"
#include "query/node/lanes.hpp"

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

/// The ellipsoids of a block, from lane `first` on.
struct LaneNodes {
    Float3 center;
    Lower3 factor;
};
HWY_INLINE LaneNodes load_nodes(const std::byte* block, size_t first, int32_t step_exponent) {
    const hn::Rebind<int32_t, FloatTag> d32;
    const hn::Rebind<int8_t, FloatTag> d8;
    const auto at = [block, first](size_t offset, size_t row) {
        return block + offset + 2 * (kBlockLanes * row + first);
    };
    const auto stored =
        hn::PromoteTo(d32, hn::LoadU(d8, reinterpret_cast<const int8_t*>(block + kBlockExponent + first)));
    const Float unit = hn::BitCast(
        FloatTag(), hn::ShiftLeft<23>(hn::Add(stored, hn::Set(d32, kFactorBias - step_exponent)))); // factor_unit()
    const auto diagonal = [&](size_t row) {
        const Float q = load_integers<uint16_t>(at(kBlockDiagonal, row));
        return q * unit * q;
    };
    const auto off_diagonal = [&](size_t row) {
        const Float q = load_integers<int16_t>(at(kBlockOffDiagonal, row));
        return q * unit * abs(q);
    };
    const auto fractions = load_widened<uint16_t>(block + kBlockFraction + 2 * first);
    const auto center = [&](size_t row) { // exact, so that a fused operation gives the same bits
        const Float fraction = hn::ConvertTo(FloatTag(), hn::And(fractions, hn::Set(d32, fraction_mask(row))));
        return hn::MulAdd(fraction, set(fraction_unit(row)), load_integers<uint16_t>(at(kBlockCenter, row)));
    };
    LaneNodes out{};
    out.center = {center(0), center(1), center(2)};
    out.factor = {.l11 = diagonal(0),
                  .l21 = off_diagonal(0),
                  .l22 = diagonal(1),
                  .l31 = off_diagonal(1),
                  .l32 = off_diagonal(2),
                  .l33 = diagonal(2)};
    return out;
}

/// All nodes of a block as Singles, in lanes: in the lattice that they are compared in.
struct PlacedBlock {
    using Lanes = float[kBlockLanes];
    alignas(64) Lanes center[3];
    alignas(64) Lanes factor[3][3]; // columns
    alignas(64) Lanes diagonal[3], off_diagonal[3], low[3], high[3];
    alignas(64) Lanes size, weight, slack;
    double reach;

    Single operator[](size_t lane) const {
        Single s;
        for (size_t k = 0; k < 3; ++k) {
            s.center[k] = center[k][lane];
            for (size_t c = 0; c < 3; ++c) s.factor[c][k] = factor[c][k][lane];
            s.diagonal[k] = diagonal[k][lane], s.off_diagonal[k] = off_diagonal[k][lane];
            s.low[k] = low[k][lane], s.high[k] = high[k][lane];
        }
        s.low[3] = s.high[3] = 0;
        s.size = size[lane], s.weight = weight[lane], s.slack = slack[lane], s.reach = reach;
        return s;
    }
};

/// As place_here() of each node, but for centers in single precision and boxes that are those of the ellipsoids.
///
/// A center is M c + o, M of row norm s = pose.scale, both rounded: with 3 products and 3 sums,
///     |dc1| <= 5 u sqrt(3) s |c| + 2 u |o|  <=  u (11 s |c| + 2 |c1|),
/// where lanes above have u |c1|. The slack has kLaneMargin s |c| = 32 u s |c| more, twice as much again.
HWY_INLINE void place_block(const std::byte* block, const LatticePose& pose, PlacedBlock& out) {
    const float common = common_slack(pose.reach) + kLaneMargin * kLargestCenter * pose.scale;
    const float(&m)[3][4] = pose.linear_rounded;
    for (size_t i = 0; i < kBlockLanes; i += kFloatLanes) {
        const LaneNodes e = load_nodes(block, i, pose.exponent_from);
        Float size_squared = set(0), at = set(0);
        for (size_t r = 0; r < 3; ++r) {
            const Float x = set(m[0][r]), y = set(m[1][r]), z = set(m[2][r]);
            const Float center = x * e.center.x + y * e.center.y + z * e.center.z + static_cast<float>(pose.offset[r]);
            const Float f0 = x * e.factor.l11 + y * e.factor.l21 + z * e.factor.l31,
                        f1 = y * e.factor.l22 + z * e.factor.l32, f2 = z * e.factor.l33;
            const Float square = f0 * f0 + f1 * f1 + f2 * f2;
            store(center, out.center[r] + i), store(square, out.diagonal[r] + i);
            store(f0, out.factor[0][r] + i), store(f1, out.factor[1][r] + i), store(f2, out.factor[2][r] + i);
            size_squared = size_squared + square, at = at + abs(center);
        }
        const Float size = sqrt(size_squared), slack = common + kLaneMargin * (at + size);
        store(size, out.size + i), store(1 / size, out.weight + i), store(slack, out.slack + i);
        for (size_t r = 0; r < 3; ++r) {
            const size_t next = (r + 1) % 3; // xy, yz, zx
            const auto product = [&](size_t column) {
                return load(out.factor[column][r] + i) * load(out.factor[column][next] + i);
            };
            store(product(0) + product(1) + product(2), out.off_diagonal[r] + i);
            const Float center = load(out.center[r] + i), half = sqrt(load(out.diagonal[r] + i)) + slack;
            store(center - half, out.low[r] + i), store(center + half, out.high[r] + i);
        }
    }
    out.reach = pose.reach;
}

/// Bit i: the boxes do not separate lane i from the single.
HWY_INLINE uint32_t boxes_meet(const std::byte* block, const Single& s, float margin) {
#if HWY_TARGET == HWY_SCALAR
    uint32_t meet = 0;
    for (uint32_t lane = 0; lane < kBlockLanes; ++lane) meet |= uint32_t{!boxes_apart(block, lane, s, margin)} << lane;
    return meet;
#else
    // Along an axis, a lane's box meets the single's if its upper end is at least `least` and its lower end at most
    // `most`, box steps: integers, rounded so that too many meet rather than too few. NaN lets all meet. What rounding
    // costs in the differences, 2 u of the lengths, is a fraction of the slack in s.low and s.high.
    const Quad origin = box_origin(block);
    const Quad per_step = powers_of_two(hn::Zero(QuadIntegerTag()) - box_exponent(block));
    const Quad low = (load<Quad>(s.low) - margin - origin) * per_step;
    const Quad high = (load<Quad>(s.high) + margin - origin) * per_step;
    const Quad zero = broadcast<Quad>(0), last = broadcast<Quad>(255);
    const Quad least = min(choose(low > zero, low + kAlmostOne, zero), broadcast<Quad>(256));
    const Quad most = max(choose(high < last, high, last), broadcast<Quad>(-1));
    const hn::FixedTag<int16_t, kBlockLanes> d16;
    // Of each of them, the word that all lanes of an axis are compared with.
    alignas(16) static constexpr uint8_t kWord[3][16] = {{0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1},
                                                         {4, 5, 4, 5, 4, 5, 4, 5, 4, 5, 4, 5, 4, 5, 4, 5},
                                                         {8, 9, 8, 9, 8, 9, 8, 9, 8, 9, 8, 9, 8, 9, 8, 9}};
    const auto bound = [&](Quad v, size_t axis) {
        const auto bytes = hn::BitCast(QuadByteTag(), hn::ConvertTo(QuadIntegerTag(), v));
        return hn::BitCast(d16, hn::TableLookupBytes(bytes, hn::Load(QuadByteTag(), kWord[axis])));
    };
    const auto sides = [&](size_t array, size_t axis) {
        const hn::Rebind<uint8_t, decltype(d16)> eight;
        const std::byte* const from = block + array + kBlockLanes * axis;
        return hn::PromoteTo(d16, hn::LoadU(eight, reinterpret_cast<const uint8_t*>(from)));
    };
    const auto apart = [&](size_t axis) {
        return hn::Or(bound(least, axis) > sides(kBlockBoxHigh, axis), sides(kBlockBoxLow, axis) > bound(most, axis));
    };
    return ~bits(d16, hn::Or(apart(0), hn::Or(apart(1), apart(2)))) & ((1u << kBlockLanes) - 1);
#endif
}

/// c2 - c1.
HWY_INLINE Float3 between(const LaneNodes& e, const Single& s) {
    return e.center - set(s.center);
}
/// Q1.
HWY_INLINE Sym3 shape_of(const Single& s) {
    return {.xx = set(s.diagonal[0]),
            .xy = set(s.off_diagonal[0]),
            .yy = set(s.diagonal[1]),
            .xz = set(s.off_diagonal[2]),
            .yz = set(s.off_diagonal[1]),
            .zz = set(s.diagonal[2])};
}
/// w1 Q1 / |L1| + w2 Q2.
HWY_INLINE Sym3 mixed(const Single& s, const Sym3& q2, Float w1, Float w2) {
    return (w1 * s.weight) * shape_of(s) + w2 * q2;
}
/// L1^T n.
HWY_INLINE Float3 transposed_times(const Single& s, const Float3& n) {
    return {dot(set(s.factor[0]), n), dot(set(s.factor[1]), n), dot(set(s.factor[2]), n)};
}
/// How far an ellipsoid reaches along n from its center: a = |L1^T n|, or b = |L2^T n|.
HWY_INLINE Float width(const Single& s, const Float3& n) {
    return length(transposed_times(s, n));
}
HWY_INLINE Float width(const LaneNodes& e, const Float3& n) {
    return length(transposed_times(e.factor, n));
}

/// The terms of (1) for one direction in each lane.
struct LaneTerms {
    Float3 n;
    Float p, a, b;
    Float one_norm;    ///< |n|_1
    Float size;        ///< |L2|
    Float gap;         ///< p - a - b less the margin
    Float sum;         ///< a + b
    Float3 in_a, in_b; ///< L1^T n, L2^T n: a and b are their lengths
};

HWY_INLINE LaneTerms evaluate(const LaneNodes& e, const Single& s) {
    const Sym3 q2 = shape_of(e.factor);
    LaneTerms t{};
    t.size = sqrt(trace(q2));
    const Float w2 = 1 / (t.size * (t.size + s.size)); // the trace of Q1 / |L1| is |L1|
    const Float3 r = between(e, s);
    t.n = adjugate(mixed(s, q2, t.size * w2, w2)) * r;
    t.in_a = transposed_times(s, t.n), t.in_b = transposed_times(e.factor, t.n);
    t.a = length(t.in_a), t.b = length(t.in_b);
    t.p = dot(t.n, r);
    t.sum = t.a + t.b;
    t.one_norm = one_norm(t.n);
    t.gap = t.p - t.sum - (s.slack + kLaneMargin * t.size) * t.one_norm;
    return t;
}

/// Lanes that are certainly farther apart than `margin`, in steps of the block's lattice.
template <bool kMargin> HWY_INLINE Mask separated(const LaneTerms& t, Float margin) {
    Float threshold = set(0);
    if constexpr (kMargin) threshold = margin * length(t.n);
    return (t.gap > threshold) & (t.one_norm > kLaneDirection);
}

/// Lanes that certainly overlap the single; t: what evaluate() found. With Q = W1 Q1 + W2 Q2 as there, its trace 1, the
/// point c1 + W1 Q1 n / det(Q) = c2 - W2 Q2 n / det(Q) lies in both if W1 a and W2 b are at most det(Q)
/// (query/ellipsoid/separation.hpp). In the terms above Q is wrong by 40 u, its adjugate by 90 u, det(Q) by 136 u, and
/// n by 95 u |r| + |dc1|. With W1 |L1| = W2 |L2| = 1 / (|L1| + |L2|), W1 a and W2 b are wrong by at most
/// (116 u |r| + |dc1|) / (|L1| + |L2|); kOverlapLaneMargin is 256 u.
HWY_INLINE Mask overlapping(const LaneNodes& e, const Single& s, const LaneTerms& t) {
    const Float w2 = 1 / (t.size * (t.size + s.size)), w1 = t.size * w2;
    const Sym3 q = mixed(s, shape_of(e.factor), w1, w2);
    const Float room = determinant(q, adjugate(q)) - kOverlapLaneMargin;
    const Float most = room - w1 * (kOverlapLaneMargin * one_norm(between(e, s)) + s.slack);
    return (t.a * (w1 * s.weight) <= most) & (t.b * w2 <= most);
}

} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif // PROLATE_QUERY_LANES_INL_HPP
