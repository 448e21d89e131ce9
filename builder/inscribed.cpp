// maximise log det B subject to |B n_i| + n_i . d <= h_i, for {d + B u : |u| <= 1} with B symmetric: convex (S. Boyd,
// L. Vandenberghe, "Convex Optimization", 2004, section 8.4.2). Solved by Newton's method on the barrier function
//     F = -log det B - mu sum of log s_i,   s_i = h_i - n_i . d - |B n_i|,
// while mu falls: nine unknowns, or four for a ball, B = r I. At the end of mu, log det B is at most mu times the
// number of planes that matter below its maximum.
#include "builder/inscribed.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include <array>
#include <cmath>
#include <vector>

namespace prolate {
namespace {

constexpr double kStart = 0.85; // of the unit ball
constexpr double kBarriers[] = {0.5, 0.1, 0.02, 0.004};
constexpr int kSteps = 8;       // of Newton's method for each
constexpr double kSmall = 1e-3; // a decrement that ends it
constexpr int kHalvings = 30;   // of a step

// The symmetric matrices E_a of which B is made.
template <int kShapes> std::array<Mat, kShapes> basis_of() {
    std::array<Mat, kShapes> out;
    if constexpr (kShapes == 1) {
        out[0] = Mat::Identity();
    } else {
        size_t a = 0;
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j <= i; ++j) {
                out[a] = Mat::Zero();
                out[a](i, j) = out[a](j, i) = 1;
                ++a;
            }
    }
    return out;
}

// kShapes: 6, or of a ball 1.
template <int kShapes> class Barrier {
    static constexpr int kUnknowns = kShapes + 3; // those of B, and d
    using Unknowns = Eigen::Matrix<double, kUnknowns, 1>;
    using Square = Eigen::Matrix<double, kUnknowns, kUnknowns>;
    using Rows = Eigen::Matrix<double, 3, kUnknowns>;

public:
    Barrier(std::span<const Obstacle> planes, double most) : planes_(planes.begin(), planes.end()) {
        for (int k = 0; k < 3; ++k)
            for (const double sign : {1.0, -1.0}) planes_.push_back({sign * Vec::Unit(k), most});
    }

    Fit solve() {
        Unknowns x = Unknowns::Zero();
        x[0] = kStart;
        if constexpr (kShapes > 1) x[2] = x[5] = kStart; // the diagonal: 00, 11, 22
        for (const double mu : kBarriers)
            for (int step = 0; step < kSteps; ++step)
                if (!descend(x, mu)) break;
        const Mat b = shape(x);
        return Fit(center(x), cholesky(b * b));
    }

private:
    Mat shape(const Unknowns& x) const {
        Mat b = Mat::Zero();
        for (int a = 0; a < kShapes; ++a) b += x[a] * basis_[static_cast<size_t>(a)];
        return b;
    }
    static Vec center(const Unknowns& x) { return x.template tail<3>(); }

    // F, or infinite outside.
    double value(const Unknowns& x, double mu) const {
        const Mat b = shape(x);
        const Eigen::LLT<Mat> factor(b);
        if (factor.info() != Eigen::Success) return HUGE_VAL;
        double sum = 0;
        for (int k = 0; k < 3; ++k) sum -= 2 * std::log(factor.matrixL()(k, k));
        for (const Obstacle& o : planes_) {
            const double s = o.height - o.normal.dot(center(x)) - (b * o.normal).norm();
            if (!(s > 0)) return HUGE_VAL;
            sum -= mu * std::log(s);
        }
        return sum;
    }

    // One step of Newton's method. False if it is of no use any more.
    bool descend(Unknowns& x, double mu) const {
        const Mat b = shape(x), inverse = b.inverse();
        Unknowns gradient = Unknowns::Zero();
        Square hessian = Square::Zero();
        for (int a = 0; a < kShapes; ++a) {
            const Mat along = inverse * basis_[static_cast<size_t>(a)];
            gradient[a] -= along.trace();
            for (int c = 0; c <= a; ++c)
                hessian(a, c) += (along * inverse * basis_[static_cast<size_t>(c)]).trace(),
                    hessian(c, a) = hessian(a, c);
        }
        for (const Obstacle& o : planes_) {
            Rows rows = Rows::Zero(); // of B n
            for (int a = 0; a < kShapes; ++a) rows.col(a) = basis_[static_cast<size_t>(a)] * o.normal;
            const Vec u = b * o.normal;
            const double length = u.norm(), s = o.height - o.normal.dot(center(x)) - length;
            const Unknowns of_length = rows.transpose() * (u / length);
            Unknowns g = of_length;
            g.template tail<3>() += o.normal;
            gradient += mu / s * g;
            hessian += mu / (s * s) * g * g.transpose();
            hessian += mu / (s * length) * (rows.transpose() * rows - of_length * of_length.transpose());
        }
        const Unknowns step = -hessian.ldlt().solve(gradient);
        const double decrement = -gradient.dot(step), before = value(x, mu);
        if (!(decrement > kSmall)) return false;
        double length = 1;
        for (int i = 0; i < kHalvings; ++i, length /= 2) {
            const Unknowns there = x + length * step;
            if (value(there, mu) <= before - 0.1 * length * decrement) {
                x = there;
                return true;
            }
        }
        return false;
    }

    std::vector<Obstacle> planes_;
    const std::array<Mat, kShapes> basis_ = basis_of<kShapes>();
};

} // namespace

Fit largest_inscribed(std::span<const Obstacle> planes, double most, bool ball) {
    return ball ? Barrier<1>(planes, most).solve() : Barrier<6>(planes, most).solve();
}

} // namespace prolate
