// The lowest point of a body over a half-space, found by the traversal (search.cpp). All in the body's frame, in double
// precision.
#pragma once

#include "query/half_space/search.hpp"
#include "query/triangle/placed.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace prolate::query {

inline bool is_finite(const PlacedHalfSpace& h) {
    return std::isfinite(h.normal.x + h.normal.y + h.normal.z + h.offset + h.reach);
}
// Of a point, in the tree's frame.
inline double height(const glm::dvec3& p, const PlacedHalfSpace& h) {
    return glm::dot(h.normal, p) - h.offset;
}
// The lowest point of an ellipsoid.
inline glm::dvec3 lowest_point(const PlacedEllipsoid& e, const glm::dvec3& n) {
    const glm::dvec3 m = n * e.factor;
    const double length = glm::length(m);
    return length > 0 ? e.center - e.factor * (m / length) : e.center;
}

// The lowest point of a body.
class Lowest {
public:
    explicit Lowest(HeightSearch& search) : s_(search) {
        s_.user = this;
        s_.leaf = [](void* self, uint32_t slot) { return static_cast<Lowest*>(self)->leaf(slot); };
    }

    double lower = HUGE_VAL;   // no leaf that was looked at is lower
    double height = HUGE_VAL;  // of the lowest point, which is
    glm::dvec3 point{0, 0, 0}; // this one
    double slack = 0;          // what its height may be wrong by
    MeetingPair pair{};
    bool meets = false; // some leaf, by separated()

private:
    bool leaf(uint32_t slot) {
        const TriangleRange range = s_.side.tree.triangles(slot);
        if (std::max(range.count, 1u) > s_.left()) return false;
        s_.stats.triangle_tests += std::max(range.count, 1u);
        if (range.count == 0) {
            const PlacedEllipsoid e = place(s_.side.tree.bound(slot), s_.side.tree.scale());
            consider(lowest_point(e, s_.shape.normal), e.reach, !separated(e, s_.shape),
                     {slot, 0, kNoTriangle, kNoTriangle});
        }
        for (uint32_t t = range.first; t < range.first + range.count; ++t) {
            const PlacedTriangle triangle = place(s_.side.tree, t);
            const glm::dvec3* const low =
                std::min_element(triangle.corner, triangle.corner + 3, [&](const glm::dvec3& a, const glm::dvec3& b) {
                    return glm::dot(s_.shape.normal, a) < glm::dot(s_.shape.normal, b);
                });
            consider(*low, triangle.reach, !separated(triangle, s_.shape), {slot, 0, t, kNoTriangle});
        }
        return true;
    }
    void consider(const glm::dvec3& p, double reach, bool meet, const MeetingPair& of) {
        const double here = query::height(p, s_.shape), rounding = kSeparationMargin * (reach + s_.shape.reach);
        meets = meets || meet;
        lower = std::min(lower, meet ? 0 : std::max(here - rounding, std::numeric_limits<double>::min()));
        if (!(here < height)) return;
        height = here, point = p, pair = of, slack = rounding;
        s_.limit = std::min(s_.limit, here + rounding);
    }

    HeightSearch& s_;
};

} // namespace prolate::query
