// Symmetric 3x3 eigenproblem with a fixed order of operations.
//
// Cyclic Jacobi (Golub and Van Loan, Matrix Computations, section 8.5): unconditionally convergent, accurate for small
// eigenvalues, and made of +, -, *, / and sqrt only, so that every IEEE platform computes the same bits.
#pragma once

#include <array>
#include <cmath>
#include <utility>

namespace prolate {

using Matrix3 = std::array<std::array<double, 3>, 3>;

struct Eigen3x3 {
    std::array<double, 3> values; ///< largest first
    Matrix3 vectors;              ///< column i belongs to values[i]; right-handed
};

inline Eigen3x3 eigen_symmetric(Matrix3 a) {
    Matrix3 v{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
    constexpr int kPairs[3][2] = {{0, 1}, {0, 2}, {1, 2}};
    for (int sweep = 0; sweep < 32; ++sweep) {
        const double off = a[0][1] * a[0][1] + a[0][2] * a[0][2] + a[1][2] * a[1][2];
        const double diagonal = a[0][0] * a[0][0] + a[1][1] * a[1][1] + a[2][2] * a[2][2];
        if (!(off > 1e-36 * diagonal)) break;
        for (const auto& [p, q] : kPairs) {
            if (a[p][q] == 0) continue;
            const double theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
            const double t = (theta >= 0 ? 1.0 : -1.0) / (std::abs(theta) + std::sqrt(theta * theta + 1));
            const double c = 1 / std::sqrt(t * t + 1), s = t * c;
            for (int i = 0; i < 3; ++i) { // a <- a J
                const double x = a[i][p], y = a[i][q];
                a[i][p] = c * x - s * y, a[i][q] = s * x + c * y;
            }
            for (int i = 0; i < 3; ++i) { // a <- J^T a
                const double x = a[p][i], y = a[q][i];
                a[p][i] = c * x - s * y, a[q][i] = s * x + c * y;
            }
            for (int i = 0; i < 3; ++i) {
                const double x = v[i][p], y = v[i][q];
                v[i][p] = c * x - s * y, v[i][q] = s * x + c * y;
            }
        }
    }
    int order[3] = {0, 1, 2};
    const auto larger = [&](int i, int j) { return a[i][i] > a[j][j]; };
    if (larger(order[1], order[0])) std::swap(order[0], order[1]);
    if (larger(order[2], order[1])) std::swap(order[1], order[2]);
    if (larger(order[1], order[0])) std::swap(order[0], order[1]);
    Eigen3x3 out;
    for (int i = 0; i < 3; ++i) {
        out.values[i] = a[order[i]][order[i]];
        for (int r = 0; r < 3; ++r) out.vectors[r][i] = v[r][order[i]];
    }
    for (int r = 0; r < 3; ++r) { // third column = first x second: right-handed
        const int r1 = (r + 1) % 3, r2 = (r + 2) % 3;
        const auto& m = out.vectors;
        v[r][2] = m[r1][0] * m[r2][1] - m[r2][0] * m[r1][1];
    }
    for (int r = 0; r < 3; ++r) out.vectors[r][2] = v[r][2];
    return out;
}

} // namespace prolate
