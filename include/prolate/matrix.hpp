// Poses as matrices, for hosts that keep transforms that way. eigen.hpp and glm.hpp convert to and from their
// libraries' matrix types by these functions.
#pragma once

#include <prolate/error.hpp>
#include <prolate/types.hpp>

#include <array>

namespace prolate {

/// A rigid transform of column vectors: world = m * (x, y, z, 1). m[row][column]; the upper left 3x3 is a rotation, the
/// last column the translation (metres), the last row (0, 0, 0, 1).
struct Matrix4 {
    double m[4][4];
};

/// How far pose_from_matrix() lets a matrix be from rigid: each entry of transpose(R) R - I, and of the last row.
inline constexpr double kRigidTolerance = 1e-4;

/// The matrix of `pose`, whose quaternion is normalised first. All entries are NaN if the pose is not finite or its
/// quaternion is zero. Thread-safe.
Matrix4 to_matrix(const Pose& pose) noexcept;

/// The unit quaternion x, y, z, w of a rotation matrix, m[row][column], to double precision. Thread-safe.
std::array<double, 4> quaternion_of(const double (&m)[3][3]) noexcept;

/// The pose of a rigid matrix, rounded to floats, with a unit quaternion. Points at distance d from the body's origin
/// are then off by at most about kRigidTolerance * d, and no more than rounding if the matrix is rigid.
///
/// Fails with bad_options, and `what` says why, for a matrix that scales, shears, mirrors or projects, has an entry
/// that is not finite, or a translation beyond the range of floats. A body cannot be scaled by its pose: bake it at the
/// size that it has (ImportOptions::scale). Thread-safe.
Result<Pose> pose_from_matrix(const Matrix4& matrix) noexcept;

} // namespace prolate
