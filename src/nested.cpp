// Where the outer ellipsoid is the unit ball, the inner one is {d + M u : |u| <= 1}. With the eigenvalues m of M^T M,
// and b = M^T d in their axes, for any l above the largest m
//     |d + M u|^2 <= |d|^2 + l + sum of b_i^2 / (l - m_i)    for all |u| <= 1,
// and the least such bound is the truth (the S-lemma; Boyd and Vandenberghe 2004, appendix B). Its derivative by l,
// 1 - sum of (b_i / (l - m_i))^2, grows: bisection.
//
// Rounding. u = 2^-53, c = |L| |L^-1| of the outer ellipsoid. Forward substitution solves a system that is wrong by 4 u
// |L| (Higham, Accuracy and Stability, section 8.1), so d and M are wrong by 4 u c of themselves, and a radial
// coordinate by 4 u c (|d| + |M|) <= 12 u c times the largest. Eigenvalues and b add some 30 u, and where the
// derivative is not negative, an m that is wrong by e moves the bound by no more than e. 2^-46 (c + 4), 128 u, is
// added.
#include "src/nested.hpp"

#include "src/symmetric3.hpp"

#include <algorithm>
#include <cmath>

namespace prolate {
namespace {

constexpr int kBisections = 40;

} // namespace

Outer::Outer(const Ellipsoid& e) noexcept
    : center_{e.center.x, e.center.y, e.center.z}, diagonal_{e.l11, e.l22, e.l33}, l21_(e.l21), l31_(e.l31),
      l32_(e.l32) {
    double square = l21_ * l21_ + l31_ * l31_ + l32_ * l32_, inverse = 0;
    for (const double x : diagonal_) square += x * x;
    for (size_t i = 0; i < 3; ++i) {
        double column[3] = {};
        column[i] = 1;
        to_ball(column);
        for (const double x : column) inverse += x * x;
    }
    rounding_ = 0x1p-46 * (std::sqrt(square) * std::sqrt(inverse) + 4);
}

void Outer::to_ball(double (&v)[3]) const noexcept {
    v[0] /= diagonal_[0];
    v[1] = (v[1] - l21_ * v[0]) / diagonal_[1];
    v[2] = (v[2] - l31_ * v[0] - l32_ * v[1]) / diagonal_[2];
}

double Outer::growth_to_hold(const Ellipsoid& inner) const noexcept {
    double d[3] = {inner.center.x - center_[0], inner.center.y - center_[1], inner.center.z - center_[2]};
    double m[3][3] = {{inner.l11, inner.l21, inner.l31}, {0, inner.l22, inner.l32}, {0, 0, inner.l33}}; // columns
    to_ball(d);
    for (auto& column : m) to_ball(column);
    const auto dot = [](const double(&x)[3], const double(&y)[3]) { return x[0] * y[0] + x[1] * y[1] + x[2] * y[2]; };
    Matrix3 a;
    for (size_t i = 0; i < 3; ++i)
        for (size_t j = 0; j < 3; ++j) a[i][j] = dot(m[i], m[j]);
    const Eigen3x3 axes = eigen_symmetric(a);
    double b[3] = {}, most = 0;
    for (size_t i = 0; i < 3; ++i) {
        for (size_t k = 0; k < 3; ++k) b[i] += axes.vectors[k][i] * dot(m[k], d);
        most += std::abs(b[i]);
    }
    double low = axes.values[0], high = low + most; // there the derivative is not negative
    for (int i = 0; i < kBisections && high > low; ++i) {
        const double middle = 0.5 * (low + high);
        double slope = 1;
        for (size_t k = 0; k < 3; ++k) {
            const double term = b[k] / (middle - axes.values[k]);
            slope -= term * term;
        }
        (slope >= 0 ? high : low) = middle; // a NaN is too low, too
    }
    double bound = dot(d, d) + high;
    for (size_t k = 0; k < 3; ++k)
        if (b[k] != 0) bound += b[k] * (b[k] / (high - axes.values[k]));
    return std::sqrt(bound) * (1 + rounding_);
}

} // namespace prolate
