// Eight pairs of triangles at once, in float: apart, meeting, or not known. Compiled once an instruction set.
//
// Sources: separating axes (Gottschalk, Lin and Manocha 1996); which two products of edges can separate triangles that
// cross each other's planes, and the signs that prove that they meet: Guigue and Devillers, "Fast and robust
// triangle-triangle overlap test using orientation predicates" (2003).
//
// Apart, first step: the two face normals. Second: a triangle that crosses the other's plane has one corner alone on
// its side; with edges c, c' at A's lone corner and g, g' at B's, the segments in which the triangles cross the line
// common to both planes are disjoint only if c x g or c' x g' separates them (g and g' change places if the lone
// corners lie on different sides). Third, for triangles of one plane: the edge normals in both planes. Each is a
// direction n, tested by projecting all six corners: an inexact n, a wrong sign or a wrong choice costs decisions,
// never correctness.
//
// Meeting: all corners lie strictly on their side of the other plane, as above, and neither c x g nor c' x g'
// separates, all by signs of volumes greater than their error.
//
// Rounding. u = 2^-24. Corners are relative to A's first and scaled by a power of two, so that coordinates are at most
// R = 1. They are wrong by e:
//   A's, a difference                        u R
//   B's, from its first corner               u |w|, and |w| <= 2 sqrt(3) R, for both its ends lie in the cube of R
//        turned                              5 u |w| in all, the rounded matrix and 3 products and 2 sums included
//        moved, by a rounded shift           2 u R
//        which was computed in double        80 * 2^-53 S, as in triangle.hpp
//   e <= 20 u R + 80 * 2^-53 S; kPlacementError is 24 u.
//   differences of corners       2 u R each, and n.(...) of one 6 u |n|_1 R more: 8 u |n|_1 R
//   gap, of two such and e       (8 + 8 + 2) u |n|_1 R + 2 e |n|_1 <= (58 u R + 160 * 2^-53 S) |n|_1
// LaneMarginFactors::direction, 64 u, and kSeparationMargin S are demanded, and kUnderflow: numbers below 2^-126 may
// have been lost. As |n| <= |n|_1, what is found apart here is apart by more than 90 * 2^-53 S, as inside.hpp wants it.
// Volumes: L bounds the coordinates of all edges and of B's corners from A's first, as computed.
//   n = c x g                    8 u L^2 a coordinate, |n_k| <= 2 L^2
//   n.x - n.y                    48 u L^3 for n, 12 u L^3 for x and y, 36 u L^3 for the products and sums, 12 u L^3 for
//                                the difference: 108 u L^3; and 60 e L^2 for e (2 e an edge or difference)
// Demanded are 128 u L^3 + 72 e L^2.
//
// Cost: about 130 operations a vector of pairs for the first step, 150 for the second; the rest is rare.
#if defined(PROLATE_QUERY_TRIANGLE_LANES_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef PROLATE_QUERY_TRIANGLE_LANES_INL
#undef PROLATE_QUERY_TRIANGLE_LANES_INL
#else
#define PROLATE_QUERY_TRIANGLE_LANES_INL
#endif

#include "query/triangle/leaves.hpp"

#include <hwy/highway.h>

#include <algorithm>
#include <bit>
#include <cmath>

HWY_BEFORE_NAMESPACE();
namespace prolate::query::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using LaneTag = HWY_CAPPED(float, kLanes);
using Lane = hn::Vec<LaneTag>;
using LaneMask = hn::Mask<LaneTag>;

inline constexpr float kUnderflow = 0x1p-110f;

struct Lane3 {
    Lane x, y, z;
};
HWY_INLINE Lane3 operator-(const Lane3& a, const Lane3& b) {
    return {hn::Sub(a.x, b.x), hn::Sub(a.y, b.y), hn::Sub(a.z, b.z)};
}
HWY_INLINE Lane dot(const Lane3& a, const Lane3& b) {
    return hn::Add(hn::Add(hn::Mul(a.x, b.x), hn::Mul(a.y, b.y)), hn::Mul(a.z, b.z));
}
HWY_INLINE Lane3 cross(const Lane3& a, const Lane3& b) {
    return {hn::Sub(hn::Mul(a.y, b.z), hn::Mul(a.z, b.y)), hn::Sub(hn::Mul(a.z, b.x), hn::Mul(a.x, b.z)),
            hn::Sub(hn::Mul(a.x, b.y), hn::Mul(a.y, b.x))};
}
HWY_INLINE Lane one_norm(const Lane3& a) {
    return hn::Add(hn::Add(hn::Abs(a.x), hn::Abs(a.y)), hn::Abs(a.z));
}
HWY_INLINE Lane max_norm(const Lane3& a) {
    return hn::Max(hn::Max(hn::Abs(a.x), hn::Abs(a.y)), hn::Abs(a.z));
}
HWY_INLINE Lane choose(LaneMask mask, Lane yes, Lane no) {
    return hn::IfThenElse(mask, yes, no);
}
HWY_INLINE Lane3 choose(LaneMask mask, const Lane3& yes, const Lane3& no) {
    return {choose(mask, yes.x, no.x), choose(mask, yes.y, no.y), choose(mask, yes.z, no.z)};
}
HWY_INLINE Lane least(Lane a, Lane b, Lane c) {
    return hn::Min(hn::Min(a, b), c);
}
HWY_INLINE Lane most(Lane a, Lane b, Lane c) {
    return hn::Max(hn::Max(a, b), c);
}

// Corners of Lanes(LaneTag) triangles.
struct LaneTriangle {
    Lane3 corner[3];
};
HWY_INLINE LaneTriangle load(const TriangleRows& rows, size_t lane) {
    const LaneTag tag;
    const auto at = [&](size_t row) { return hn::LoadU(tag, rows.row[row] + lane); };
    return {{{at(0), at(1), at(2)}, {at(3), at(4), at(5)}, {at(6), at(7), at(8)}}};
}

// n.x of all corners x, from A's first.
struct Projection {
    Lane a1, a2, b[3];
};

// Corners, from A's first, and edges from corner i to i + 1.
struct LanePair {
    Lane3 a1, a2, b[3];
    Lane3 edge_a[3], edge_b[3];

    HWY_INLINE LanePair(const LaneTriangle& a, const LaneTriangle& b_)
        : a1(a.corner[1] - a.corner[0]),
          a2(a.corner[2] - a.corner[0]), b{b_.corner[0] - a.corner[0], b_.corner[1] - a.corner[0],
                                           b_.corner[2] - a.corner[0]},
          edge_a{a1, a.corner[2] - a.corner[1], a.corner[0] - a.corner[2]}, edge_b{b_.corner[1] - b_.corner[0],
                                                                                   b_.corner[2] - b_.corner[1],
                                                                                   b_.corner[0] - b_.corner[2]} {}

    HWY_INLINE Projection project(const Lane3& n) const {
        return {dot(n, a1), dot(n, a2), {dot(n, b[0]), dot(n, b[1]), dot(n, b[2])}};
    }
};
// |n| times the gap between the triangles along n or -n.
HWY_INLINE Lane gap(const Projection& p) {
    const Lane zero = hn::Zero(LaneTag());
    return hn::Max(hn::Sub(least(p.b[0], p.b[1], p.b[2]), most(zero, p.a1, p.a2)),
                   hn::Sub(least(zero, p.a1, p.a2), most(p.b[0], p.b[1], p.b[2])));
}
HWY_INLINE LaneMask separates(const Lane3& n, const Projection& p, const LaneMargins& margins) {
    const LaneTag tag;
    Lane bound = hn::Add(hn::Mul(hn::Set(tag, margins.direction), one_norm(n)), hn::Set(tag, kUnderflow));
    if (margins.distance > 0) {
        const Lane length = hn::Sqrt(hn::Add(dot(n, n), hn::Set(tag, kUnderflow)));
        bound = hn::Add(bound, hn::Mul(hn::Set(tag, margins.distance), length));
    }
    return hn::Gt(gap(p), bound);
}

// The corner that lies alone on its side of a plane, by the heights of the three; any if they do not.
struct Lone {
    LaneMask first, second; // else the third

    HWY_INLINE explicit Lone(const Lane (&height)[3])
        : Lone(hn::Lt(height[0], hn::Zero(LaneTag())), hn::Lt(height[1], hn::Zero(LaneTag())),
               hn::Lt(height[2], hn::Zero(LaneTag()))) {}
    HWY_INLINE Lone(LaneMask below_0, LaneMask below_1, LaneMask below_2)
        : first(hn::Not(hn::Xor(below_1, below_2))), second(hn::Not(hn::Xor(below_0, below_2))) {}

    template <class T> HWY_INLINE T of(const T& x, const T& y, const T& z) const {
        return choose(first, x, choose(second, y, z));
    }
};

// Bits of the lanes that are set.
HWY_INLINE uint32_t bits(LaneMask mask) {
    uint8_t out[8] = {};
    hn::StoreMaskBits(LaneTag(), mask, out);
    return out[0];
}

// Lanes(LaneTag) pairs.
HWY_INLINE LaneVerdicts test_vector(const LaneTriangle& a, const LaneTriangle& b, const LaneMargins& margins,
                                    const LaneMarginFactors& factors) {
    const LaneTag tag;
    const LanePair pair(a, b);
    const auto done = [&](LaneMask mask) { return hn::AllTrue(tag, mask); };

    // Face normals, and the corners' heights over the other's plane.
    const Lane3 normal_a = cross(pair.edge_a[0], pair.a2);
    const Lane3 normal_b = cross(pair.edge_b[0], pair.edge_b[1]);
    const Projection on_b = pair.project(normal_b), on_a = pair.project(normal_a);
    LaneMask apart = hn::Or(separates(normal_b, on_b, margins), separates(normal_a, on_a, margins));
    if (done(apart)) return {bits(apart), 0};

    // The two products of edges at the lone corners.
    const Lane zero = hn::Zero(tag);
    const Lane height_a[3] = {hn::Sub(zero, on_b.b[0]), hn::Sub(on_b.a1, on_b.b[0]), hn::Sub(on_b.a2, on_b.b[0])};
    const Lane height_b[3] = {on_a.b[0], on_a.b[1], on_a.b[2]};
    const Lone lone_a(height_a), lone_b(height_b);
    const Lane side_a = lone_a.of(height_a[0], height_a[1], height_a[2]);
    const Lane side_b = lone_b.of(height_b[0], height_b[1], height_b[2]);
    const LaneMask swap = hn::Xor(hn::Lt(side_a, zero), hn::Lt(side_b, zero));
    const auto& edge_a = pair.edge_a;
    const auto& edge_b = pair.edge_b;
    const Lane3 out_b = lone_b.of(edge_b[0], edge_b[1], edge_b[2]), in_b = lone_b.of(edge_b[2], edge_b[0], edge_b[1]);
    const Lane3 product[2] = {cross(lone_a.of(edge_a[0], edge_a[1], edge_a[2]), choose(swap, in_b, out_b)),
                              cross(lone_a.of(edge_a[2], edge_a[0], edge_a[1]), choose(swap, out_b, in_b))};
    const Projection on_product[2] = {pair.project(product[0]), pair.project(product[1])};
    for (size_t i = 0; i < 2; ++i) apart = hn::Or(apart, separates(product[i], on_product[i], margins));
    if (done(apart)) return {bits(apart), 0};

    // Signs of volumes that are certain.
    Lane size = hn::Max(max_norm(pair.a2), most(max_norm(pair.b[0]), max_norm(pair.b[1]), max_norm(pair.b[2])));
    for (size_t i = 0; i < 3; ++i) size = most(size, max_norm(edge_a[i]), max_norm(edge_b[i]));
    const Lane error = hn::Add(hn::Mul(hn::Mul(size, size), hn::Add(hn::Mul(hn::Set(tag, factors.volume), size),
                                                                    hn::Set(tag, 72 * margins.corner_error))),
                               hn::Set(tag, kUnderflow));
    const auto crosses = [&](const Lane(&height)[3]) { // all are certain, and not all of one sign
        const Lane nearest = least(hn::Abs(height[0]), hn::Abs(height[1]), hn::Abs(height[2]));
        return hn::And(
            hn::Gt(nearest, error),
            hn::Lt(hn::Mul(least(height[0], height[1], height[2]), most(height[0], height[1], height[2])), zero));
    };
    const auto volume = [&](const Projection& p) { // the product times the way from A's lone corner to B's
        return hn::Sub(lone_b.of(p.b[0], p.b[1], p.b[2]), lone_a.of(zero, p.a1, p.a2));
    };
    const LaneMask below = hn::Lt(side_a, zero);
    const Lane first = volume(on_product[0]), second = volume(on_product[1]);
    LaneMask meet = hn::And(crosses(height_a), crosses(height_b));
    meet = hn::And(meet, hn::Gt(choose(below, hn::Neg(first), first), error));
    meet = hn::And(meet, hn::Gt(choose(below, second, hn::Neg(second)), error));
    if (done(hn::Or(apart, meet))) return {bits(apart), bits(meet)};

    // Edge normals in the planes.
    for (size_t i = 0; i < 3; ++i) {
        const Lane3 n = cross(edge_a[i], normal_a), m = cross(edge_b[i], normal_b);
        apart = hn::Or(apart, hn::Or(separates(n, pair.project(n), margins), separates(m, pair.project(m), margins)));
    }
    return {bits(apart), bits(meet)};
}

/// kLanes pairs; a_at(lane) and b_at(lane) are the triangles from that lane on.
template <class AtA, class AtB>
HWY_INLINE LaneVerdicts test_all_lanes(AtA&& a_at, AtB&& b_at, const LaneMargins& margins,
                                       const LaneMarginFactors& factors) {
    LaneVerdicts out{0, 0};
    for (size_t lane = 0; lane < kLanes; lane += hn::Lanes(LaneTag())) {
        const LaneVerdicts part = test_vector(a_at(lane), b_at(lane), margins, factors);
        out.apart |= part.apart << lane, out.meet |= part.meet << lane;
    }
    return out;
}

inline LaneVerdicts test_rows(const TriangleRows& a, const TriangleRows& b, const LaneMargins& margins,
                              const LaneMarginFactors& factors) {
    return test_all_lanes([&](size_t lane) { return load(a, lane); }, [&](size_t lane) { return load(b, lane); },
                          margins, factors);
}

} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
