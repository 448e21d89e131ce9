// P. Wolfe 1976, "Finding the nearest point in a polytope": the point that is farthest towards w joins those that the
// combination is of, and those that the nearest point of their affine hull needs less than nothing of leave.
#include "builder/hull_distance.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

namespace prolate {
namespace {

constexpr int kMostImprovements = 64;
constexpr double kLeastApproach = 1e-3; // of the squared distance, by which a point must be farther towards w to join

class NearestCombination {
public:
    NearestCombination(const HullDistance& hull, const Vec& w, Combination& at) : hull_(hull), w_(w), at_(at) {
        if (at.count == 0)
            begin_with(hull.farthest(w));
        else
            settle();
    }
    double improve_until(double enough) {
        double reached = (w_ - x_).norm();
        for (int step = 0; step < kMostImprovements && reached > enough && improve(); ++step)
            reached = (w_ - x_).norm();
        return reached;
    }

private:
    void begin_with(size_t corner) {
        at_.corners[0] = corner, at_.weights[0] = 1, at_.count = 1;
        x_ = hull_.point(corner);
    }
    // False once it is as near as it gets.
    bool improve() {
        if (at_.count == 4) return false;
        const Vec to = w_ - x_, before = x_;
        const size_t next = hull_.farthest(to);
        if (!(to.dot(hull_.point(next) - x_) > kLeastApproach * to.squaredNorm())) return false;
        at_.corners[at_.count] = next, at_.weights[at_.count++] = 0;
        settle();
        const bool nearer = (w_ - x_).squaredNorm() < to.squaredNorm();
        if (!nearer) x_ = before;
        return nearer;
    }
    // Makes the combination the nearest one of its corners, or of some of them.
    void settle() {
        while (!settle_or_drop()) {
        } // a single corner settles
        x_ = Vec::Zero();
        for (size_t i = 0; i < at_.count; ++i) x_ += at_.weights[i] * hull_.point(at_.corners[i]);
    }
    // Moves the weights to those of the nearest point of the affine hull, or as far as none is below 0, and then drops
    // the corner that stopped them. True if none did.
    bool settle_or_drop() {
        auto& [corners, weights, count] = at_;
        const std::array<double, 4> wanted = nearest_in_affine_hull();
        double share = 1;
        size_t stops = count;
        for (size_t i = 0; i < count; ++i) {
            if (wanted[i] > 0) continue;
            const double reached = weights[i] / (weights[i] - wanted[i]);
            if (!(reached >= share)) share = reached, stops = i;
        }
        if (stops == count) {
            weights = wanted;
            return true;
        }
        for (size_t i = 0; i < count; ++i) weights[i] += share * (wanted[i] - weights[i]);
        --count;
        for (size_t i = stops; i < count; ++i) corners[i] = corners[i + 1], weights[i] = weights[i + 1];
        return false;
    }
    // Weights of the corners, which sum to 1. Of corners in one plane, on one line or in one place, not a number.
    std::array<double, 4> nearest_in_affine_hull() const {
        std::array<double, 4> out{1, 0, 0, 0};
        if (at_.count == 1) return out;
        const Vec origin = hull_.point(at_.corners[0]), to = w_ - origin;
        const auto edge = [&](size_t i) -> Vec { return hull_.point(at_.corners[i]) - origin; };
        const Vec d = edge(1);
        if (at_.count == 2) {
            out[1] = to.dot(d) / d.squaredNorm();
        } else {
            const Vec e = edge(2), n = d.cross(e);
            if (at_.count == 3) {
                const double inverse = 1 / n.squaredNorm();
                out[1] = to.cross(e).dot(n) * inverse, out[2] = d.cross(to).dot(n) * inverse;
            } else {
                const Vec f = edge(3);
                const double inverse = 1 / n.dot(f);
                out[1] = to.cross(e).dot(f) * inverse, out[2] = d.cross(to).dot(f) * inverse;
                out[3] = n.dot(to) * inverse;
            }
        }
        out[0] = 1 - (out[1] + out[2] + out[3]);
        return out;
    }

    const HullDistance& hull_;
    const Vec& w_;
    Vec x_; // the combination
    Combination& at_;
};

} // namespace

Simplex::Simplex(const HullDistance& hull, const Combination& of) : origin_(hull.point(of.corners[0])) {
    for (size_t i = 1; i < of.count; ++i) edges_[i - 1] = hull.point(of.corners[i]) - origin_;
    const auto& [d, e, f] = edges_;
    const Vec n = d.cross(e);
    if (of.count == 2) {
        duals_[0] = d / d.squaredNorm();
    } else if (of.count == 3) {
        const double inverse = 1 / n.squaredNorm();
        duals_[0] = e.cross(n) * inverse, duals_[1] = n.cross(d) * inverse;
    } else if (of.count == 4) {
        const double inverse = 1 / n.dot(f);
        duals_[0] = e.cross(f) * inverse, duals_[1] = f.cross(d) * inverse, duals_[2] = n * inverse;
    }
}

void HullDistance::add(const Vec& point) {
    for (size_t k = 0; k < 3; ++k)
        std::fill(lanes_[k].begin() + static_cast<std::ptrdiff_t>(size_), lanes_[k].end(),
                  static_cast<float>(point[static_cast<int>(k)]));
    ++size_;
}

bool HullDistance::near_point(const Vec& w, double distance) const {
    constexpr double kRounding = 0x1p-20; // of floats here, more than enough
    const auto x = static_cast<float>(w.x()), y = static_cast<float>(w.y()), z = static_cast<float>(w.z());
    std::array<float, kHullPoints> squared;
    for (size_t i = 0; i < kHullPoints; ++i) {
        const float d = x - lanes_[0][i], e = y - lanes_[1][i], f = z - lanes_[2][i];
        squared[i] = (d * d + e * e) + f * f;
    }
    for (size_t half = kHullPoints / 2; half > 0; half /= 2)
        for (size_t i = 0; i < half; ++i) squared[i] = squared[half + i] < squared[i] ? squared[half + i] : squared[i];
    return std::sqrt(double{squared[0]}) + kRounding * w.lpNorm<1>() <= distance * (1 - kRounding);
}

size_t HullDistance::farthest(const Vec& direction) const {
    const auto x = static_cast<float>(direction.x()), y = static_cast<float>(direction.y()),
               z = static_cast<float>(direction.z());
    std::array<float, kHullPoints> height;
    for (size_t i = 0; i < kHullPoints; ++i) height[i] = (x * lanes_[0][i] + y * lanes_[1][i]) + z * lanes_[2][i];
    float most[4] = {height[0], height[1], height[2], height[3]};
    for (size_t i = 4; i < kHullPoints; i += 4)
        for (size_t k = 0; k < 4; ++k) most[k] = most[k] < height[i + k] ? height[i + k] : most[k];
    const float highest = std::max(std::max(most[0], most[1]), std::max(most[2], most[3]));
    size_t at = 0;
    while (at + 1 < size_ && height[at] != highest) ++at;
    return at;
}

double HullDistance::operator()(const Vec& w, double enough, Combination& nearest) const {
    const bool begun = nearest.count > 0;
    const double reached = NearestCombination(*this, w, nearest).improve_until(enough);
    if (reached <= enough || !begun) return reached;
    nearest.count = 0; // what it began with may have led astray
    return std::min(NearestCombination(*this, w, nearest).improve_until(enough), reached);
}

} // namespace prolate
