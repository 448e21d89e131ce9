// Pairs of ellipsoids in lanes: what the kernels of collide() and distance() for batches share. Compiled once for each
// instruction set; include it below <hwy/foreach_target.h>. Highway's scalar target, one lane at a time, is the
// reference that the others are tested against.
#include "query/simd/vector-inl.hpp"

#include <prolate/pairs.hpp>

#include <cstddef>
#include <cstdint>

// clang-format off
#if defined(PROLATE_QUERY_PAIR_LANES_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef PROLATE_QUERY_PAIR_LANES_INL_HPP
#undef PROLATE_QUERY_PAIR_LANES_INL_HPP
#else
#define PROLATE_QUERY_PAIR_LANES_INL_HPP
#endif
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace prolate::query::HWY_NAMESPACE {

constexpr float kV = 0x1p-24f;               // v of the error analyses
constexpr float kLengthUnderflow = 0x1p-60f; // by which two lengths may be too small because squares underflow

// The bodies of pairs, one a lane, as WorldEllipsoid has them.
struct BodyLanes {
    Float3 center;
    Float slack;
    Lower3 factor;
    Float thinness, size;
};

// One body a lane: lane i is bodies[index(i)].
template <class Index> HWY_INLINE BodyLanes load_bodies(const WorldEllipsoid* bodies, Index&& index) {
    static_assert(sizeof(WorldEllipsoid) == 64, "a cache line");
    const auto row = [&](size_t lane) HWY_ATTR { return bodies[index(lane)].center; };
    Float column[12];
#if HWY_TARGET == HWY_SCALAR
    for (size_t i = 0; i < 12; ++i) column[i] = set(row(0)[i]);
#else
    // Four floats at a time of lanes j and, if there are eight, j + 4; then blocks of four by four are transposed.
    const hn::Full128<float> d4;
    const FloatTag d;
    const hn::Repartition<double, FloatTag> pairs;
    Float part[3][4];
    for (size_t j = 0; j < 4; ++j) {
        const float* const low = row(j);
#if HWY_TARGET == HWY_AVX2 || HWY_TARGET == HWY_AVX3
        const float* const high = row(j + 4);
        for (size_t i = 0; i < 3; ++i)
            part[i][j] = hn::Combine(d, hn::Load(d4, high + 4 * i), hn::Load(d4, low + 4 * i));
#else
        for (size_t i = 0; i < 3; ++i) part[i][j] = hn::Load(d4, low + 4 * i);
#endif
    }
    for (size_t i = 0; i < 3; ++i) {
        const auto low01 = hn::BitCast(pairs, hn::InterleaveLower(d, part[i][0], part[i][1]));
        const auto high01 = hn::BitCast(pairs, hn::InterleaveUpper(d, part[i][0], part[i][1]));
        const auto low23 = hn::BitCast(pairs, hn::InterleaveLower(d, part[i][2], part[i][3]));
        const auto high23 = hn::BitCast(pairs, hn::InterleaveUpper(d, part[i][2], part[i][3]));
        column[4 * i] = hn::BitCast(d, hn::InterleaveLower(pairs, low01, low23));
        column[4 * i + 1] = hn::BitCast(d, hn::InterleaveUpper(pairs, low01, low23));
        column[4 * i + 2] = hn::BitCast(d, hn::InterleaveLower(pairs, high01, high23));
        column[4 * i + 3] = hn::BitCast(d, hn::InterleaveUpper(pairs, high01, high23));
    }
#endif
    return {.center = {column[0], column[1], column[2]},
            .slack = column[3],
            .factor = {column[4], column[5], column[6], column[7], column[8], column[9]},
            .thinness = column[10],
            .size = column[11]};
}

// A pair a lane.
struct PairLanes {
    BodyLanes a, b;
    Float3 r; // from A's center to B's
    Sym3 q1, q2;
    Float slack; // of both bodies

    // As many as there are lanes.
    HWY_INLINE PairLanes(const WorldEllipsoid* bodies, const IndexPair* pairs)
        : a(load_bodies(bodies, [=](size_t lane) { return pairs[lane].a; })),
          b(load_bodies(bodies, [=](size_t lane) { return pairs[lane].b; })), r(b.center - a.center),
          q1(shape_of(a.factor)), q2(shape_of(b.factor)), slack(a.slack + b.slack) {}

    HWY_INLINE Float distance() const { return one_norm(r); } // of the centers, at least
    HWY_INLINE Sym3 combine(Float mu, Float lambda) const { return mu * q1 + lambda * q2; }
};

// The point c1 + L1 w / det of A, |w| <= det, has in the exact B a radial coordinate of at most what this returns: at
// most 1 means a common point. It does not matter what det is wrong by.
//
// With y = L2^-1 (r - L1 w / det): the exact A has a point at a distance of at most its center's error + 1.1 v |L1|;
// r det, L1 w and their difference add 2 v |r| + 3 v |L1| + v |L2|; substitution in a triangular system is exact for a
// factor wrong by 4 v |L2|, the exact B's differs by 1.1 v |L2|, both times |y| <= 1. All this is less than
// slacks + 2 v |r|, and moves |y| by at most `thinness` times that. Factors common to all of y, and its length, round
// by less than 16 v.
HWY_INLINE Float radial_in_b(const PairLanes& p, const Float3& w, Float det) {
    const Lower3& l2 = p.b.factor;
    const Float3 d = p.r * det - p.a.factor * w;
    const Float t2 = d.y * l2.l11 - l2.l21 * d.x; // substitution with one common denominator
    const Float t3 = (d.z * l2.l11 - l2.l31 * d.x) * l2.l22 - l2.l32 * t2;
    const Float denominator = l2.l11 * l2.l22 * l2.l33 * det;
    const Float3 y = Float3{d.x * (l2.l22 * l2.l33), t2 * l2.l33, t3} * (1 / denominator);
    const Float radial = length(y) * (1 + 16 * kV) + p.b.thinness * (p.slack + 2 * kV * p.distance());
    // Above the first, what underflows is less than v of the denominator; an infinite one would make nothing of y.
    const Mask in_range = (denominator > 0x1p-90f) & (denominator < 0x1p120f);
    return choose(in_range, radial, set(2));
}

} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif // PROLATE_QUERY_PAIR_LANES_INL_HPP
