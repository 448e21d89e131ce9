// Distances of eight pairs of triangles at once, in float: lower bounds that hold, with which a distance query leaves
// out most pairs of two leaves. Compiled once an instruction set.
//
// A bound is the gap along a direction n, over |n|. First the face normals and the way from centroid to centroid; if
// that is not far enough for each pair, the way between the nearest points of all edges, too (Ericson, Real-Time
// Collision Detection, section 5.1.9), one of which is the direction of the distance if no normal is.
//
// Rounding, in the terms of lanes-inl.hpp. The gap is wrong by less than margins.direction |n|_1, and
// |n|_1 <= sqrt(3) |n|: this is taken off before the division. |n| is taken a little too large, by kProductUnderflow,
// and the quotient, wrong by 5 u of itself, is lowered by kQuotientShare, 16 u. n itself may be any floats.
//
// Cost: about 150 operations a vector of pairs for the first bound, 550 for the second.
#if defined(PROLATE_QUERY_TRIANGLE_DISTANCE_LANES_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef PROLATE_QUERY_TRIANGLE_DISTANCE_LANES_INL
#undef PROLATE_QUERY_TRIANGLE_DISTANCE_LANES_INL
#else
#define PROLATE_QUERY_TRIANGLE_DISTANCE_LANES_INL
#endif

#include "query/triangle/lanes-inl.hpp"

#include <limits>

HWY_BEFORE_NAMESPACE();
namespace prolate::query::HWY_NAMESPACE {

inline constexpr float kQuotientShare = 1 - 0x1p-20f;

// Above 0, or 0.
HWY_INLINE Float lower_bound(const TrianglePairLanes& pair, const Float3& n, const LaneMargins& margins) {
    const Float certain = gap(pair.project(n)) - margins.direction * one_norm(n) - kProductUnderflow;
    const Float bound = certain / sqrt(dot(n, n) + kProductUnderflow) * kQuotientShare;
    return choose_or_zero(bound > 0, bound); // zero for a NaN
}

HWY_INLINE Float lower_bound(const TrianglePairLanes& pair, const LaneMargins& margins) {
    const Float3 normal_a = cross(pair.edge_a[0], pair.a2), normal_b = cross(pair.edge_b[0], pair.edge_b[1]);
    const Float3 centroids = (pair.b[0] + pair.b[1] + pair.b[2]) - (pair.a1 + pair.a2);
    return max(lower_bound(pair, normal_a, margins), lower_bound(pair, normal_b, margins),
               lower_bound(pair, centroids, margins));
}

// The way from A to B where their edges are nearest.
HWY_INLINE Float3 between_edges(const TrianglePairLanes& pair) {
    const Float zero = set(0), one = set(1), tiny = set(kProductUnderflow);
    const auto unit = [&](Float x) { return min(max(x, zero), one); };
    const Float3 from_a[3] = {{zero, zero, zero}, pair.a1, pair.a2};
    Float square_a[3], inverse_a[3];
    for (size_t i = 0; i < 3; ++i) {
        square_a[i] = dot(pair.edge_a[i], pair.edge_a[i]);
        inverse_a[i] = one / max(square_a[i], tiny);
    }
    Float3 best{zero, zero, zero};
    Float least_square = set(std::numeric_limits<float>::infinity());
    for (size_t j = 0; j < 3; ++j) {
        const Float3& e = pair.edge_b[j];
        const Float ee = dot(e, e), inverse_b = one / max(ee, tiny);
        for (size_t i = 0; i < 3; ++i) {
            const Float3& d = pair.edge_a[i];
            const Float3 r = from_a[i] - pair.b[j];
            const Float de = dot(d, e), dr = dot(d, r), er = dot(e, r);
            const Float determinant = square_a[i] * ee - de * de;
            const Float free = unit((de * er - dr * ee) / max(determinant, tiny));
            const Float t = unit((de * free + er) * inverse_b), s = unit((de * t - dr) * inverse_a[i]);
            const Float3 way = (pair.b[j] + e * t) - (from_a[i] + d * s);
            const Float square = dot(way, way);
            const Mask nearer = square < least_square;
            best = choose(nearer, way, best), least_square = choose(nearer, square, least_square);
        }
    }
    return best;
}

/// Lower bounds of kLanes pairs, in the lanes' unit. If all of the first `count` are `limit` at once, they are less
/// tight than they could be: for all together, so that it does not depend on the length of vectors.
template <class AtA, class AtB>
HWY_INLINE TriangleBounds bound_all_lanes(AtA&& a_at, AtB&& b_at, const LaneMargins& margins, float limit,
                                          uint32_t count = kLanes) {
    TriangleBounds out;
    uint32_t near = 0;
    for (size_t lane = 0; lane < kLanes; lane += kFloatLanes) {
        const Float lower = lower_bound(TrianglePairLanes(a_at(lane), b_at(lane)), margins);
        near |= bits(lower < limit) << lane;
        store_unaligned(lower, out.lower + lane);
    }
    if ((near & ((1u << count) - 1)) == 0) return out;
    for (size_t lane = 0; lane < kLanes; lane += kFloatLanes) {
        const TrianglePairLanes pair(a_at(lane), b_at(lane));
        const Float lower = lower_bound(pair, between_edges(pair), margins);
        store_unaligned(max(load_unaligned(out.lower + lane), lower), out.lower + lane);
    }
    return out;
}

inline TriangleBounds bound_rows(const TriangleRows& a, const TriangleRows& b, const LaneMargins& margins,
                                 float limit) {
    return bound_all_lanes([&](size_t lane) { return load_triangles(a, lane); },
                           [&](size_t lane) { return load_triangles(b, lane); }, margins, limit);
}

} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
