// Conversions to and from Eigen, inline, for programs that use it. All are thread-safe.
#pragma once

#include <prolate/matrix.hpp>
#include <prolate/types.hpp>

#include <Eigen/Geometry>

namespace prolate {

inline Eigen::Vector3f to_eigen(const Vec3& v) {
    return {v.x, v.y, v.z};
}
inline Vec3 from_eigen(const Eigen::Vector3f& v) {
    return {v.x(), v.y(), v.z()};
}

/// Component by component, without normalising.
inline Eigen::Quaternionf to_eigen(const Quat& q) {
    return {q.w, q.x, q.y, q.z};
}
inline Quat from_eigen(const Eigen::Quaternionf& q) {
    return {q.x(), q.y(), q.z(), q.w()};
}

/// As to_matrix(); .matrix() is the 4x4 matrix, .affine() the 3x4 one, .linear() the rotation.
inline Eigen::Isometry3d to_eigen(const Pose& pose) {
    const Matrix4 matrix = to_matrix(pose);
    Eigen::Isometry3d out;
    for (int r = 0; r < 4; ++r)
        for (int c = 0; c < 4; ++c) out.matrix()(r, c) = matrix.m[r][c];
    return out;
}

/// The pose of a 4x4 or 3x4 matrix, or of a 3x3 rotation (then the translation is 0), in floats or doubles. Checks and
/// errors are those of pose_from_matrix().
template <class Derived> Result<Pose> pose_from_eigen(const Eigen::MatrixBase<Derived>& matrix) {
    constexpr int rows = Derived::RowsAtCompileTime, columns = Derived::ColsAtCompileTime;
    static_assert((rows == 4 && columns == 4) || (rows == 3 && (columns == 3 || columns == 4)),
                  "pose_from_eigen() takes matrices of 4x4, 3x4 or 3x3");
    const auto& entries = matrix.derived().eval();
    Matrix4 out{{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}}};
    for (int r = 0; r < rows; ++r)
        for (int c = 0; c < columns; ++c) out.m[r][c] = static_cast<double>(entries(r, c));
    return pose_from_matrix(out);
}
/// The same for Isometry3f, Affine3d and their kind.
template <class Scalar, int Mode, int Options>
Result<Pose> pose_from_eigen(const Eigen::Transform<Scalar, 3, Mode, Options>& transform) {
    return pose_from_eigen(transform.matrix());
}

} // namespace prolate
