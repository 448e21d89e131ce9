// Geometry of a single ellipsoid {c + L u}, in double precision.
#include <prolate/types.hpp>

#include "src/symmetric3.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace prolate {

PrincipalAxes principal_axes(const Ellipsoid& e) noexcept {
    const double l[3][3] = {{e.l11, 0, 0}, {e.l21, e.l22, 0}, {e.l31, e.l32, e.l33}};
    Matrix3 q{}; // Q = L L^T
    for (size_t i = 0; i < 3; ++i)
        for (size_t j = 0; j < 3; ++j)
            for (size_t k = 0; k < 3; ++k) q[i][j] += l[i][k] * l[j][k];
    const Eigen3x3 eigen = eigen_symmetric(q);
    PrincipalAxes out{};
    for (size_t i = 0; i < 3; ++i) {
        // |L^T v|, not the square root of the eigenvalue: Q has lost half of a thin axis' digits, and its eigenvalue
        // may even come out negative.
        double square = 0;
        for (size_t k = 0; k < 3; ++k) {
            const double component =
                l[0][k] * eigen.vectors[0][i] + l[1][k] * eigen.vectors[1][i] + l[2][k] * eigen.vectors[2][i];
            square += component * component;
        }
        out.radii[i] = i == 0 ? std::sqrt(square) : std::min(std::sqrt(square), out.radii[i - 1]);
        for (size_t j = 0; j < 3; ++j) out.rotation[i][j] = eigen.vectors[i][j];
    }
    return out;
}

// G = diag(1/r) R^T L maps the unit ball to where the ellipsoid is in the unit ball of what is read, and
// |G|^2 <= 1 + |G^T G - 1|. Rounding, here and at the reader's, costs less than 2^-46 r1 / r3.
PrincipalAxes outer_axes(const Ellipsoid& e) noexcept {
    PrincipalAxes axes = principal_axes(e);
    const double l[3][3] = {{e.l11, 0, 0}, {e.l21, e.l22, 0}, {e.l31, e.l32, e.l33}};
    double g[3][3] = {}, square = 0;
    for (size_t i = 0; i < 3; ++i)
        for (size_t j = 0; j < 3; ++j)
            for (size_t k = 0; k < 3; ++k) g[i][j] += axes.rotation[k][i] * l[k][j] / axes.radii[i];
    for (size_t i = 0; i < 3; ++i)
        for (size_t j = 0; j < 3; ++j) {
            const double entry = g[0][i] * g[0][j] + g[1][i] * g[1][j] + g[2][i] * g[2][j] - (i == j ? 1 : 0);
            square += entry * entry;
        }
    const double growth = 1 + std::sqrt(square) + 0x1p-46 * axes.radii[0] / axes.radii[2];
    for (double& radius : axes.radii) radius *= growth;
    return axes;
}

double volume(const Ellipsoid& e) noexcept {
    return 4.0 / 3.0 * std::numbers::pi * double{e.l11} * double{e.l22} * double{e.l33};
}

double radial_squared(const Ellipsoid& e, const double p[3]) noexcept {
    // Forward substitution of L y = p - c.
    const double y1 = (p[0] - e.center.x) / e.l11;
    const double y2 = (p[1] - e.center.y - e.l21 * y1) / e.l22;
    const double y3 = (p[2] - e.center.z - e.l31 * y1 - e.l32 * y2) / e.l33;
    return y1 * y1 + y2 * y2 + y3 * y3;
}

} // namespace prolate
