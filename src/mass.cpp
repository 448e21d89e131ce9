#include <prolate/mass.hpp>

#include "src/symmetric3.hpp"

#include <prolate/matrix.hpp>

#include <cmath>
#include <limits>

namespace prolate {
namespace {

Matrix3 tensor(const MassProperties& mass) {
    const auto& [xx, yy, zz, xy, xz, yz] = mass.inertia;
    return {{{xx, xy, xz}, {xy, yy, yz}, {xz, yz, zz}}};
}

Matrix3 product(const Matrix3& a, const Matrix3& b) {
    Matrix3 out{};
    for (size_t i = 0; i < 3; ++i)
        for (size_t j = 0; j < 3; ++j)
            for (size_t k = 0; k < 3; ++k) out[i][j] += a[i][k] * b[k][j];
    return out;
}

Matrix3 transposed(const Matrix3& a) {
    Matrix3 out;
    for (size_t i = 0; i < 3; ++i)
        for (size_t j = 0; j < 3; ++j) out[i][j] = a[j][i];
    return out;
}

// Rounding of what is computed here from n terms, each as large as `size`: with room to spare.
double rounding(double size) {
    return 64 * std::numeric_limits<double>::epsilon() * size;
}

} // namespace

MassProperties scaled(const MassProperties& mass, double scale) noexcept {
    const double length = std::abs(scale), volume = length * length * length, inertia = volume * length * length;
    MassProperties out = mass;
    out.volume *= volume;
    out.volume_error = out.volume_error * volume + rounding(out.volume);
    double farthest = 0;
    for (double& coordinate : out.center) farthest = std::max(farthest, std::abs(coordinate *= scale));
    out.center_error = out.center_error * length + rounding(farthest);
    for (double& entry : out.inertia) entry *= inertia; // even in the coordinates: mirroring changes no sign
    out.inertia_error = out.inertia_error * inertia + rounding(out.inertia[0] + out.inertia[1] + out.inertia[2]);
    return out;
}

MassProperties placed(const MassProperties& mass, const Pose& pose) noexcept {
    const Matrix4 m = to_matrix(pose);
    Matrix3 rotation;
    MassProperties out = mass;
    double reach = 0;
    for (size_t i = 0; i < 3; ++i) {
        out.center[i] = m.m[i][3];
        for (size_t j = 0; j < 3; ++j) {
            rotation[i][j] = m.m[i][j];
            out.center[i] += m.m[i][j] * mass.center[j];
        }
        reach += std::abs(mass.center[i]) + std::abs(m.m[i][3]);
    }
    const Matrix3 turned = product(product(rotation, tensor(mass)), transposed(rotation));
    out.inertia = {turned[0][0], turned[1][1], turned[2][2], turned[0][1], turned[0][2], turned[1][2]};
    // An entry of R E R^T is a sum over the nine of E, with weights whose squares have the sum 1: at most 3.
    out.center_error = std::sqrt(3.0) * mass.center_error + rounding(reach);
    out.inertia_error = 3 * mass.inertia_error + rounding(mass.inertia[0] + mass.inertia[1] + mass.inertia[2]);
    return out;
}

PrincipalInertia principal_inertia(const MassProperties& mass) noexcept {
    const Eigen3x3 axes = eigen_symmetric(tensor(mass));
    Matrix4 frame{};
    for (size_t i = 0; i < 3; ++i) {
        for (size_t j = 0; j < 3; ++j) frame.m[i][j] = axes.vectors[i][j];
        frame.m[i][3] = mass.center[i];
    }
    frame.m[3][3] = 1;
    const auto pose = pose_from_matrix(frame);
    return {axes.values, pose ? *pose : Pose{}};
}

} // namespace prolate
