// Two triangles seen from a corner of the first, and the directions that may separate them. What separation.hpp says of
// rounding holds for gap().
#pragma once

#include "query/triangle/placed.hpp"

#include <glm/geometric.hpp>

#include <algorithm>

namespace prolate::query {

/// Parameters of the closest points of the segments p + s d and q + t e, s and t in [0, 1]; r = p - q. Either may be a
/// point (Ericson, Real-Time Collision Detection, section 5.1.9).
struct ClosestParameters {
    double s, t;
};
inline ClosestParameters closest(const glm::dvec3& d, const glm::dvec3& e, const glm::dvec3& r) {
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

struct TrianglePair {
    glm::dvec3 origin;             // a.corner[0]
    glm::dvec3 p[3], q[3];         // corners of a and of b from there
    glm::dvec3 d[3], e[3];         // edges from p[i] to p[i + 1], from q[j] to q[j + 1]
    glm::dvec3 normal_a, normal_b; // of any length

    TrianglePair(const PlacedTriangle& a, const PlacedTriangle& b)
        : origin(a.corner[0]), p{{0, 0, 0}, a.corner[1] - origin, a.corner[2] - origin}, q{b.corner[0] - origin,
                                                                                           b.corner[1] - origin,
                                                                                           b.corner[2] - origin},
          d{p[1], p[2] - p[1], -p[2]}, e{q[1] - q[0], q[2] - q[1], q[0] - q[2]}, normal_a(glm::cross(d[0], p[2])),
          normal_b(glm::cross(e[0], q[2] - q[0])) {}

    struct Range {
        double low, high;
    };
    Range range_a(const glm::dvec3& n) const { return range(0, glm::dot(n, p[1]), glm::dot(n, p[2])); }
    Range range_b(const glm::dvec3& n) const { return range(glm::dot(n, q[0]), glm::dot(n, q[1]), glm::dot(n, q[2])); }
    /// |n| times the gap between the triangles along n or -n; negative if they overlap there.
    double gap(const glm::dvec3& n) const {
        const Range x = range_a(n), y = range_b(n);
        return std::max(y.low - x.high, x.low - y.high);
    }

    /// Does n, and not -n, lead from a to b where gap(n) is positive?
    bool leads_from_a(const glm::dvec3& n) const {
        const Range x = range_a(n), y = range_b(n);
        return y.low - x.high >= x.low - y.high;
    }

    /// Calls visit(n) for each candidate direction (separation.hpp) until one returns true; did one?
    template <class Visit> bool any_direction(Visit&& visit) const {
        if (visit(normal_a) || visit(normal_b)) return true;
        for (const glm::dvec3& di : d)
            for (const glm::dvec3& ej : e)
                if (visit(glm::cross(di, ej))) return true;
        for (size_t i = 0; i < 3; ++i)
            if (visit(glm::cross(d[i], normal_a)) || visit(glm::cross(e[i], normal_b))) return true;
        for (size_t i = 0; i < 3; ++i)
            for (size_t j = 0; j < 3; ++j) {
                const auto [s, t] = closest(d[i], e[j], p[i] - q[j]);
                if (visit(q[j] + t * e[j] - (p[i] + s * d[i]))) return true;
            }
        return false;
    }

private:
    static Range range(double x, double y, double z) { return {std::min({x, y, z}), std::max({x, y, z})}; }
};

} // namespace prolate::query
