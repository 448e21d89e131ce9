// The integral of a polynomial over the solid is the sum over the triangles of its integrals over the tetrahedra that
// they make with any one point, each with the sign of its volume. With o as the point, corners a, b, c relative to it,
// and d = det(a, b, c), those of 1, x_i and x_i x_j are
//     d / 6,    d / 24 s_i,    d / 120 (s_i s_j + a_i a_j + b_i b_j + c_i c_j),    s = a + b + c
// (F. Tonon, "Explicit Exact Formulas for the 3-D Tetrahedron Inertia Tensor in Terms of its Vertex Coordinates",
// Journal of Mathematics and Statistics 1(1), 2005). A sum counts each point as often as the mesh winds around it.
#include "builder/mass.hpp"

#include "builder/job.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace prolate {
namespace {

// A sum with the error of its rounding. Neumaier's compensated summation loses 2^-53 of the sum and a share of about
// n 2^-106 of the terms, less than the terms' own error here, which add() is told as a size: |error| <= kTerm * size.
class BoundedSum {
public:
    void add(double term, double size) {
        const double next = sum_ + term;
        lost_ += std::abs(sum_) >= std::abs(term) ? (sum_ - next) + term : (term - next) + sum_;
        sum_ = next;
        size_ += size;
    }
    // A term takes at most 20 roundings in a row, of numbers whose sizes add up to `size`; the rest is room for the
    // rounding of the sizes themselves and of the sum.
    Quadrature total() const {
        constexpr double kTerm = 64 * 0.5 * std::numeric_limits<double>::epsilon();
        return {sum_ + lost_, kTerm * size_};
    }

private:
    double sum_ = 0, lost_ = 0, size_ = 0;
};

// The integrals over the tetrahedron with corners 0, a, b, c and d / 120 for its volume / 20.
Monomials tetrahedron(const double (&p)[3][3], double twentieth) {
    const auto sum = [&](size_t i) { return p[0][i] + p[1][i] + p[2][i]; };
    const auto product = [&](size_t i, size_t j) {
        return twentieth * (sum(i) * sum(j) + p[0][i] * p[0][j] + p[1][i] * p[1][j] + p[2][i] * p[2][j]);
    };
    return {20 * twentieth, 5 * twentieth * sum(0), 5 * twentieth * sum(1), 5 * twentieth * sum(2), product(0, 0),
            product(1, 1),  product(2, 2),          product(0, 1),          product(0, 2),          product(1, 2)};
}

Moments integrals(MeshView mesh) {
    BoundedSum sums[kMonomials];
    const Vec o = to_vec(mesh.vertices[0]);
    Checkpoints checkpoints;
    for (const Triangle& t : mesh.triangles) {
        checkpoints();
        double p[3][3], size[3][3];
        for (size_t k = 0; k < 3; ++k) {
            const Vec corner = to_vec(mesh.vertices[t[k]]) - o;
            for (int i = 0; i < 3; ++i) p[k][i] = corner[i], size[k][i] = std::abs(corner[i]);
        }
        double determinant = 0, largest = 0; // the latter with all its terms positive
        for (size_t i = 0; i < 3; ++i) {
            const size_t j = (i + 1) % 3, k = (i + 2) % 3;
            determinant += p[0][i] * (p[1][j] * p[2][k] - p[1][k] * p[2][j]);
            largest += size[0][i] * (size[1][j] * size[2][k] + size[1][k] * size[2][j]);
        }
        const Monomials terms = tetrahedron(p, determinant / 120), sizes = tetrahedron(size, largest / 120);
        for (size_t m = 0; m < kMonomials; ++m) sums[m].add(terms[m], sizes[m]);
    }
    Moments out;
    for (size_t m = 0; m < kMonomials; ++m) out[m] = sums[m].total();
    return out;
}

// An upper bound of |m_i m_j / v| less its true value, where each is off by at most its error and v is positive.
double product_error(const Quadrature& a, const Quadrature& b, const Quadrature& v) {
    const double least = v.value - v.error;
    return (std::abs(a.value) * b.error + std::abs(b.value) * a.error + a.error * b.error) / least +
           std::abs(a.value) / v.value * std::abs(b.value) * v.error / least;
}

} // namespace

MassProperties mass_of(MeshView mesh, bool closed, const Columns& columns) {
    const Vec o = to_vec(mesh.vertices[0]);
    Moments m = closed ? integrals(mesh) : columns.moments(o);
    if (closed && columns.winding_defect() > 0) {
        const Moments excess = columns.excess(o);
        for (size_t k = 0; k < kMonomials; ++k) m[k].value -= excess[k].value, m[k].error += excess[k].error;
    }
    const Quadrature& v = m[0];
    MassProperties out;
    if (!(v.value > 2 * v.error)) return out;
    constexpr double kRounding = 16 * std::numeric_limits<double>::epsilon();
    out.volume = v.value;
    out.volume_error = v.error;
    for (size_t i = 0; i < 3; ++i) {
        const double arm = m[1 + i].value / v.value;
        out.center[i] = o[static_cast<int>(i)] + arm;
        const double error = (m[1 + i].error + std::abs(arm) * v.error) / (v.value - v.error);
        out.center_error = std::max(out.center_error, error + kRounding * (std::abs(arm) + std::abs(out.center[i])));
    }
    // Second moments about the centre: xx, yy, zz, xy, xz, yz.
    constexpr size_t kFirst[] = {0, 1, 2, 0, 0, 1}, kSecond[] = {0, 1, 2, 1, 2, 2};
    double moments[6], errors[6];
    for (size_t k = 0; k < 6; ++k) {
        const Quadrature &a = m[1 + kFirst[k]], &b = m[1 + kSecond[k]];
        const double shift = a.value / v.value * b.value;
        moments[k] = m[4 + k].value - shift;
        errors[k] = m[4 + k].error + product_error(a, b, v) + kRounding * (std::abs(m[4 + k].value) + std::abs(shift));
    }
    for (size_t i = 0; i < 3; ++i) {
        const size_t j = (i + 1) % 3, k = (i + 2) % 3;
        out.inertia[i] = moments[j] + moments[k];
        out.inertia[3 + i] = 0 - moments[3 + i]; // not -0
        out.inertia_error = std::max({out.inertia_error, errors[j] + errors[k], errors[3 + i]});
    }
    return out;
}

} // namespace prolate
