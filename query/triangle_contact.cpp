#include "query/triangle_contact.hpp"

#include "query/triangle_distance.hpp"
#include "query/triangle_pair.hpp"

#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

namespace prolate::query {
namespace {

using glm::dvec3;
using Corners = dvec3[3];

constexpr double kEdgeBias = 0.95; // an edge's product must overlap by less than this share of what a face does
constexpr double kParallel = 1e-8; // sine of an angle: edges, and planes, that are nearer to parallel are taken for it
constexpr double kFlat = 1e-10;    // distance from a plane, of the triangles' size: no more than rounding

struct Axis {
    dvec3 normal{0, 0, 1};
    double depth = std::numeric_limits<double>::infinity();
};

Axis least_overlap(const TrianglePair& pair) {
    Axis best;
    const auto consider = [&](const dvec3& n, double least_length, double bias) {
        const double length = glm::length(n);
        if (!(length > least_length)) return;
        const auto x = pair.range_a(n), y = pair.range_b(n);
        const double forward = (x.high - y.low) / length, backward = (y.high - x.low) / length;
        if (!(std::min(forward, backward) < bias * best.depth)) return;
        best = forward <= backward ? Axis{n / length, forward} : Axis{-n / length, backward};
    };
    consider(pair.normal_a, 0, 1), consider(pair.normal_b, 0, 1);
    for (const dvec3& d : pair.d)
        for (const dvec3& e : pair.e)
            consider(glm::cross(d, e), kParallel * glm::length(d) * glm::length(e), kEdgeBias);
    if (std::isinf(best.depth)) best.depth = 0; // points, or segments of one direction
    return best;
}

using Segment = std::pair<dvec3, dvec3>;

// The part of the triangle in the plane n.(x - y) = 0, if its corners lie on both sides.
std::optional<Segment> cut(const Corners& corner, const dvec3& y, const dvec3& n) {
    dvec3 found[3];
    size_t count = 0;
    for (size_t i = 0; i < 3; ++i) {
        const dvec3 &p = corner[i], &q = corner[(i + 1) % 3];
        const double h = glm::dot(n, p - y), k = glm::dot(n, q - y);
        if ((h < 0) != (k < 0)) found[count++] = p + h / (h - k) * (q - p);
    }
    if (count != 2) return std::nullopt;
    return Segment{found[0], found[1]};
}

std::optional<dvec3> middle_of_crossing(const TrianglePair& pair) {
    const dvec3 line = glm::cross(pair.normal_a, pair.normal_b);
    if (!(glm::length(line) > kParallel * glm::length(pair.normal_a) * glm::length(pair.normal_b))) return std::nullopt;
    auto x = cut(pair.p, pair.q[0], pair.normal_b), y = cut(pair.q, pair.p[0], pair.normal_a);
    if (!x || !y) return std::nullopt;
    const auto along = [&](const dvec3& p) { return glm::dot(line, p); };
    for (Segment* s : {&*x, &*y})
        if (along(s->first) > along(s->second)) std::swap(s->first, s->second);
    const dvec3 low = along(x->first) > along(y->first) ? x->first : y->first;
    const dvec3 high = along(x->second) < along(y->second) ? x->second : y->second;
    return 0.5 * (low + high);
}

// Centroid of what two triangles of one plane have in common.
std::optional<dvec3> centroid_of_overlap(const TrianglePair& pair) {
    const double length = glm::length(pair.normal_b);
    const double size = std::max({glm::length(pair.p[1]), glm::length(pair.p[2]), glm::length(pair.q[0]),
                                  glm::length(pair.q[1]), glm::length(pair.q[2])});
    if (!(length > 0)) return std::nullopt;
    for (const dvec3& p : pair.p)
        if (!(std::abs(glm::dot(pair.normal_b, p - pair.q[0])) <= kFlat * size * length)) return std::nullopt;

    std::array<dvec3, 6> polygon{pair.p[0], pair.p[1], pair.p[2]}; // each of the three cuts adds a corner at most
    size_t count = 3;
    for (size_t j = 0; j < 3; ++j) {
        const dvec3 inward = glm::cross(pair.normal_b, pair.e[j]);
        std::array<dvec3, 6> kept;
        size_t kept_count = 0;
        for (size_t i = 0; i < count; ++i) {
            const dvec3 &p = polygon[i], &q = polygon[(i + 1) % count];
            const double h = glm::dot(inward, p - pair.q[j]), k = glm::dot(inward, q - pair.q[j]);
            if (h >= 0 && kept_count < 6) kept[kept_count++] = p;
            if ((h < 0) != (k < 0) && kept_count < 6) kept[kept_count++] = p + h / (h - k) * (q - p);
        }
        polygon = kept, count = kept_count;
    }
    if (count == 0) return std::nullopt;
    dvec3 sum{}, mean{};
    double area = 0;
    for (size_t i = 0; i < count; ++i) {
        mean += polygon[i] / static_cast<double>(count);
        if (i < 2) continue;
        const double part = glm::length(glm::cross(polygon[i - 1] - polygon[0], polygon[i] - polygon[0]));
        sum += part / 3 * (polygon[0] + polygon[i - 1] + polygon[i]);
        area += part;
    }
    return area > 0 ? sum / area : mean;
}

} // namespace

TriangleContact contact(const PlacedTriangle& a, const PlacedTriangle& b) noexcept {
    const TrianglePair pair(a, b);
    const Axis axis = least_overlap(pair);
    auto point = centroid_of_overlap(pair);
    if (!point) point = middle_of_crossing(pair);
    if (point) return {pair.origin + *point, axis.normal, axis.depth};
    const TriangleDistance closest_points = distance(a, b);
    return {0.5 * (closest_points.on_a + closest_points.on_b), axis.normal, axis.depth};
}

} // namespace prolate::query
