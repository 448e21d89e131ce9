#include "query/triangle/separation.hpp"

#include "query/triangle/pair.hpp"

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <cmath>

namespace prolate::query {

using glm::dmat3;
using glm::dvec3;

namespace {

// No direction says otherwise, but 26 of them would have to be asked: triangles are often smaller than a margin.
bool corners_within(const PlacedTriangle& a, const PlacedTriangle& b, double distance) {
    const auto within = [&](const dvec3& p, const dvec3& q) { return glm::dot(p - q, p - q) <= distance * distance; };
    return std::any_of(a.corner, a.corner + 3, [&](const dvec3& p) {
        return std::any_of(b.corner, b.corner + 3, [&](const dvec3& q) { return within(p, q); });
    });
}

} // namespace

bool separated(const PlacedTriangle& a, const PlacedTriangle& b, double distance, double margin) noexcept {
    if (distance > 0 && corners_within(a, b, distance)) return false;
    const TrianglePair pair(a, b);
    const double bound = margin * (a.reach + b.reach) + distance;
    return pair.any_direction([&](const dvec3& n) { // false for a NaN, and for zero
        return pair.gap(n) > bound * glm::length(n);
    });
}

bool separated(const PlacedTriangle& triangle, const PlacedEllipsoid& ellipsoid, double margin) noexcept {
    const dmat3 to_ball = glm::inverse(ellipsoid.factor);
    dvec3 p[3], y[3]; // corners from the center; the same where the ellipsoid is the unit ball
    for (size_t i = 0; i < 3; ++i) {
        p[i] = triangle.corner[i] - ellipsoid.center;
        y[i] = to_ball * p[i];
    }
    const double bound = margin * (triangle.reach + ellipsoid.reach);
    const auto separates = [&](const dvec3& direction) { // given where the ellipsoid is the unit ball
        const dvec3 n = direction * to_ball;
        const double x[3] = {glm::dot(n, p[0]), glm::dot(n, p[1]), glm::dot(n, p[2])};
        const auto [low, high] = std::minmax({x[0], x[1], x[2]});
        return std::max(low, -high) - glm::length(n * ellipsoid.factor) > bound * glm::length(n);
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
