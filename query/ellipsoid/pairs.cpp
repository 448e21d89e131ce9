// Pairs of single ellipsoids in double precision, and the placing of bodies for batches.
//
// What the float form of a body (WorldEllipsoid) is wrong by is not estimated but measured, in double: the rounding of
// its center, |center in double - center in float|, and of its factor. To that comes the error of double itself: the
// center 37 u |c| + 2 u |c'| for a local center c and a world center c' (separation.hpp), the factor, orthogonalised
// row by row, at most 128 u |L| (29 u of the rotation; the rest is Gram and Schmidt's backward error, generously). All
// is enlarged by 16 v, for the rounding of what lanes make of it: the sum of two, its products with lengths.
#include "query/ellipsoid/gap.hpp"
#include "query/ellipsoid/placed.hpp"

#include <prolate/pairs.hpp>

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include <array>
#include <bit>
#include <cmath>
#include <limits>

namespace prolate {
namespace {

using glm::dmat3;
using glm::dvec3;
using query::PairVerdict;
using query::to_float;

// Swapped arguments must give the same answer in spite of rounding, so each call works in one fixed order.
template <size_t Words, class T> bool bits_less(const T& x, const T& y) {
    using Bits = std::array<uint32_t, Words>;
    return std::bit_cast<Bits>(x) < std::bit_cast<Bits>(y);
}
bool swapped(const Ellipsoid& a, const Pose& pose_a, const Ellipsoid& b, const Pose& pose_b) {
    return pose_a == pose_b ? bits_less<9>(b, a) : bits_less<7>(pose_b, pose_a);
}

// The nearest float that is not below, or not above; bounds must stay bounds.
float round_up(double x) {
    const auto f = static_cast<float>(x);
    return double{f} < x ? std::nextafter(f, std::numeric_limits<float>::infinity()) : f;
}
float round_down(double x) {
    return -round_up(-x);
}

constexpr double kV = 0x1p-24;
constexpr double kLaneShare = 15 * kV; // of |L|: collide_pairs.cpp, distance_pairs.cpp

} // namespace

Verdict collide(const Ellipsoid& a, const Pose& pose_a, const Ellipsoid& b, const Pose& pose_b, float margin) noexcept {
    if (swapped(a, pose_a, b, pose_b)) return collide(b, pose_b, a, pose_a, margin);
    const auto first = query::place(a), second = query::place(b, query::relative_pose(pose_a, pose_b));
    if (query::test_pair(first, second).verdict != PairVerdict::separated) return Verdict::overlapping;
    if (margin == 0) return Verdict::separated;
    return query::distance_of(first, second, 0).lower > margin ? Verdict::separated : Verdict::overlapping;
}

PairDistance distance(const Ellipsoid& a, const Pose& pose_a, const Ellipsoid& b, const Pose& pose_b,
                      float tolerance) noexcept {
    if (swapped(a, pose_a, b, pose_b)) {
        PairDistance out = distance(b, pose_b, a, pose_a, tolerance);
        out.normal = {-out.normal.x, -out.normal.y, -out.normal.z};
        std::swap(out.point_a, out.point_b);
        return out;
    }
    const auto first = query::place(a), second = query::place(b, query::relative_pose(pose_a, pose_b));
    query::Gap gap = query::distance_of(first, second, tolerance);
    if (!(gap.lower > 0)) gap = query::depth_of(first, second, tolerance);
    const dmat3 rotation = query::rotation_matrix(pose_a.rotation);
    const dvec3 origin(pose_a.translation.x, pose_a.translation.y, pose_a.translation.z);
    return {.lower = round_down(gap.lower),
            .upper = round_up(gap.upper),
            .normal = to_float(rotation * gap.normal),
            .point_a = to_float(rotation * gap.point_a + origin),
            .point_b = to_float(rotation * gap.point_b + origin)};
}

void place(std::span<const Ellipsoid> shapes, std::span<const Pose> poses, std::span<WorldEllipsoid> world) noexcept {
    for (size_t i = 0; i < world.size(); ++i) {
        const Ellipsoid& e = shapes[i];
        const dmat3 rotation = query::rotation_matrix(poses[i].rotation);
        const dmat3 l = rotation * dmat3{{e.l11, e.l21, e.l31}, {0, e.l22, e.l32}, {0, 0, e.l33}};
        const dvec3 local(e.center.x, e.center.y, e.center.z);
        const Vec3& t = poses[i].translation;
        const dvec3 center = rotation * local + dvec3(t.x, t.y, t.z);

        // Rows of L = (lower triangle) (orthogonal): only |L^T n| matters, so the orthogonal factor is dropped.
        const dmat3 rows = glm::transpose(l);
        const double l11 = glm::length(rows[0]);
        const dvec3 e1 = rows[0] / l11;
        const double l21 = glm::dot(rows[1], e1), l31 = glm::dot(rows[2], e1);
        const dvec3 second = rows[1] - l21 * e1, rest = rows[2] - l31 * e1;
        const double l22 = glm::length(second);
        const dvec3 e2 = second / l22;
        const double l32 = glm::dot(rest, e2), l33 = glm::length(rest - l32 * e2);

        WorldEllipsoid& out = world[i];
        const double factor[6] = {l11, l21, l22, l31, l32, l33};
        double square = 0, lost = 0;
        for (size_t j = 0; j < 6; ++j) {
            out.factor[j] = static_cast<float>(factor[j]);
            square += factor[j] * factor[j];
            lost += (factor[j] - out.factor[j]) * (factor[j] - out.factor[j]);
        }
        double moved = 0;
        for (int j = 0; j < 3; ++j) {
            out.center[j] = static_cast<float>(center[j]);
            moved += (center[j] - out.center[j]) * (center[j] - out.center[j]);
        }
        const double size = std::sqrt(square), local_length = glm::length(local);
        const double center_error =
            local_length > 0 ? std::sqrt(moved) + 0x1p-47 * local_length + 0x1p-51 * glm::length(center) : 0;
        out.slack = round_up((center_error + std::sqrt(lost) + 0x1p-46 * size + kLaneShare * size) * (1 + 16 * kV));
        // The smallest semi-axis: that of the factor in double, less what is wrong with it.
        const double width = query::least_width(dmat3{{l11, l21, l31}, {0, l22, l32}, {0, 0, l33}}, size);
        out.thinness = width > 0 ? round_up(1 / width) : std::numeric_limits<float>::infinity();
        out.size = static_cast<float>(size);
        // A pose that is not finite spoils its own body only: NaN lanes decide nothing.
    }
}

} // namespace prolate
