// Distances of eight pairs of triangles at once, in float: lower bounds that hold, with which a distance query leaves
// out most pairs of two leaves. Compiled once an instruction set.
//
// A bound is the gap along a direction n, over |n|. First the face normals and the way from centroid to centroid; if
// that is not far enough for each pair, the way between the nearest points of all edges, too (Ericson, Real-Time
// Collision Detection, section 5.1.9), one of which is the direction of the distance if no normal is.
//
// Rounding, in the terms of triangle_lanes-inl.hpp. The gap is wrong by less than margins.direction |n|_1, and
// |n|_1 <= sqrt(3) |n|: this is taken off before the division. |n| is taken a little too large, by kUnderflow, and the
// quotient, wrong by 5 u of itself, is lowered by kShare, 16 u. n itself may be any floats.
//
// Cost: about 150 operations a vector of pairs for the first bound, 550 for the second.
#if defined(PROLATE_QUERY_TRIANGLE_DISTANCE_LANES_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef PROLATE_QUERY_TRIANGLE_DISTANCE_LANES_INL
#undef PROLATE_QUERY_TRIANGLE_DISTANCE_LANES_INL
#else
#define PROLATE_QUERY_TRIANGLE_DISTANCE_LANES_INL
#endif

#include "query/triangle/leaves-inl.hpp"

#include <limits>

HWY_BEFORE_NAMESPACE();
namespace prolate::query::HWY_NAMESPACE {

inline constexpr float kShare = 1 - 0x1p-20f;

HWY_INLINE Lane3 operator+(const Lane3& a, const Lane3& b) {
    return {hn::Add(a.x, b.x), hn::Add(a.y, b.y), hn::Add(a.z, b.z)};
}
HWY_INLINE Lane3 operator*(const Lane3& a, Lane s) {
    return {hn::Mul(a.x, s), hn::Mul(a.y, s), hn::Mul(a.z, s)};
}

// Above 0, or 0.
HWY_INLINE Lane lower_bound(const LanePair& pair, const Lane3& n, const LaneMargins& margins) {
    const LaneTag tag;
    const Lane certain = hn::Sub(hn::Sub(gap(pair.project(n)), hn::Mul(hn::Set(tag, margins.direction), one_norm(n))),
                                 hn::Set(tag, kUnderflow));
    const Lane length = hn::Sqrt(hn::Add(dot(n, n), hn::Set(tag, kUnderflow)));
    const Lane bound = hn::Mul(hn::Div(certain, length), hn::Set(tag, kShare));
    return hn::IfThenElseZero(hn::Gt(bound, hn::Zero(tag)), bound); // zero for a NaN
}

HWY_INLINE Lane lower_bound(const LanePair& pair, const LaneMargins& margins) {
    const Lane3 normal_a = cross(pair.edge_a[0], pair.a2), normal_b = cross(pair.edge_b[0], pair.edge_b[1]);
    const Lane3 centroids = (pair.b[0] + pair.b[1] + pair.b[2]) - (pair.a1 + pair.a2);
    return most(lower_bound(pair, normal_a, margins), lower_bound(pair, normal_b, margins),
                lower_bound(pair, centroids, margins));
}

// The way from A to B where their edges are nearest.
HWY_INLINE Lane3 between_edges(const LanePair& pair) {
    const LaneTag tag;
    const Lane zero = hn::Zero(tag), one = hn::Set(tag, 1), tiny = hn::Set(tag, kUnderflow);
    const auto unit = [&](Lane x) { return hn::Min(hn::Max(x, zero), one); };
    const Lane3 from_a[3] = {{zero, zero, zero}, pair.a1, pair.a2};
    Lane square_a[3], inverse_a[3];
    for (size_t i = 0; i < 3; ++i) {
        square_a[i] = dot(pair.edge_a[i], pair.edge_a[i]);
        inverse_a[i] = hn::Div(one, hn::Max(square_a[i], tiny));
    }
    Lane3 best{zero, zero, zero};
    Lane least_square = hn::Set(tag, std::numeric_limits<float>::infinity());
    for (size_t j = 0; j < 3; ++j) {
        const Lane3& e = pair.edge_b[j];
        const Lane ee = dot(e, e), inverse_b = hn::Div(one, hn::Max(ee, tiny));
        for (size_t i = 0; i < 3; ++i) {
            const Lane3& d = pair.edge_a[i];
            const Lane3 r = from_a[i] - pair.b[j];
            const Lane de = dot(d, e), dr = dot(d, r), er = dot(e, r);
            const Lane determinant = hn::Sub(hn::Mul(square_a[i], ee), hn::Mul(de, de));
            const Lane free = unit(hn::Div(hn::Sub(hn::Mul(de, er), hn::Mul(dr, ee)), hn::Max(determinant, tiny)));
            const Lane t = unit(hn::Mul(hn::Add(hn::Mul(de, free), er), inverse_b));
            const Lane s = unit(hn::Mul(hn::Sub(hn::Mul(de, t), dr), inverse_a[i]));
            const Lane3 way = (pair.b[j] + e * t) - (from_a[i] + d * s);
            const Lane square = dot(way, way);
            const LaneMask nearer = hn::Lt(square, least_square);
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
    const LaneTag tag;
    TriangleBounds out;
    uint32_t near = 0;
    for (size_t lane = 0; lane < kLanes; lane += hn::Lanes(tag)) {
        const Lane lower = lower_bound(LanePair(a_at(lane), b_at(lane)), margins);
        near |= bits(hn::Lt(lower, hn::Set(tag, limit))) << lane;
        hn::StoreU(lower, tag, out.lower + lane);
    }
    if ((near & ((1u << count) - 1)) == 0) return out;
    for (size_t lane = 0; lane < kLanes; lane += hn::Lanes(tag)) {
        const LanePair pair(a_at(lane), b_at(lane));
        const Lane lower = lower_bound(pair, between_edges(pair), margins);
        hn::StoreU(hn::Max(hn::LoadU(tag, out.lower + lane), lower), tag, out.lower + lane);
    }
    return out;
}

inline TriangleBounds bound_rows(const TriangleRows& a, const TriangleRows& b, const LaneMargins& margins,
                                 float limit) {
    return bound_all_lanes([&](size_t lane) { return load(a, lane); }, [&](size_t lane) { return load(b, lane); },
                           margins, limit);
}

inline LeafDistance distance_of_leaf_pair(const TreeView& a, TriangleRange in_a, const TreeView& b, TriangleRange in_b,
                                          const RelativePose& b_to_a, NearLimit limit, glm::dvec3 normal,
                                          const LaneMarginFactors& factors) {
    LeafDistance out;
    any_four_pair(a, in_a, b, in_b, b_to_a, [&](const FourPair& fours, uint32_t first_a, uint32_t first_b) {
        const LaneMargins margins = fours.margins(0, factors);
        const double scale = fours.scale();
        const auto metres = [scale](float x) { return scale > 0 ? double{x} / scale : 0; };
        for (uint32_t pair = 0; pair < fours.pairs(); pair += kLanes) {
            const auto count = std::min<uint32_t>(fours.pairs() - pair, kLanes);
            const TriangleBounds bounds =
                bound_all_lanes([&](size_t lane) { return fours.lanes_a(pair + lane); },
                                [&](size_t lane) { return fours.lanes_b(pair + lane); }, margins,
                                rounded_up(std::min(limit.distance * scale, double{kFarLimit})), count);
            out.pair_tests += count;
            for (uint32_t left = (1u << count) - 1; left != 0;) {
                auto lane = static_cast<uint32_t>(std::countr_zero(left)); // the nearest first
                for (uint32_t rest = left & (left - 1); rest != 0; rest &= rest - 1) {
                    const auto other = static_cast<uint32_t>(std::countr_zero(rest));
                    if (bounds.lower[other] < bounds.lower[lane]) lane = other;
                }
                left &= ~(1u << lane);
                const double lower = metres(bounds.lower[lane]);
                if (lower >= limit.distance) { // so are the rest
                    out.lower = std::min(out.lower, lower);
                    break;
                }
                const uint32_t i = first_a + fours.in_a(pair + lane), j = first_b + fours.in_b(pair + lane);
                const PlacedTriangle x = query::place(a, i), y = query::place(b, j, b_to_a);
                const double along = gap_along(x, y, normal);
                if (along >= limit.distance) {
                    out.lower = std::min(out.lower, along);
                    continue;
                }
                ++out.exact_tests;
                const TriangleDistance exact = distance(x, y);
                out.lower = std::min(out.lower, exact.lower);
                const bool meet = !(exact.lower > 0);
                if (exact.upper < out.nearest.upper || meet) {
                    out.nearest = exact, out.triangle_a = i, out.triangle_b = j;
                    limit.lower(exact.upper);
                    const glm::dvec3 between = exact.on_b - exact.on_a;
                    const double length = glm::length(between);
                    if (length > 0) normal = between / length;
                }
                if (meet) return true;
            }
        }
        return false;
    });
    return out;
}

} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
