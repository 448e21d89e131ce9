#include "query/triangle.hpp"

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <cmath>

namespace prolate::query {
namespace {

using glm::dmat3;
using glm::dvec3;

dvec3 to_double(const Vec3& v) {
    return {v.x, v.y, v.z};
}

struct Range {
    double low, high;
};
Range range(double x, double y, double z) {
    return {std::min({x, y, z}), std::max({x, y, z})};
}

// Parameters of the closest points of the segments p + s d and q + t e, s and t in [0, 1]; r = p - q. Either may be a
// point (Ericson, Real-Time Collision Detection, section 5.1.9).
struct Closest {
    double s, t;
};
Closest closest(const dvec3& d, const dvec3& e, const dvec3& r) {
    const double dd = glm::dot(d, d), ee = glm::dot(e, e), er = glm::dot(e, r), dr = glm::dot(d, r);
    const auto unit = [](double x) { return std::clamp(x, 0.0, 1.0); };
    if (!(dd > 0)) return {0, ee > 0 ? unit(er / ee) : 0};
    if (!(ee > 0)) return {unit(-dr / dd), 0};
    const double de = glm::dot(d, e), denominator = dd * ee - de * de;
    const double s = denominator > 0 ? unit((de * er - dr * ee) / denominator) : 0;
    const double t = (de * s + er) / ee;
    if (t < 0) return {unit(-dr / dd), 0};
    if (t > 1) return {unit((de - dr) / dd), 1};
    return {s, t};
}

} // namespace

PlacedTriangle place(const TreeView& tree, uint32_t triangle) noexcept {
    PlacedTriangle out{};
    const Triangle corners = tree.triangle(triangle);
    for (size_t i = 0; i < 3; ++i) {
        out.corner[i] = to_double(tree.vertex(corners[i]));
        out.reach = std::max(out.reach, glm::length(out.corner[i]));
    }
    return out;
}

PlacedTriangle place(const TreeView& tree, uint32_t triangle, const RelativePose& b_to_a) noexcept {
    PlacedTriangle out = place(tree, triangle);
    for (dvec3& corner : out.corner) corner = b_to_a.rotation * corner + b_to_a.translation;
    out.reach += b_to_a.distance;
    return out;
}

bool apart(const PlacedTriangle& a, const PlacedTriangle& b, double margin) noexcept {
    const dvec3 origin = a.corner[0];
    const dvec3 p[3] = {{0, 0, 0}, a.corner[1] - origin, a.corner[2] - origin};
    const dvec3 q[3] = {b.corner[0] - origin, b.corner[1] - origin, b.corner[2] - origin};
    const double bound = margin * (a.reach + b.reach);
    const auto separates = [&](const dvec3& n) { // false for a NaN, and for zero
        const Range x = range(0, glm::dot(n, p[1]), glm::dot(n, p[2]));
        const Range y = range(glm::dot(n, q[0]), glm::dot(n, q[1]), glm::dot(n, q[2]));
        return std::max(y.low - x.high, x.low - y.high) > bound * glm::length(n);
    };
    const dvec3 d[3] = {p[1] - p[0], p[2] - p[1], p[0] - p[2]}, e[3] = {q[1] - q[0], q[2] - q[1], q[0] - q[2]};
    const dvec3 normal_a = glm::cross(d[0], p[2]), normal_b = glm::cross(e[0], q[2] - q[0]);
    if (separates(normal_a) || separates(normal_b)) return true;
    for (const dvec3& di : d)
        for (const dvec3& ej : e)
            if (separates(glm::cross(di, ej))) return true;
    for (size_t i = 0; i < 3; ++i)
        if (separates(glm::cross(d[i], normal_a)) || separates(glm::cross(e[i], normal_b))) return true;
    for (size_t i = 0; i < 3; ++i)
        for (size_t j = 0; j < 3; ++j) {
            const auto [s, t] = closest(d[i], e[j], p[i] - q[j]);
            if (separates(q[j] + t * e[j] - (p[i] + s * d[i]))) return true;
        }
    return false;
}

bool apart(const PlacedTriangle& triangle, const PlacedEllipsoid& ellipsoid, double margin) noexcept {
    const dmat3 to_ball = glm::inverse(ellipsoid.factor);
    dvec3 p[3], y[3]; // corners from the center; the same where the ellipsoid is the unit ball
    for (size_t i = 0; i < 3; ++i) {
        p[i] = triangle.corner[i] - ellipsoid.center;
        y[i] = to_ball * p[i];
    }
    const double bound = margin * (triangle.reach + ellipsoid.reach);
    const auto separates = [&](const dvec3& direction) { // given where the ellipsoid is the unit ball
        const dvec3 n = direction * to_ball;
        const Range x = range(glm::dot(n, p[0]), glm::dot(n, p[1]), glm::dot(n, p[2]));
        return std::max(x.low, -x.high) - glm::length(n * ellipsoid.factor) > bound * glm::length(n);
    };
    if (separates(glm::cross(y[1] - y[0], y[2] - y[0]))) return true;
    for (size_t i = 0; i < 3; ++i) {
        const dvec3 edge = y[(i + 1) % 3] - y[i];
        const double square = glm::dot(edge, edge);
        const double t = square > 0 ? std::clamp(-glm::dot(y[i], edge) / square, 0.0, 1.0) : 0;
        if (separates(y[i] + t * edge)) return true;
    }
    return false;
}

} // namespace prolate::query
