#include "builder/fit.hpp"

#include "src/symmetric3.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace prolate {
namespace {

Eigen3x3 eigen_of(const Mat& q) {
    Matrix3 a;
    for (size_t i = 0; i < 3; ++i)
        for (size_t j = 0; j < 3; ++j) a[i][j] = q(int(i), int(j));
    return eigen_symmetric(a);
}

// Points in coordinates middle + axes x in which they fill the cube [-1, 1]^3, whatever their unit, place and attitude,
// and however thin they are: minimum volume is the same in all of them, but numbers of like size keep their digits.
struct Whitened {
    std::vector<Vec> points;
    Vec middle;
    Mat axes;
};

// The principal axes, as long as the points reach. Along each in which they are too thin for the axis ratio cap there
// is a pair of points more: a flat set has no minimum-volume ellipsoid of positive volume, and the cap would widen it
// anyway.
Whitened whitened(std::span<const Vec> points, double min_radius) {
    Vec mean = Vec::Zero();
    for (const Vec& p : points) mean += p;
    mean /= static_cast<double>(points.size());
    Mat covariance = Mat::Zero();
    for (const Vec& p : points) covariance += (p - mean) * (p - mean).transpose();
    const Eigen3x3 axes = eigen_of(covariance);
    double low[3], high[3], widest = min_radius;
    Vec axis[3];
    for (size_t a = 0; a < 3; ++a) {
        axis[a] = Vec(axes.vectors[0][a], axes.vectors[1][a], axes.vectors[2][a]);
        low[a] = HUGE_VAL, high[a] = -HUGE_VAL;
        for (const Vec& p : points) {
            const double height = axis[a].dot(p - mean);
            low[a] = std::min(low[a], height), high[a] = std::max(high[a], height);
        }
        widest = std::max(widest, 0.5 * (high[a] - low[a]));
    }
    Whitened out;
    const double thinnest = std::max(min_radius, widest / kMaxAxisRatio);
    out.middle = mean;
    for (size_t a = 0; a < 3; ++a) out.middle += 0.5 * (low[a] + high[a]) * axis[a];
    std::vector<Vec> more;
    Mat inverse;
    for (int a = 0; a < 3; ++a) {
        const auto i = static_cast<size_t>(a);
        const double half = 0.5 * (high[i] - low[i]), length = std::max(half, thinnest);
        out.axes.col(a) = length * axis[i];
        inverse.row(a) = axis[i].transpose() / length;
        if (half < thinnest) more.insert(more.end(), {Vec::Unit(a), -Vec::Unit(a)});
    }
    out.points.reserve(points.size() + more.size());
    for (const Vec& p : points) out.points.push_back(inverse * (p - out.middle));
    out.points.insert(out.points.end(), more.begin(), more.end());
    return out;
}

// Khachiyan's algorithm with away steps: weights of the points whose moments are those of the minimum-volume ellipsoid.
class Khachiyan {
public:
    explicit Khachiyan(std::span<const Vec> points)
        : lifted_(points.size()), weight_(points.size(), 0), kappa_(points.size()) {
        for (size_t i = 0; i < points.size(); ++i) lifted_[i] << points[i], 1;
        // From extreme points along a few directions (Kumar and Yildirim 2005): the weights stay sparse.
        constexpr size_t kDirections = 8, kFew = 8; // of few points, most are extreme
        if (points.size() <= kFew) std::fill(weight_.begin(), weight_.end(), 1.0);
        for (const Vec& d : sketch_directions().first(points.size() <= kFew ? 0 : kDirections)) {
            size_t low = 0, high = 0;
            double lowest = d.dot(points[0]), highest = lowest;
            for (size_t i = 1; i < points.size(); ++i) {
                const double height = d.dot(points[i]);
                if (height < lowest) low = i, lowest = height;
                if (height > highest) high = i, highest = height;
            }
            weight_[low] = weight_[high] = 1;
        }
        if (start()) return;
        std::fill(weight_.begin(), weight_.end(), 1.0); // they lie in a plane; all of the points do not
        start();
    }

    // The ellipsoid's center and shape matrix.
    std::pair<Vec, Mat> run(double tolerance) {
        for (int iteration = 0; iteration < 400; ++iteration)
            if (!improve(tolerance)) break;
        Vec mean = Vec::Zero();
        for (size_t i = 0; i < lifted_.size(); ++i) mean += weight_[i] * lifted_[i].head<3>();
        Mat q = Mat::Zero();
        for (size_t i = 0; i < lifted_.size(); ++i) {
            const Vec d = lifted_[i].head<3>() - mean;
            q += 3 * weight_[i] * d * d.transpose();
        }
        return {mean, q};
    }

private:
    static constexpr double kDimension = 4; // of the lifted points (x, 1)

    // Equal weights for the points that have one. False if their moments are singular.
    bool start() {
        const auto count = std::count_if(weight_.begin(), weight_.end(), [](double w) { return w > 0; });
        Eigen::Matrix4d moment = Eigen::Matrix4d::Zero();
        for (size_t i = 0; i < lifted_.size(); ++i)
            if (weight_[i] > 0) {
                weight_[i] = 1 / static_cast<double>(count);
                moment += weight_[i] * lifted_[i] * lifted_[i].transpose();
            }
        // Thin starts are legal; a trace of the identity keeps the inverse finite and dies out with the steps.
        inverse_ = (moment + 1e-9 * Eigen::Matrix4d::Identity()).inverse();
        double sum = 0; // of the weighted kappas: the trace of the unit matrix, unless the moments are singular
        for (size_t i = 0; i < lifted_.size(); ++i) {
            kappa_[i] = lifted_[i].dot(inverse_ * lifted_[i]);
            sum += weight_[i] * kappa_[i];
        }
        return std::abs(sum - kDimension) < 0.1;
    }

    // One step, towards the farthest point or away from the nearest one; false if they are as good as on the border.
    bool improve(double tolerance) {
        const size_t n = lifted_.size();
        size_t far = 0, near = n;
        for (size_t i = 0; i < n; ++i) {
            if (kappa_[i] > kappa_[far]) far = i;
            if (weight_[i] > 0 && (near == n || kappa_[i] < kappa_[near])) near = i;
        }
        const double excess = kappa_[far] / kDimension - 1, slack = 1 - kappa_[near] / kDimension;
        if (excess <= 2 * tolerance && slack <= 4 * tolerance) return false;
        if (excess >= slack) {
            move_to(far, (kappa_[far] - kDimension) / (kDimension * (kappa_[far] - 1)));
            return true;
        }
        const double w = weight_[near], k = kappa_[near];
        const double full = w < 1 ? w / (1 - w) : HUGE_VAL; // drops the point
        const double best = k > 1 ? (kDimension - k) / (kDimension * (k - 1)) : HUGE_VAL;
        move_to(near, -std::min(full, best));
        return true;
    }

    // Weights <- (1 - beta) weights + beta e_j.
    void move_to(size_t j, double beta) {
        // Sherman-Morrison for ((1 - beta) M + beta q q^T)^-1.
        const Eigen::Vector4d v = inverse_ * lifted_[j];
        const double ratio = beta / (1 - beta), damping = ratio / (1 + ratio * kappa_[j]);
        for (size_t i = 0; i < lifted_.size(); ++i) {
            const double dot = lifted_[i].dot(v);
            kappa_[i] = (kappa_[i] - damping * dot * dot) / (1 - beta);
        }
        inverse_ = (inverse_ - damping * v * v.transpose()) / (1 - beta);
        for (double& w : weight_) w *= 1 - beta;
        weight_[j] += beta;
        if (weight_[j] < 1e-12) weight_[j] = 0;
    }

    std::vector<Eigen::Vector4d> lifted_;
    std::vector<double> weight_;
    std::vector<double> kappa_; // lifted^T inverse lifted: 4 on the boundary of the optimum, less inside
    Eigen::Matrix4d inverse_;   // of the weighted points' moments
};

} // namespace

Mat cholesky(const Mat& q) {
    Mat l = Mat::Zero();
    l(0, 0) = std::sqrt(q(0, 0));
    l(1, 0) = q(1, 0) / l(0, 0);
    l(2, 0) = q(2, 0) / l(0, 0);
    l(1, 1) = std::sqrt(q(1, 1) - l(1, 0) * l(1, 0));
    l(2, 1) = (q(2, 1) - l(2, 0) * l(1, 0)) / l(1, 1);
    l(2, 2) = std::sqrt(q(2, 2) - l(2, 0) * l(2, 0) - l(2, 1) * l(2, 1));
    return l;
}

Fit::Fit(const Vec& c, const Mat& lower) : center(c), factor(lower) {
    inverse = Mat::Zero();
    inverse(0, 0) = 1 / lower(0, 0);
    inverse(1, 1) = 1 / lower(1, 1);
    inverse(2, 2) = 1 / lower(2, 2);
    inverse(1, 0) = -lower(1, 0) * inverse(0, 0) * inverse(1, 1);
    inverse(2, 1) = -lower(2, 1) * inverse(1, 1) * inverse(2, 2);
    inverse(2, 0) = -(lower(2, 0) * inverse(0, 0) + lower(2, 1) * inverse(1, 0)) * inverse(2, 2);
}

Fit::Fit(const Ellipsoid& e)
    : Fit(to_vec(e.center), (Mat() << e.l11, 0, 0, e.l21, e.l22, 0, e.l31, e.l32, e.l33).finished()) {}

Ellipsoid Fit::ellipsoid() const {
    const auto f = [](double x) { return static_cast<float>(x); };
    return {{f(center.x()), f(center.y()), f(center.z())},
            f(factor(0, 0)),
            f(factor(1, 0)),
            f(factor(1, 1)),
            f(factor(2, 0)),
            f(factor(2, 1)),
            f(factor(2, 2))};
}

double Fit::volume() const {
    return 4.0 / 3.0 * std::numbers::pi * factor(0, 0) * factor(1, 1) * factor(2, 2);
}

Fit Fit::scaled(double by) const {
    Fit out = *this;
    out.factor *= by;
    out.inverse /= by;
    return out;
}

double Fit::reach(std::span<const Vec> points) const {
    double largest = 0;
    for (const Vec& p : points) largest = std::max(largest, radial_squared(p));
    return std::sqrt(largest);
}

namespace {

// Frobenius norms bound the ratio from above, within a factor 3, without an eigenproblem.
bool plainly_within_caps(const Fit& fit, double min_radius, double max_ratio) {
    const double inverse = fit.inverse.norm();
    return fit.factor.norm() * inverse <= max_ratio && inverse * min_radius <= 1;
}

} // namespace

Fit capped(const Vec& center, const Mat& q, double min_radius, double max_ratio) {
    if (Fit fit(center, cholesky(q)); plainly_within_caps(fit, min_radius, max_ratio)) return fit;
    const Eigen3x3 axes = eigen_of(q);
    double radii[3];
    for (size_t i = 0; i < 3; ++i) radii[i] = std::sqrt(std::max(axes.values[i], 0.0));
    const double floor = std::max(min_radius, radii[0] / max_ratio);
    if (radii[2] >= floor) return {center, cholesky(q)};
    Mat widened = Mat::Zero();
    for (size_t i = 0; i < 3; ++i) {
        const Vec axis(axes.vectors[0][i], axes.vectors[1][i], axes.vectors[2][i]);
        const double radius = std::max(radii[i], floor);
        widened += radius * radius * axis * axis.transpose();
    }
    return {center, cholesky(widened)};
}

bool within_caps(const Fit& fit, double min_radius, double max_ratio) {
    if (plainly_within_caps(fit, min_radius, max_ratio)) return true;
    const Eigen3x3 axes = eigen_of(fit.factor * fit.factor.transpose());
    const double thinnest = axes.values[2] * (1 + 1e-6); // capped() itself gets there only up to rounding
    return thinnest * max_ratio * max_ratio >= axes.values[0] && thinnest >= min_radius * min_radius;
}

Fit enclosing_ellipsoid(std::span<const Vec> input, double min_radius, double tolerance) {
    const auto [points, middle, axes] = whitened(input, min_radius);
    const auto [mean, q] = Khachiyan(points).run(tolerance);
    const Fit fit = capped(middle + axes * mean, axes * q * axes.transpose(), min_radius, kMaxAxisRatio);
    double reach = fit.reach(input);
    for (const Vec& p : points) reach = std::max(reach, fit.radial(middle + axes * p).norm());
    return fit.scaled(std::max(reach, 1e-3));
}

std::span<const Vec> sketch_directions() {
    // A Fibonacci lattice on the sphere (Gonzalez 2010), shuffled by a stride so that any first few are spread out too.
    static const std::vector<Vec> directions = [] {
        constexpr int kCount = 48, kStride = 11;
        std::vector<Vec> out;
        for (int s = 0; s < kCount; ++s) {
            const int i = s * kStride % kCount;
            const double z = 1 - (2 * i + 1.0) / kCount, r = std::sqrt(1 - z * z);
            const double turn = i * (3 - std::sqrt(5.0)) * std::numbers::pi;
            out.emplace_back(r * std::cos(turn), r * std::sin(turn), z);
        }
        return out;
    }();
    return directions;
}

void Sketch::add(std::span<const Vec> points) {
    if (points.empty()) return;
    const auto directions = sketch_directions();
    if (points_.empty()) {
        points_.assign(directions.size(), points[0]);
        heights_.assign(directions.size(), -HUGE_VAL);
    }
    for (size_t d = 0; d < directions.size(); ++d)
        for (const Vec& p : points)
            if (const double height = directions[d].dot(p); height > heights_[d]) heights_[d] = height, points_[d] = p;
}

void Sketch::add(const Sketch& other) {
    if (points_.empty()) {
        *this = other;
        return;
    }
    for (size_t d = 0; d < other.points_.size(); ++d)
        if (other.heights_[d] > heights_[d]) heights_[d] = other.heights_[d], points_[d] = other.points_[d];
}

} // namespace prolate
