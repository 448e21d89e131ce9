#include "query/ellipsoid/placed.hpp"

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include <cmath>
#include <limits>

namespace prolate::query {
namespace {

using glm::dmat3;
using glm::dvec3;

double frobenius(const dmat3& m) {
    return std::sqrt(glm::dot(m[0], m[0]) + glm::dot(m[1], m[1]) + glm::dot(m[2], m[2]));
}

dmat3 factor_of(const Ellipsoid& e) {
    return {{e.l11, e.l21, e.l31}, {0, e.l22, e.l32}, {0, 0, e.l33}}; // columns
}

RelativePose finite_or_nan(const RelativePose& pose) {
    const dmat3& r = pose.rotation;
    const dvec3& t = pose.translation;
    if (std::isfinite(r[0][0] + r[1][1] + r[2][2] + t.x + t.y + t.z + pose.distance)) return pose;
    const double nan = std::numeric_limits<double>::quiet_NaN();
    return {dmat3(dvec3(nan), dvec3(nan), dvec3(nan)), dvec3(nan), nan};
}

} // namespace

// Squares and products of floats are exact in double.
dmat3 rotation_matrix(const Quat& q) noexcept {
    const double x = q.x, y = q.y, z = q.z, w = q.w;
    const double s = 2 / (x * x + y * y + z * z + w * w);
    return {{1 - s * (y * y + z * z), s * (x * y + z * w), s * (x * z - y * w)}, // columns
            {s * (x * y - z * w), 1 - s * (x * x + z * z), s * (y * z + x * w)},
            {s * (x * z + y * w), s * (y * z - x * w), 1 - s * (x * x + y * y)}};
}

RelativePose relative_pose(const Pose& a, const Pose& b) noexcept {
    const dmat3 rotation_a = rotation_matrix(a.rotation), rotation_b = rotation_matrix(b.rotation);
    const dvec3 d = to_double(b.translation) - to_double(a.translation);
    return finite_or_nan({glm::transpose(rotation_a) * rotation_b, d * rotation_a, glm::length(d)});
}

RelativePose world_pose(const Pose& pose) noexcept {
    const dvec3 t = to_double(pose.translation);
    return finite_or_nan({rotation_matrix(pose.rotation), t, glm::length(t)});
}

RelativePose inverse(const RelativePose& pose) noexcept {
    return {glm::transpose(pose.rotation), -(pose.translation * pose.rotation), pose.distance};
}

PlacedEllipsoid place(const Ellipsoid& e) noexcept {
    return place(e, 1.0);
}

PlacedEllipsoid place(const Ellipsoid& e, double scale) noexcept {
    PlacedEllipsoid out{to_double(e.center) * scale, factor_of(e) * scale, 0, 0};
    out.size = frobenius(out.factor);
    out.reach = glm::length(out.center) + out.size;
    return out;
}

PlacedEllipsoid place(const Ellipsoid& e, const RelativePose& b_to_a) noexcept {
    return place(e, 1.0, b_to_a);
}

PlacedEllipsoid place(const Ellipsoid& e, double scale, const RelativePose& b_to_a) noexcept {
    PlacedEllipsoid out = place(e, scale);
    out.reach += b_to_a.distance;
    out.center = b_to_a.rotation * out.center + b_to_a.translation;
    out.factor = b_to_a.rotation * out.factor;
    return out;
}

double support(const PlacedEllipsoid& e, const dvec3& n) noexcept {
    return glm::dot(n, e.center) + glm::length(n * e.factor);
}

PlacedPoint place(const dvec3& p, const RelativePose& to_frame) noexcept {
    return {to_frame.rotation * p + to_frame.translation, glm::length(p) + to_frame.distance};
}

} // namespace prolate::query
