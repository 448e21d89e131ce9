// Slow truth about two ellipsoids, in long double, by two methods that share nothing with query/separation.cpp.
//
//  1. contact(): maximises Perram and Wertheim's f(lambda) = lambda (1 - lambda) r^T Q(lambda)^-1 r by golden section
//     over log(lambda / (1 - lambda)), with a plain inverse. sqrt(f) is the factor by which both bodies must be scaled
//     about their centers to touch: below 1 they overlap, above 1 they are apart.
//  2. projected(): maps A to the unit ball and projects its center onto the image of B (Jacobi eigenvectors, secular
//     equation, bisection). Below 1 they overlap. It loses digits for two thin crossed needles, method 1 does not.
//
// Floats are exact input; poses are composed in long double.
#pragma once

#include <prolate/types.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace prolate::reference {

using Real = long double;
using Vector = std::array<Real, 3>;
using Matrix = std::array<Vector, 3>; // rows

inline Real dot(const Vector& a, const Vector& b) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
inline Vector operator*(const Matrix& m, const Vector& v) {
    return {dot(m[0], v), dot(m[1], v), dot(m[2], v)};
}
inline Vector operator-(const Vector& a, const Vector& b) {
    return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
inline Matrix transposed(const Matrix& m) {
    return {{{m[0][0], m[1][0], m[2][0]}, {m[0][1], m[1][1], m[2][1]}, {m[0][2], m[1][2], m[2][2]}}};
}
inline Matrix operator*(const Matrix& a, const Matrix& b) {
    const Matrix t = transposed(b);
    Matrix out;
    for (size_t i = 0; i < 3; ++i) out[i] = {dot(a[i], t[0]), dot(a[i], t[1]), dot(a[i], t[2])};
    return out;
}
inline Matrix rotation(const Quat& q) {
    const Real x = q.x, y = q.y, z = q.z, w = q.w, n = x * x + y * y + z * z + w * w;
    return {{{(x * x - y * y - z * z + w * w) / n, 2 * (x * y - z * w) / n, 2 * (x * z + y * w) / n},
             {2 * (x * y + z * w) / n, (-x * x + y * y - z * z + w * w) / n, 2 * (y * z - x * w) / n},
             {2 * (x * z - y * w) / n, 2 * (y * z + x * w) / n, (-x * x - y * y + z * z + w * w) / n}}};
}

/// Both bodies in world orientation, positions relative to A's origin.
struct Pair {
    Vector r;      // from A's center to B's
    Matrix l1, l2; // factors
    Matrix q1, q2; // shape matrices

    Pair(const Ellipsoid& a, const Pose& pose_a, const Ellipsoid& b, const Pose& pose_b) {
        const Matrix ra = rotation(pose_a.rotation), rb = rotation(pose_b.rotation);
        const auto vector = [](const Vec3& v) { return Vector{v.x, v.y, v.z}; };
        const auto factor = [](const Ellipsoid& e) {
            return Matrix{{{e.l11, 0, 0}, {e.l21, e.l22, 0}, {e.l31, e.l32, e.l33}}};
        };
        const Vector t = vector(pose_b.translation) - vector(pose_a.translation);
        const Vector ca = ra * vector(a.center), cb = rb * vector(b.center);
        r = {t[0] + cb[0] - ca[0], t[1] + cb[1] - ca[1], t[2] + cb[2] - ca[2]};
        l1 = ra * factor(a), l2 = rb * factor(b);
        q1 = l1 * transposed(l1), q2 = l2 * transposed(l2);
    }
};

inline Matrix inverse(const Matrix& m) {
    Matrix c;
    for (size_t i = 0; i < 3; ++i)
        for (size_t j = 0; j < 3; ++j) {
            const size_t i1 = (i + 1) % 3, i2 = (i + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
            c[j][i] = m[i1][j1] * m[i2][j2] - m[i1][j2] * m[i2][j1];
        }
    const Real det = m[0][0] * c[0][0] + m[0][1] * c[1][0] + m[0][2] * c[2][0];
    for (Vector& row : c)
        for (Real& x : row) x /= det;
    return c;
}

/// sqrt(max f): above 1 apart, below 1 overlapping; 0 for equal centers.
inline Real contact(const Pair& pair) {
    const auto f = [&](Real x) {
        const Real rho = std::exp(x), lambda = rho / (1 + rho), mu = 1 / (1 + rho);
        Matrix q;
        for (size_t i = 0; i < 3; ++i)
            for (size_t j = 0; j < 3; ++j) q[i][j] = mu * pair.q1[i][j] + lambda * pair.q2[i][j];
        return lambda * mu * dot(pair.r, inverse(q) * pair.r);
    };
    const Real golden = (std::sqrt(Real{5}) - 1) / 2;
    // The best rho lies between the extreme ratios of support widths.
    const auto extent = [](const Matrix& q) { return std::sqrt(q[0][0] + q[1][1] + q[2][2]); };
    const auto thinnest = [&](const Matrix& l) { // det / |L|^2 bounds the smallest radius from below
        const Real det = l[0][0] * (l[1][1] * l[2][2] - l[1][2] * l[2][1]) -
                         l[0][1] * (l[1][0] * l[2][2] - l[1][2] * l[2][0]) +
                         l[0][2] * (l[1][0] * l[2][1] - l[1][1] * l[2][0]);
        Real norm = 0;
        for (const Vector& row : l) norm += dot(row, row);
        return std::abs(det) / norm;
    };
    Real low = std::log(thinnest(pair.l1) / extent(pair.q2)), high = std::log(extent(pair.q1) / thinnest(pair.l2));
    Real a = high - golden * (high - low), b = low + golden * (high - low);
    Real fa = f(a), fb = f(b);
    while (high - low > 1e-7L) { // f is flat at its maximum: an error of 1e-14, relative
        if (fa < fb) {
            low = a, a = b, fa = fb;
            b = low + golden * (high - low), fb = f(b);
        } else {
            high = b, b = a, fb = fa;
            a = high - golden * (high - low), fa = f(a);
        }
    }
    return std::sqrt(std::max(fa, fb));
}

/// Eigenvalues and eigenvectors (columns) of a symmetric matrix, by cyclic Jacobi.
inline std::pair<Vector, Matrix> eigen(Matrix a) {
    Matrix v{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
    for (int sweep = 0; sweep < 40; ++sweep)
        for (size_t p = 0; p < 3; ++p)
            for (size_t q = p + 1; q < 3; ++q) {
                if (a[p][q] == 0) continue;
                const Real theta = std::atan2(2 * a[p][q], a[q][q] - a[p][p]) / 2;
                const Real c = std::cos(theta), s = std::sin(theta);
                Matrix j{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
                j[p][p] = j[q][q] = c, j[p][q] = s, j[q][p] = -s;
                a = transposed(j) * a * j;
                v = v * j;
                a[p][q] = a[q][p] = 0;
            }
    return {{a[0][0], a[1][1], a[2][2]}, v};
}

/// Distance from A's center to B where A is the unit ball: above 1 apart, below 1 overlapping; 0 if inside B.
inline Real projected(const Pair& pair) {
    const Matrix to_ball = inverse(pair.l1);
    const Vector center = to_ball * pair.r;
    const Matrix l = to_ball * pair.l2;
    const auto image = eigen(l * transposed(l));        // of B
    const Vector& squares = image.first;                // semi-axes, squared
    const Vector y = transposed(image.second) * center; // A's center seen from B's, up to sign
    const auto excess = [&](Real t) {                   // nearest point x_i = s_i y_i / (s_i + t), on B's border
        Real sum = -1;
        for (size_t i = 0; i < 3; ++i) sum += squares[i] * y[i] * y[i] / ((squares[i] + t) * (squares[i] + t));
        return sum;
    };
    if (!(excess(0) > 0)) return 0;
    Real low = 0, high = 1;
    while (excess(high) > 0) low = high, high *= 4;
    for (int i = 0; i < 120; ++i) {
        const Real middle = (low + high) / 2;
        (excess(middle) > 0 ? low : high) = middle;
    }
    Real sum = 0;
    for (size_t i = 0; i < 3; ++i) {
        const Real gap = y[i] * low / (squares[i] + low); // y - x
        sum += gap * gap;
    }
    return std::sqrt(sum);
}

} // namespace prolate::reference
