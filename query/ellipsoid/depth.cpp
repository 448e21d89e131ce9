#include "query/ellipsoid/depth.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cstdint>
#include <limits>

namespace prolate::query {
namespace {

using glm::dvec3;

constexpr double kTight = 0.9, kLeastShare = 0x1p-10; // of the depth, and of the smaller body
constexpr uint32_t kMostTriangles = 2048, kDeepestDivision = 12;

struct SphereTriangle {
    dvec3 corner[3];
    uint32_t divisions;
};

} // namespace

double least_depth(const PlacedEllipsoid& a, const PlacedEllipsoid& b, double at_least) noexcept {
    const dvec3 r = b.center - a.center;
    const double slack = kLeastShare * std::min(a.size, b.size);
    double least = std::numeric_limits<double>::infinity(); // h of a direction
    double bound = least;                                   // of all triangles that are done
    SphereTriangle stack[8 + 3 * kDeepestDivision];
    uint32_t size = 0;
    for (uint32_t octant = 0; octant < 8; ++octant) {
        const auto axis = [&](uint32_t i) {
            dvec3 out(0);
            out[static_cast<glm::length_t>(i)] = (octant >> i & 1) != 0 ? -1 : 1;
            return out;
        };
        stack[size++] = {{axis(0), axis(1), axis(2)}, 0};
    }
    for (uint32_t triangles = 0; size > 0; ++triangles) {
        const SphereTriangle t = stack[--size];
        const dvec3 m = glm::normalize(t.corner[0] + t.corner[1] + t.corner[2]);
        const dvec3 of_a = m * a.factor, of_b = m * b.factor; // L^T m
        const dvec3 x = a.factor * glm::normalize(of_a) + b.factor * glm::normalize(of_b) - r;
        least = std::min(least, glm::dot(x, m));
        if (least <= at_least) return 0;
        const double here = std::min({glm::dot(x, t.corner[0]), glm::dot(x, t.corner[1]), glm::dot(x, t.corner[2])});
        if (here >= kTight * least - slack || t.divisions == kDeepestDivision || triangles >= kMostTriangles) {
            if (!(here > 0)) return 0; // NaN, too
            bound = std::min(bound, here);
            continue;
        }
        const dvec3 ab = glm::normalize(t.corner[0] + t.corner[1]), bc = glm::normalize(t.corner[1] + t.corner[2]),
                    ca = glm::normalize(t.corner[2] + t.corner[0]);
        const uint32_t divisions = t.divisions + 1;
        stack[size++] = {{t.corner[0], ab, ca}, divisions};
        stack[size++] = {{t.corner[1], bc, ab}, divisions};
        stack[size++] = {{t.corner[2], ca, bc}, divisions};
        stack[size++] = {{ab, bc, ca}, divisions};
    }
    return std::max(0.0, bound - kSeparationMargin * (a.reach + b.reach));
}

} // namespace prolate::query
