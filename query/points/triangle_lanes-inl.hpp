// Lower bounds of the distances of four triangles from a point, in single precision. Compiled once for each instruction
// set; include it below <hwy/foreach_target.h>. tests/query/points compares with all
// triangles in long double, for each instruction set.
//
// Seen from the point, a triangle with corners v_k lies beyond the plane across any direction n at the distance
//     min n.v_k / |n|
// so an inexact n costs tightness, never correctness. It is taken towards the nearest point of the triangle: of the
// edges, or of the face where that lies above its inside.
//
// Rounding, u = 2^-24. A corner less the leaf's first one is rounded once, and once more by a scale of the tree, what
// lies between that and the point once, and their sum once: each coordinate is wrong by at most 6 u m, m the largest of
// all coordinates. n.v loses 3 u |n|_1
// m more, and kPointLaneMargin, 32 u, is taken off. The quotient and the root lose less than 2^-20 of it. All is scaled
// by the power of two that brings m into [1/2, 1), so nothing overflows; and an n whose square may have lost digits to
// underflow claims nothing.
//
// Cost: about 120 operations for four triangles.
#if defined(PROLATE_QUERY_POINT_TRIANGLE_LANES_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef PROLATE_QUERY_POINT_TRIANGLE_LANES_INL
#undef PROLATE_QUERY_POINT_TRIANGLE_LANES_INL
#else
#define PROLATE_QUERY_POINT_TRIANGLE_LANES_INL
#endif

#include "query/triangle/fours-inl.hpp"

#include <limits>

HWY_BEFORE_NAMESPACE();
namespace prolate::query::HWY_NAMESPACE {

using Quad3 = Vector3<Quad>;

inline constexpr float kPointLaneMargin = 0x1p-19f, kLeastSquare = 0x1p-100f;

// Towards the nearest point of each triangle, about.
HWY_INLINE Quad3 towards_nearest(const Quad3 (&v)[3]) {
    const Quad zero = broadcast<Quad>(0), one = broadcast<Quad>(1);
    Quad3 best = v[0];
    Quad least = broadcast<Quad>(std::numeric_limits<float>::infinity());
    const Quad3 normal = cross(v[1] - v[0], v[2] - v[0]);
    auto beyond = zero > zero; // an edge: the foot of the point lies outside
    for (size_t i = 0; i < 3; ++i) {
        const Quad3 edge = v[(i + 1) % 3] - v[i];
        const Quad square = dot(edge, edge), along = -dot(v[i], edge);
        const Quad t = min(max(along / square, zero), one);
        const Quad3 on = v[i] + edge * choose_or_zero(square > zero, t);
        const Quad here = dot(on, on);
        best = choose(here < least, on, best), least = lesser(least, here);
        beyond = hn::Or(beyond, dot(normal, cross(v[i], edge)) < zero);
    }
    return choose(beyond, best, choose(dot(normal, v[0]) < zero, -normal, normal));
}

/// Of the `count` <= 4 triangles from `first` on, metres; what other lanes hold means nothing.
HWY_INLINE void bound_four(const TreeView& tree, uint32_t first, uint32_t count, const glm::dvec3& point,
                           float (&lower)[kFour]) {
    const FourTriangles four(tree, first, count);
    const glm::dvec3 shift = four.first_corner() - point;
    for (size_t i = 0; i < kFour; i += kQuadLanes) {
        Quad3 v[3];
        Quad most = broadcast<Quad>(0);
        for (size_t k = 0; k < 3; ++k) {
            v[k] = {four.from_first(3 * k, i) + static_cast<float>(shift.x),
                    four.from_first(3 * k + 1, i) + static_cast<float>(shift.y),
                    four.from_first(3 * k + 2, i) + static_cast<float>(shift.z)};
            most = max(most, max_norm(v[k]));
        }
        most = max(most, broadcast<Quad>(static_cast<float>(glm::length(shift))));
        const float largest = hn::GetLane(hn::MaxOfLanes(QuadTag(), most)), scale = unit_scale(largest);
        for (Quad3& corner : v) corner = corner * scale;
        const Quad3 n = towards_nearest(v);
        const Quad square = dot(n, n);
        const Quad least = min(min(dot(n, v[0]), dot(n, v[1])), dot(n, v[2]));
        const Quad certain = least - kPointLaneMargin * one_norm(n);
        const Quad bound = certain / sqrt(square) * ((1 - 0x1p-19f) / scale);
        const auto sound = hn::And(square > kLeastSquare, bound > broadcast<Quad>(0));
        store(choose_or_zero(sound, bound), lower + i);
    }
}

} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
