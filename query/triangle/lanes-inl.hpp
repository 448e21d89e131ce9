// Eight pairs of triangles at once, in float: separated, meeting, or not known. Compiled once an instruction set.
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
//   A's, a difference, and times a scale     2 u R
//   B's, from its first corner               u |w|, and |w| <= 2 sqrt(3) R, for both its ends lie in the cube of R
//        turned, and scaled with the matrix  5 u |w| in all, the rounded matrix and 3 products and 2 sums included
//        moved, by a rounded shift           2 u R
//        which was computed in double        80 * 2^-53 S, as in separation.hpp
//   e <= 20 u R + 80 * 2^-53 S; kPlacementError is 24 u.
//   differences of corners       2 u R each, and n.(...) of one 6 u |n|_1 R more: 8 u |n|_1 R
//   gap, of two such and e       (8 + 8 + 2) u |n|_1 R + 2 e |n|_1 <= (58 u R + 160 * 2^-53 S) |n|_1
// LaneMarginFactors::direction, 64 u, and kSeparationMargin S are demanded, and kProductUnderflow: numbers below 2^-126
// may have been lost. As |n| <= |n|_1, what is found separated here is so by more than 90 * 2^-53 S, as
// query/inside/inside.hpp wants it. Volumes: L bounds the coordinates of all edges and of B's corners from A's first,
// as computed.
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

#include "query/simd/vector-inl.hpp"
#include "query/triangle/lanes.hpp"

HWY_BEFORE_NAMESPACE();
namespace prolate::query::HWY_NAMESPACE {

inline constexpr float kProductUnderflow = 0x1p-110f;

HWY_INLINE Float min(Float a, Float b, Float c) {
    return min(min(a, b), c);
}
HWY_INLINE Float max(Float a, Float b, Float c) {
    return max(max(a, b), c);
}

// One triangle a lane.
struct TriangleLanes {
    Float3 corner[3];
};
HWY_INLINE TriangleLanes load_triangles(const TriangleRows& rows, size_t lane) {
    const auto corner = [&](size_t i) {
        const auto row = [&](size_t k) { return load_unaligned(rows.row[3 * i + k] + lane); };
        return Float3{row(0), row(1), row(2)};
    };
    return {{corner(0), corner(1), corner(2)}};
}

// n.x of all corners x, from A's first.
struct Projection {
    Float a1, a2, b[3];
};

// Corners, from A's first, and edges from corner i to i + 1.
struct TrianglePairLanes {
    Float3 a1, a2, b[3];
    Float3 edge_a[3], edge_b[3];

    HWY_INLINE TrianglePairLanes(const TriangleLanes& a, const TriangleLanes& b_)
        : a1(a.corner[1] - a.corner[0]),
          a2(a.corner[2] - a.corner[0]), b{b_.corner[0] - a.corner[0], b_.corner[1] - a.corner[0],
                                           b_.corner[2] - a.corner[0]},
          edge_a{a1, a.corner[2] - a.corner[1], a.corner[0] - a.corner[2]}, edge_b{b_.corner[1] - b_.corner[0],
                                                                                   b_.corner[2] - b_.corner[1],
                                                                                   b_.corner[0] - b_.corner[2]} {}

    HWY_INLINE Projection project(const Float3& n) const {
        return {dot(n, a1), dot(n, a2), {dot(n, b[0]), dot(n, b[1]), dot(n, b[2])}};
    }
};
// |n| times the gap between the triangles along n or -n.
HWY_INLINE Float gap(const Projection& p) {
    const Float zero = set(0);
    return max(min(p.b[0], p.b[1], p.b[2]) - max(zero, p.a1, p.a2),
               min(zero, p.a1, p.a2) - max(p.b[0], p.b[1], p.b[2]));
}
HWY_INLINE Mask separates(const Float3& n, const Projection& p, const LaneMargins& margins) {
    Float bound = margins.direction * one_norm(n) + kProductUnderflow;
    if (margins.distance > 0) bound = bound + margins.distance * sqrt(dot(n, n) + kProductUnderflow);
    return gap(p) > bound;
}

// The corner that lies alone on its side of a plane, by the heights of the three; any if they do not.
struct Lone {
    Mask first, second; // else the third

    HWY_INLINE explicit Lone(const Float (&height)[3]) : Lone(height[0] < 0, height[1] < 0, height[2] < 0) {}
    HWY_INLINE Lone(Mask below_0, Mask below_1, Mask below_2)
        : first(!(below_1 ^ below_2)), second(!(below_0 ^ below_2)) {}

    template <class T> HWY_INLINE T of(const T& x, const T& y, const T& z) const {
        return choose(first, x, choose(second, y, z));
    }
};

// How the two triangles lie to each other's planes, and the products of edges at the lone corners.
struct LoneCorners {
    Float height_a[3], height_b[3]; // of the corners over the other's plane
    Lone lone_a, lone_b;
    Mask below_a;       // A's lone corner lies below B's plane
    Mask swap;          // the lone corners lie on different sides
    Float3 out_b, in_b; // edges of B from and to its lone corner
    Float3 product[2];
    Projection on_product[2];

    HWY_INLINE LoneCorners(const TrianglePairLanes& pair, const Projection& on_b, const Projection& on_a)
        : height_a{0 - on_b.b[0], on_b.a1 - on_b.b[0], on_b.a2 - on_b.b[0]}, height_b{on_a.b[0], on_a.b[1], on_a.b[2]},
          lone_a(height_a), lone_b(height_b), below_a(lone_a.of(height_a[0], height_a[1], height_a[2]) < 0),
          swap(below_a ^ (lone_b.of(height_b[0], height_b[1], height_b[2]) < 0)),
          out_b(lone_b.of(pair.edge_b[0], pair.edge_b[1], pair.edge_b[2])),
          in_b(lone_b.of(pair.edge_b[2], pair.edge_b[0], pair.edge_b[1])),
          product{cross(lone_a.of(pair.edge_a[0], pair.edge_a[1], pair.edge_a[2]), choose(swap, in_b, out_b)),
                  cross(lone_a.of(pair.edge_a[2], pair.edge_a[0], pair.edge_a[1]), choose(swap, out_b, in_b))},
          on_product{pair.project(product[0]), pair.project(product[1])} {}

    HWY_INLINE Mask separate(const LaneMargins& margins) const {
        return separates(product[0], on_product[0], margins) | separates(product[1], on_product[1], margins);
    }
    // By signs of volumes that are certain.
    HWY_INLINE Mask meet(const TrianglePairLanes& pair, const LaneMargins& margins,
                         const LaneMarginFactors& factors) const {
        Float size = max(max_norm(pair.a2), max(max_norm(pair.b[0]), max_norm(pair.b[1]), max_norm(pair.b[2])));
        for (size_t i = 0; i < 3; ++i) size = max(size, max_norm(pair.edge_a[i]), max_norm(pair.edge_b[i]));
        const Float error = size * size * (factors.volume * size + 72 * margins.corner_error) + kProductUnderflow;
        const auto crosses = [&](const Float(&height)[3]) { // all are certain, and not all of one sign
            const Float nearest = min(abs(height[0]), abs(height[1]), abs(height[2]));
            return (nearest > error) &
                   (min(height[0], height[1], height[2]) * max(height[0], height[1], height[2]) < 0);
        };
        const auto volume = [&](const Projection& p) { // the product times the way from A's lone corner to B's
            return lone_b.of(p.b[0], p.b[1], p.b[2]) - lone_a.of(set(0), p.a1, p.a2);
        };
        const Float first = volume(on_product[0]), second = volume(on_product[1]);
        return crosses(height_a) & crosses(height_b) & (choose(below_a, -first, first) > error) &
               (choose(below_a, second, -second) > error);
    }
};

// A pair a lane.
HWY_INLINE LaneVerdicts test_vector(const TriangleLanes& a, const TriangleLanes& b, const LaneMargins& margins,
                                    const LaneMarginFactors& factors) {
    const TrianglePairLanes pair(a, b);
    const Float3 normal_a = cross(pair.edge_a[0], pair.a2), normal_b = cross(pair.edge_b[0], pair.edge_b[1]);
    const Projection on_b = pair.project(normal_b), on_a = pair.project(normal_a);
    Mask apart = separates(normal_b, on_b, margins) | separates(normal_a, on_a, margins);
    if (all(apart)) return {bits(apart), 0};

    const LoneCorners lone(pair, on_b, on_a);
    apart = apart | lone.separate(margins);
    if (all(apart)) return {bits(apart), 0};
    const Mask meet = lone.meet(pair, margins, factors);
    if (all(apart | meet)) return {bits(apart), bits(meet)};

    // Edge normals in the planes.
    for (size_t i = 0; i < 3; ++i) {
        const Float3 n = cross(pair.edge_a[i], normal_a), m = cross(pair.edge_b[i], normal_b);
        apart = apart | separates(n, pair.project(n), margins) | separates(m, pair.project(m), margins);
    }
    return {bits(apart), bits(meet)};
}

/// kLanes pairs; a_at(lane) and b_at(lane) are the triangles from that lane on.
template <class AtA, class AtB>
HWY_INLINE LaneVerdicts test_all_lanes(AtA&& a_at, AtB&& b_at, const LaneMargins& margins,
                                       const LaneMarginFactors& factors) {
    LaneVerdicts out{0, 0};
    for (size_t lane = 0; lane < kLanes; lane += kFloatLanes) {
        const LaneVerdicts part = test_vector(a_at(lane), b_at(lane), margins, factors);
        out.apart |= part.apart << lane, out.meet |= part.meet << lane;
    }
    return out;
}

inline LaneVerdicts test_rows(const TriangleRows& a, const TriangleRows& b, const LaneMargins& margins,
                              const LaneMarginFactors& factors) {
    return test_all_lanes([&](size_t lane) { return load_triangles(a, lane); },
                          [&](size_t lane) { return load_triangles(b, lane); }, margins, factors);
}

} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
