#include "builder/outside_volume.hpp"

namespace prolate {

double outside_volume(const Fit& fit, const Voxels& voxels) {
    double outside = 0;
    const auto& size = voxels.size();
    for_each_row(fit, voxels, [&](int i, int j, double z0, double z1, double area) {
        outside += area * (z1 - z0);
        if (i >= 0 && j >= 0 && i < size[0] && j < size[1])
            outside -= area * (voxels.solid_below(i, j, z1) - voxels.solid_below(i, j, z0));
    });
    return std::max(outside, 0.0) * voxels.pitch() * voxels.pitch() * voxels.pitch();
}

double radial_distance(const Fit& fit, const Vec& p) {
    const double radial = std::sqrt(fit.radial_squared(p));
    // At the center every direction is radial; the longest is the conservative one.
    if (radial < 1e-9) return fit.factor.norm();
    return (p - fit.center).norm() * std::abs(1 / radial - 1);
}

double surface_error(const Fit& fit, const Voxels& voxels, std::span<const uint32_t> cells) {
    double largest = 0;
    for (const uint32_t cell : cells)
        for (const Vec& p : voxels.samples(cell)) largest = std::max(largest, radial_distance(fit, p));
    return largest;
}

} // namespace prolate
