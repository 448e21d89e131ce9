// Plain value types of the public interface.
//
// Conventions, for the whole library:
//  - right-handed coordinates; any length unit, used consistently ("metres" below);
//  - a Pose first rotates, then translates: world = rotate(pose.rotation, local) + pose.translation;
//  - quaternions are stored x, y, z, w;
//  - all of these types are standard-layout, so that a C binding or a memcpy is safe.
// matrix.hpp, eigen.hpp and glm.hpp convert from and to others.
#pragma once

#include <array>
#include <cstdint>

namespace prolate {

/// Point or direction, metres.
struct Vec3 {
    float x = 0, y = 0, z = 0;
    friend bool operator==(const Vec3&, const Vec3&) = default;
};

using Triangle = std::array<uint32_t, 3>; ///< three vertex indices

/// Where a mesh stands in the frame of the file that it came from: mesh = scale * file - origin, axis by axis.
struct Placement {
    std::array<double, 3> scale = {1, 1, 1}; ///< finite, not 0; an odd number of negative ones mirrors
    std::array<double, 3> origin = {};       ///< finite, metres: the file's (scaled) point that is the mesh's (0, 0, 0)
    friend bool operator==(const Placement&, const Placement&) = default;
};

/// Rotation as a quaternion. Queries normalise it, so its length need not be exactly 1; it must not be 0.
struct Quat {
    float x = 0, y = 0, z = 0, w = 1;
    friend bool operator==(const Quat&, const Quat&) = default;
};

/// Rigid placement of a body: rotation, then translation (metres).
struct Pose {
    Vec3 translation;
    Quat rotation;
    friend bool operator==(const Pose&, const Pose&) = default;
};

/// The solid ellipsoid {center + L u : |u| <= 1} with the lower-triangular factor
///
///         | l11  0    0   |
///     L = | l21  l22  0   |      shape matrix Q = L transpose(L), support h(n) = n.center + |transpose(L) n|
///         | l31  l32  l33 |
///
/// l11, l22, l33 > 0. A triangular factor needs no rotation matrix, decodes exactly from integers, and serves the
/// separation test as well as any other factor, because only |transpose(L) n| enters it.
struct Ellipsoid {
    Vec3 center;
    float l11 = 1, l21 = 0, l22 = 1, l31 = 0, l32 = 0, l33 = 1;
    friend bool operator==(const Ellipsoid&, const Ellipsoid&) = default;
};

/// Semi-axes of an ellipsoid, in double precision.
struct PrincipalAxes {
    double radii[3];       ///< metres, largest first
    double rotation[3][3]; ///< row-major, right-handed; column i is the unit direction of radii[i]
};

/// Principal axes of `e`, by the library's own Jacobi iteration: the same bits on every IEEE platform.
/// Thread-safe; never fails for an ellipsoid read from an opened tree.
PrincipalAxes principal_axes(const Ellipsoid& e) noexcept;
/// The same with radii enlarged, by little more than rounding, so that what a reader of the center and of these makes
/// of them in double precision holds the ellipsoid.
PrincipalAxes outer_axes(const Ellipsoid& e) noexcept;

/// Volume of `e`, cubic metres.
double volume(const Ellipsoid& e) noexcept;

/// Squared radial coordinate |L^-1 (p - center)|^2: at most 1 inside, above 1 outside. `p` holds three doubles.
double radial_squared(const Ellipsoid& e, const double p[3]) noexcept;

} // namespace prolate
