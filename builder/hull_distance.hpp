// How far points are from the convex hull of a few others.
#pragma once

#include "builder/eigen.hpp"

#include "src/hull.hpp"

#include <array>
#include <cmath>
#include <cstddef>

namespace prolate {

/// A convex combination of at most four points of a hull.
struct Combination {
    std::array<size_t, 4> corners{}; ///< which points
    std::array<double, 4> weights{}; ///< above 0, of sum 1
    size_t count = 0;                ///< of the corners; 0: none is known yet
};

/// Up to kHullPoints points, all of like size, rounded to floats; what is certain is so of these.
class HullDistance {
public:
    void add(const Vec& point);

    /// An upper bound on the distance of w from the hull, but for rounding; close to it if it is above `enough`. There
    /// must be a point. `nearest` is where to begin, and becomes what was found: give the last one of a point that was
    /// near w, or of w when there were fewer points. Whatever it is, a combination is in the hull. Thread-safe.
    double operator()(const Vec& w, double enough, Combination& nearest) const;

    /// Is w certainly at most so far from one of the points?
    bool near_point(const Vec& w, double distance) const;
    /// The first of the points that are farthest along the direction, for all that floats tell.
    size_t farthest(const Vec& direction) const;
    Vec point(size_t i) const { return {lanes_[0][i], lanes_[1][i], lanes_[2][i]}; }

private:
    std::array<float, kHullPoints> lanes_[3]; // coordinates of the points; unused places repeat the last one
    size_t size_ = 0;
};

/// The points of a combination: whether others are near their hull, too, is told by a few products.
class Simplex {
public:
    Simplex() = default; ///< near nothing
    Simplex(const HullDistance& hull, const Combination& of);

    /// Is x certainly, but for rounding, at most so far from their hull? False if x does not lie above its inside.
    bool within(const Vec& x, double distance) const {
        const Vec d = x - origin_;
        const double a = duals_[0].dot(d), b = duals_[1].dot(d), c = duals_[2].dot(d);
        if (!(a >= 0 && b >= 0 && c >= 0 && a + b + c <= 1)) return false;
        return (d - (a * edges_[0] + b * edges_[1] + c * edges_[2])).squaredNorm() <= distance * distance;
    }

private:
    Vec origin_ = Vec::Constant(HUGE_VAL);
    Vec edges_[3] = {Vec::Zero(), Vec::Zero(), Vec::Zero()}, duals_[3] = {Vec::Zero(), Vec::Zero(), Vec::Zero()};
};

} // namespace prolate
