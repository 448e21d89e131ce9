// Pairs of ellipsoids in lanes: what the kernels of collide() and distance() for batches share. Compiled once for each
// instruction set; include it after <hwy/foreach_target.h>, which asks for this kind of guard.
//
// Only operations that IEEE 754 rounds exactly are used, each in a written order and none across lanes: every
// instruction set and every number of lanes gives the same bits, and Highway's scalar target, one lane at a time, is
// the reference that the others are tested against.
#if defined(PROLATE_QUERY_PAIR_LANES_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef PROLATE_QUERY_PAIR_LANES_INL
#undef PROLATE_QUERY_PAIR_LANES_INL
#else
#define PROLATE_QUERY_PAIR_LANES_INL
#endif

#include <prolate/pairs.hpp>

#include <hwy/highway.h>

#include <cstddef>
#include <cstdint>

HWY_BEFORE_NAMESPACE();
namespace prolate::query::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using Lanes = HWY_CAPPED(float, 8);
using F = hn::Vec<Lanes>;
using Mask = hn::Mask<Lanes>;

HWY_INLINE size_t width() {
    return hn::Lanes(Lanes());
}
HWY_INLINE F set(float x) {
    return hn::Set(Lanes(), x);
}

constexpr float kV = 0x1p-24f;         // v of the error analyses
constexpr float kUnderflow = 0x1p-60f; // by which two lengths may be too small because squares underflow

HWY_INLINE F choose(Mask mask, F yes, F no) {
    return hn::IfThenElse(mask, yes, no);
}
// A bit a lane.
HWY_INLINE uint32_t bits(Mask mask) {
    uint8_t out[8] = {};
    hn::StoreMaskBits(Lanes(), mask, out);
    return out[0];
}

struct Vector {
    F x, y, z;
};
HWY_INLINE F dot(const Vector& a, const Vector& b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}
HWY_INLINE Vector operator*(const Vector& v, F s) {
    return {v.x * s, v.y * s, v.z * s};
}

struct Symmetric {
    F xx, xy, yy, xz, yz, zz;
};
HWY_INLINE F trace(const Symmetric& q) {
    return q.xx + q.yy + q.zz;
}
HWY_INLINE Symmetric adjugate(const Symmetric& q) {
    return {q.yy * q.zz - q.yz * q.yz, q.xz * q.yz - q.xy * q.zz, q.xx * q.zz - q.xz * q.xz,
            q.xy * q.yz - q.xz * q.yy, q.xy * q.xz - q.xx * q.yz, q.xx * q.yy - q.xy * q.xy};
}
HWY_INLINE Vector operator*(const Symmetric& q, const Vector& v) {
    return {q.xx * v.x + q.xy * v.y + q.xz * v.z, q.xy * v.x + q.yy * v.y + q.yz * v.z,
            q.xz * v.x + q.yz * v.y + q.zz * v.z};
}

struct Body {
    Vector center;
    F slack, l11, l21, l22, l31, l32, l33, thinness, size;

    HWY_INLINE Symmetric shape() const {
        return {l11 * l11,
                l21 * l11,
                l21 * l21 + l22 * l22,
                l31 * l11,
                l31 * l21 + l32 * l22,
                l31 * l31 + l32 * l32 + l33 * l33};
    }
    HWY_INLINE Vector transposed_times(const Vector& n) const { // L^T n
        return {l11 * n.x + l21 * n.y + l31 * n.z, l22 * n.y + l32 * n.z, l33 * n.z};
    }
    HWY_INLINE Vector times(const Vector& w) const { // L w
        return {l11 * w.x, l21 * w.x + l22 * w.y, l31 * w.x + l32 * w.y + l33 * w.z};
    }
};

// One body a lane: lane i is bodies[index(i)].
template <class Index> HWY_INLINE Body load(const WorldEllipsoid* bodies, Index&& index) {
    static_assert(sizeof(WorldEllipsoid) == 64, "a cache line");
    const auto row = [&](size_t lane) HWY_ATTR { return bodies[index(lane)].center; };
    F column[12];
#if HWY_TARGET == HWY_SCALAR
    for (size_t i = 0; i < 12; ++i) column[i] = set(row(0)[i]);
#else
    // Four floats at a time of lanes j and, if there are eight, j + 4; then blocks of four by four are transposed.
    const hn::Full128<float> d4;
    const Lanes d;
    const hn::Repartition<double, Lanes> pairs;
    F part[3][4];
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
    return {{column[0], column[1], column[2]},
            column[3],
            column[4],
            column[5],
            column[6],
            column[7],
            column[8],
            column[9],
            column[10],
            column[11]};
}

// Eight or fewer pairs.
struct Pairs {
    Body a, b;
    Vector r; // from A's center to B's
    Symmetric q1, q2;
    F slack; // of both bodies

    // As many as there are lanes.
    HWY_INLINE Pairs(const WorldEllipsoid* bodies, const IndexPair* pairs)
        : a(load(bodies, [=](size_t lane) { return pairs[lane].a; })),
          b(load(bodies, [=](size_t lane) { return pairs[lane].b; })), r{b.center.x - a.center.x,
                                                                         b.center.y - a.center.y,
                                                                         b.center.z - a.center.z},
          q1(a.shape()), q2(b.shape()), slack(a.slack + b.slack) {}

    HWY_INLINE F distance() const { // of the centers, at least: |rx| + |ry| + |rz|
        return hn::Abs(r.x) + hn::Abs(r.y) + hn::Abs(r.z);
    }
    // mu Q1 + lambda Q2
    HWY_INLINE Symmetric combine(F mu, F lambda) const {
        return {mu * q1.xx + lambda * q2.xx, mu * q1.xy + lambda * q2.xy, mu * q1.yy + lambda * q2.yy,
                mu * q1.xz + lambda * q2.xz, mu * q1.yz + lambda * q2.yz, mu * q1.zz + lambda * q2.zz};
    }
};

// The point c1 + L1 w / det of A, |w| <= det, has in the exact B a radial coordinate of at most what this returns: at
// most 1 means a common point. It does not matter what det is wrong by.
//
// With y = L2^-1 (r - L1 w / det): the exact A has a point at a distance of at most its center's error + 1.1 v |L1|;
// r det, L1 w and their difference add 2 v |r| + 3 v |L1| + v |L2|; substitution in a triangular system is exact for a
// factor wrong by 4 v |L2|, the exact B's differs by 1.1 v |L2|, both times |y| <= 1. All this is less than
// slacks + 2 v |r|, and moves |y| by at most `thinness` times that. Factors common to all of y, and its length, round
// by less than 16 v.
HWY_INLINE F radial_in_b(const Pairs& p, const Vector& w, F det) {
    const Vector at = p.a.times(w);
    const F x = p.r.x * det - at.x, y = p.r.y * det - at.y, z = p.r.z * det - at.z;
    const F t2 = y * p.b.l11 - p.b.l21 * x; // substitution with one common denominator
    const F t3 = (z * p.b.l11 - p.b.l31 * x) * p.b.l22 - p.b.l32 * t2;
    const F denominator = p.b.l11 * p.b.l22 * p.b.l33 * det;
    const F inverse = set(1) / denominator;
    const Vector solution = Vector{x * (p.b.l22 * p.b.l33), t2 * p.b.l33, t3} * inverse;
    const F radial =
        hn::Sqrt(dot(solution, solution)) * set(1 + 16 * kV) + p.b.thinness * (p.slack + set(2 * kV) * p.distance());
    // Above the first, what underflows is less than v of the denominator; an infinite one would make nothing of y.
    const Mask in_range = hn::And(hn::Gt(denominator, set(0x1p-90f)), hn::Lt(denominator, set(0x1p120f)));
    return choose(in_range, radial, set(2));
}

} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
