// Symmetric 3x3 matrices in double precision, as the ellipsoid tests need them.
#pragma once

#include <glm/mat3x3.hpp>

namespace prolate::query {

inline double trace(const glm::dmat3& m) {
    return m[0][0] + m[1][1] + m[2][2];
}

/// adj(Q) Q = det(Q) I.
inline glm::dmat3 adjugate(const glm::dmat3& q) {
    const double a = q[1][1] * q[2][2] - q[1][2] * q[1][2];
    const double b = q[0][2] * q[1][2] - q[0][1] * q[2][2];
    const double c = q[0][1] * q[1][2] - q[0][2] * q[1][1];
    const double d = q[0][0] * q[2][2] - q[0][2] * q[0][2];
    const double e = q[0][1] * q[0][2] - q[0][0] * q[1][2];
    const double f = q[0][0] * q[1][1] - q[0][1] * q[0][1];
    return {{a, b, c}, {b, d, e}, {c, e, f}};
}

} // namespace prolate::query
