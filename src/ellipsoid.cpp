// Geometry of a single ellipsoid {c + L u}, in double precision.
#include <prolate/types.hpp>

#include "src/symmetric3.hpp"

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
        out.radii[i] = std::sqrt(eigen.values[i]);
        for (size_t j = 0; j < 3; ++j) out.rotation[i][j] = eigen.vectors[i][j];
    }
    return out;
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
