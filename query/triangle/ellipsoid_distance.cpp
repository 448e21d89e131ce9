#include "query/triangle/ellipsoid_distance.hpp"

#include "query/ellipsoid/nearest_direction.hpp"

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace prolate::query {
namespace {

using glm::dmat3;
using glm::dvec3;

constexpr int kEdgeSteps = 32;

class EllipsoidDistanceSearch {
public:
    EllipsoidDistanceSearch(const PlacedTriangle& triangle, const PlacedEllipsoid& ellipsoid)
        : ellipsoid_(ellipsoid), p_{triangle.corner[0] - ellipsoid.center, triangle.corner[1] - ellipsoid.center,
                                    triangle.corner[2] - ellipsoid.center},
          q_(ellipsoid.factor * glm::transpose(ellipsoid.factor)), to_ball_(glm::inverse(ellipsoid.factor)) {}

    void run() {
        if (face_pierces() || face_settles()) return;
        for (size_t i = 0; i < 3; ++i)
            if (edge_settles(p_[i], p_[(i + 1) % 3])) return;
    }
    TriangleDistance result(double bound) const {
        const double least = gap_ - bound;
        return {.lower = least > 0 ? least : 0, // a NaN, too
                .upper = std::isfinite(distance_) ? distance_ + bound : std::numeric_limits<double>::infinity(),
                .on_a = ellipsoid_.center + x_,
                .on_b = ellipsoid_.center + y_,
                .normal = -normal_};
    }

private:
    // Takes the points x of the triangle and y of the ellipsoid, and the direction n. Are the bounds tight?
    bool settles(const dvec3& x, const dvec3& y, const dvec3& n) {
        const double distance = glm::length(x - y);
        if (distance < distance_) distance_ = distance, x_ = x, y_ = y;
        const double least = std::min({glm::dot(n, p_[0]), glm::dot(n, p_[1]), glm::dot(n, p_[2])});
        const double gap = (least - glm::length(n * ellipsoid_.factor)) / glm::length(n);
        if (gap > gap_) gap_ = gap, normal_ = n;
        return gap_ > kTightBound * distance_;
    }
    // The support point in direction n.
    dvec3 farthest(const dvec3& n) const {
        const dvec3 u = n * ellipsoid_.factor;
        return ellipsoid_.factor * (u / glm::length(u));
    }
    // Direction from the ellipsoid's point nearest to x towards x; 0 if x lies inside, which `settles` the matter.
    dvec3 direction_to(const dvec3& x) {
        const dvec3 u = to_ball_ * x;
        const double radial = glm::length(u);
        if (!(radial > 1)) {
            settles(x, ellipsoid_.factor * u, {1, 0, 0});
            return {0, 0, 0};
        }
        return query::nearest_direction(ellipsoid_.factor, q_, x);
    }
    bool at(const dvec3& x, const dvec3& n) { return settles(x, farthest(n), n); }

    // Does the face hold a point of the ellipsoid? Where that is the unit ball, the one nearest to its center.
    bool face_pierces() {
        const dvec3 from = to_ball_ * p_[0], e = to_ball_ * (p_[1] - p_[0]), f = to_ball_ * (p_[2] - p_[0]);
        const dvec3 n = glm::cross(e, f);
        const double square = glm::dot(n, n), height = glm::dot(n, from);
        if (!(height * height <= square)) return false;
        const dvec3 foot = n * (height / square) - from;
        const double s = glm::dot(glm::cross(foot, f), n) / square, t = glm::dot(glm::cross(e, foot), n) / square;
        if (!(s >= 0 && t >= 0 && s + t <= 1)) return false;
        const dvec3 x = p_[0] + s * (p_[1] - p_[0]) + t * (p_[2] - p_[0]);
        settles(x, x, {1, 0, 0});
        return true;
    }
    bool face_settles() {
        const dvec3 e = p_[1] - p_[0], f = p_[2] - p_[0];
        dvec3 n = glm::cross(e, f);
        if (glm::dot(n, p_[0]) < 0) n = -n;
        const dvec3 y = farthest(n);
        const double square = glm::dot(n, n);
        const dvec3 foot = y - p_[0];
        const double s = glm::dot(glm::cross(foot, f), glm::cross(e, f)) / square;
        const double t = glm::dot(glm::cross(e, foot), glm::cross(e, f)) / square;
        if (!(s >= 0 && t >= 0 && s + t <= 1)) return false;
        return settles(p_[0] + s * e + t * f, y, n);
    }
    bool edge_settles(const dvec3& from, const dvec3& to) {
        const dvec3 e = to - from;
        double low = 0, high = 1, slope_low = 0, slope_high = 0;
        const auto slope = [&](double s, bool& settled) {
            const dvec3 x = from + s * e, n = direction_to(x);
            settled = n == dvec3(0) || at(x, n); // a point inside: they meet
            const double length = glm::length(n);
            return length > 0 ? glm::dot(n, e) / length : 0;
        };
        bool settled = false;
        slope_low = slope(0, settled);
        if (settled || slope_low >= 0) return settled;
        slope_high = slope(1, settled);
        if (settled || slope_high <= 0) return settled;
        int side = 0;
        for (int i = 0; i < kEdgeSteps; ++i) {
            double s = (low * slope_high - high * slope_low) / (slope_high - slope_low);
            if (!(s > low && s < high)) s = low + 0.5 * (high - low);
            const double here = slope(s, settled);
            if (settled || here == 0 || !(high - low > 0x1p-50)) return settled;
            if (here < 0) {
                if (side < 0) slope_high *= 0.5;
                low = s, slope_low = here, side = -1;
            } else {
                if (side > 0) slope_low *= 0.5;
                high = s, slope_high = here, side = 1;
            }
        }
        return false;
    }

    const PlacedEllipsoid& ellipsoid_;
    const dvec3 p_[3]; // corners from the center
    const dmat3 q_, to_ball_;
    double distance_ = std::numeric_limits<double>::infinity();
    double gap_ = -std::numeric_limits<double>::infinity();
    dvec3 x_{0, 0, 0}, y_{0, 0, 0}, normal_{0, 0, 0}; // the last: of the best gap, from the ellipsoid
};

} // namespace

TriangleDistance distance(const PlacedTriangle& triangle, const PlacedEllipsoid& ellipsoid, double margin) noexcept {
    EllipsoidDistanceSearch search(triangle, ellipsoid);
    search.run();
    return search.result(margin * (triangle.reach + ellipsoid.reach));
}

} // namespace prolate::query
