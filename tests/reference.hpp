// Slow truth about two ellipsoids, in long double, by two methods that share nothing with
// query/ellipsoid/separation.cpp.
//
//  1. contact(): maximises Perram and Wertheim's f(lambda) = lambda (1 - lambda) r^T Q(lambda)^-1 r by golden section
//     over log(lambda / (1 - lambda)), with a plain inverse. sqrt(f) is the factor by which both bodies must be scaled
//     about their centers to touch: below 1 they overlap, above 1 they are apart.
//  2. projected(): maps A to the unit ball and projects its center onto the image of B (Jacobi eigenvectors, secular
//     equation, bisection). Below 1 they overlap. It loses digits for two thin crossed needles, method 1 does not.
//
// And about two triangles: distance(), by their features.
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
inline Vector operator+(const Vector& a, const Vector& b) {
    return {a[0] + b[0], a[1] + b[1], a[2] + b[2]};
}
inline Vector along(const Vector& p, Real t, const Vector& d) {
    return {p[0] + t * d[0], p[1] + t * d[1], p[2] + t * d[2]};
}
inline Vector vector(const Vec3& v) {
    return {v.x, v.y, v.z};
}
inline Real length(const Vector& v) {
    return std::sqrt(dot(v, v));
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

using Corners = std::array<Vector, 3>; // of a triangle

inline Vector cross(const Vector& a, const Vector& b) {
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

/// Distance of two triangles, 0 if they meet: the least over vertices and faces, edges and edges, unless an edge of one
/// pierces the other.
inline Real distance(const Corners& a, const Corners& b) {
    Real least = HUGE_VALL;
    const auto consider = [&](const Vector& d) { least = std::min(least, std::sqrt(dot(d, d))); };
    const auto along = [](const Vector& p, Real t, const Vector& d) {
        return Vector{p[0] + t * d[0], p[1] + t * d[1], p[2] + t * d[2]};
    };
    const auto point_to_segment = [&](const Vector& p, const Vector& q, const Vector& r) {
        const Vector e = r - q;
        const Real square = dot(e, e);
        const Real t = square > 0 ? std::clamp(dot(p - q, e) / square, Real{0}, Real{1}) : 0;
        consider(p - along(q, t, e));
    };
    const auto one_way = [&](const Corners& x, const Corners& y) { // corners and edges of x, face of y
        const Vector n = cross(y[1] - y[0], y[2] - y[0]);
        const Real square = dot(n, n);
        const auto side = [&](size_t edge, const Vector& p) {
            return dot(n, cross(y[(edge + 1) % 3] - y[edge], p - y[edge]));
        };
        for (size_t i = 0; i < 3; ++i) {
            for (size_t j = 0; j < 3; ++j) point_to_segment(x[i], y[j], y[(j + 1) % 3]);
            if (!(square > 0)) continue;
            const Real height = dot(n, x[i] - y[0]), next = dot(n, x[(i + 1) % 3] - y[0]);
            const auto over_face = [&](const Vector& p) {
                return side(0, p) >= 0 && side(1, p) >= 0 && side(2, p) >= 0;
            };
            if (over_face(x[i])) least = std::min(least, std::abs(height) / std::sqrt(square));
            if (height * next <= 0 && height != next &&
                over_face(along(x[i], height / (height - next), x[(i + 1) % 3] - x[i])))
                least = 0;
        }
    };
    one_way(a, b), one_way(b, a);
    for (size_t i = 0; i < 3; ++i)
        for (size_t j = 0; j < 3; ++j) { // where both closest points are within the edges
            const Vector d = a[(i + 1) % 3] - a[i], e = b[(j + 1) % 3] - b[j], r = a[i] - b[j];
            const Real dd = dot(d, d), ee = dot(e, e), de = dot(d, e), determinant = dd * ee - de * de;
            if (!(determinant > 0)) continue;
            const Real s = (de * dot(e, r) - dot(d, r) * ee) / determinant,
                       t = (dd * dot(e, r) - de * dot(d, r)) / determinant;
            if (s >= 0 && s <= 1 && t >= 0 && t <= 1) consider(along(a[i], s, d) - along(b[j], t, e));
        }
    return least;
}

/// Corners of a triangle of a body at `pose`, in world orientation, relative to `origin`.
inline Corners placed(const std::array<Vec3, 3>& triangle, const Pose& pose, const Vec3& origin) {
    const Matrix r = rotation(pose.rotation);
    const Vector t{Real{pose.translation.x} - origin.x, Real{pose.translation.y} - origin.y,
                   Real{pose.translation.z} - origin.z};
    Corners out;
    for (size_t i = 0; i < 3; ++i) {
        const Vector p = r * Vector{triangle[i].x, triangle[i].y, triangle[i].z};
        out[i] = {p[0] + t[0], p[1] + t[1], p[2] + t[2]};
    }
    return out;
}

/// Least radial coordinate |L^-1 (p - c)| of an ellipsoid at `pose` over a triangle placed as above: below 1 they meet.
inline Real radius(const Corners& triangle, const Ellipsoid& e, const Pose& pose, const Vec3& origin) {
    const Pair frame({}, {origin, {}}, e, pose);
    const Matrix to_ball = inverse(frame.l2);
    Corners y;
    for (size_t i = 0; i < 3; ++i) y[i] = to_ball * (triangle[i] - frame.r);
    return distance(y, Corners{}); // from a triangle that is one point
}

} // namespace prolate::reference
