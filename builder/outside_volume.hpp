// The error metrics of the paper's section 3 on the voxel grid: E_vol (eqs. 2, 5), E_sur (eq. 1) and their sum (eq. 3).
//
// Eq. 5 counts voxels whose centers are inside the ellipsoid and outside the solid. Here a voxel carries the exact
// share that is solid, and the ellipsoid is exact along z, so that small ellipsoids see a smooth error too.
#pragma once

#include "builder/fit.hpp"
#include "builder/voxels.hpp"

#include <algorithm>
#include <cmath>
#include <span>

namespace prolate {

/// E = alpha E_sur^3 + beta E_vol (paper, eq. 3).
struct HybridError {
    double alpha, beta;
    double operator()(double surface_error, double outside_volume) const {
        return alpha * surface_error * surface_error * surface_error + beta * outside_volume;
    }
};

/// Visits the rows of the grid (and its continuation beyond the border) that `fit` meets: visit(i, j, z0, z1, area)
/// with cell indices i, j - possibly out of range -, the row's ends in cells from the grid's floor, and its
/// cross-section in cells. `divide` x `divide` rows go through each cell's footprint, evenly; 0 chooses so many that a
/// small ellipsoid still meets about a hundred.
template <class Visit> void for_each_row(const Fit& fit, const Voxels& voxels, Visit&& visit, int divide = 0) {
    const Vec half = fit.half_extents() / voxels.pitch(), center = (fit.center - voxels.origin()) / voxels.pitch();
    const Mat inverse = fit.inverse * voxels.pitch();
    if (divide == 0) divide = std::clamp(static_cast<int>(std::ceil(5 / std::min(half.x(), half.y()))), 1, 16);
    const double step = 1.0 / divide, area = step * step;
    const Vec u = inverse.col(2);
    const double uu = u.squaredNorm();
    const auto first = [&](double low) { return static_cast<long>(std::ceil(low * divide - 0.5)); };
    for (long a = first(center.x() - half.x()); a < first(center.x() + half.x()); ++a) {
        const double x = (static_cast<double>(a) + 0.5) * step;
        const Vec wx = inverse.col(0) * (x - center.x());
        for (long b = first(center.y() - half.y()); b < first(center.y() + half.y()); ++b) {
            const double y = (static_cast<double>(b) + 0.5) * step;
            const Vec w = wx + inverse.col(1) * (y - center.y());
            const double uw = u.dot(w), discriminant = uw * uw - uu * (w.squaredNorm() - 1);
            if (discriminant <= 0) continue;
            const double root = std::sqrt(discriminant);
            visit(static_cast<int>(std::floor(x)), static_cast<int>(std::floor(y)), center.z() + (-uw - root) / uu,
                  center.z() + (-uw + root) / uu, area);
        }
    }
}

/// E_vol: volume of `fit` outside the solid.
double outside_volume(const Fit& fit, const Voxels& voxels);

/// Radial distance |p - d_o(p)| between a point and its radial projection onto the ellipsoid (paper, eq. 1).
double radial_distance(const Fit& fit, const Vec& p);

/// E_sur over the surface samples of `cells`.
double surface_error(const Fit& fit, const Voxels& voxels, std::span<const uint32_t> cells);

} // namespace prolate
