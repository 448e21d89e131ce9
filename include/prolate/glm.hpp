// Conversions to and from GLM, inline, for programs that use it. All are thread-safe. Memory layouts are never
// reinterpreted, because GLM's build macros change them (quaternion order, vec3 size).
#pragma once

#include <prolate/matrix.hpp>
#include <prolate/types.hpp>

#include <glm/gtc/quaternion.hpp>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>

namespace prolate {

inline glm::vec3 to_glm(const Vec3& v) {
    return {v.x, v.y, v.z};
}
inline Vec3 from_glm(const glm::vec3& v) {
    return {v.x, v.y, v.z};
}

/// Component by component, without normalising.
inline glm::quat to_glm(const Quat& q) {
    glm::quat out;
    out.x = q.x, out.y = q.y, out.z = q.z, out.w = q.w;
    return out;
}
inline Quat from_glm(const glm::quat& q) {
    return {q.x, q.y, q.z, q.w};
}

/// As to_matrix(). GLM converts it to others: glm::mat4(m), and glm::mat4x3(m), which is 3x4 in mathematicians' terms.
inline glm::dmat4 to_glm(const Pose& pose) {
    const Matrix4 matrix = to_matrix(pose);
    glm::dmat4 out;
    for (glm::length_t r = 0; r < 4; ++r)
        for (glm::length_t c = 0; c < 4; ++c) out[c][r] = matrix.m[r][c];
    return out;
}

/// The pose of a glm::mat4 or mat4x3, or of a rotation mat3 (then the translation is 0), in floats or doubles. Checks
/// and errors are those of pose_from_matrix().
template <glm::length_t Columns, glm::length_t Rows, class Scalar, glm::qualifier Qualifier>
Result<Pose> pose_from_glm(const glm::mat<Columns, Rows, Scalar, Qualifier>& matrix) {
    static_assert((Columns == 4 && Rows == 4) || (Rows == 3 && (Columns == 3 || Columns == 4)),
                  "pose_from_glm() takes glm::mat4, mat4x3 or mat3");
    Matrix4 out{{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}}};
    for (glm::length_t r = 0; r < Rows; ++r)
        for (glm::length_t c = 0; c < Columns; ++c) out.m[r][c] = static_cast<double>(matrix[c][r]);
    return pose_from_matrix(out);
}

} // namespace prolate
