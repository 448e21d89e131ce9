#include <prolate/matrix.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace prolate {

Matrix4 to_matrix(const Pose& pose) noexcept {
    const double x = pose.rotation.x, y = pose.rotation.y, z = pose.rotation.z, w = pose.rotation.w;
    const double tx = pose.translation.x, ty = pose.translation.y, tz = pose.translation.z;
    const double s = 2 / (x * x + y * y + z * z + w * w);
    if (!std::isfinite(s) || !(s > 0) || !std::isfinite(tx + ty + tz)) {
        Matrix4 unknown;
        for (auto& row : unknown.m) std::fill(std::begin(row), std::end(row), std::numeric_limits<double>::quiet_NaN());
        return unknown;
    }
    return {{{1 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w), tx},
             {s * (x * y + z * w), 1 - s * (x * x + z * z), s * (y * z - x * w), ty},
             {s * (x * z - y * w), s * (y * z + x * w), 1 - s * (x * x + y * y), tz},
             {0, 0, 0, 1}}};
}

// S. W. Shepperd, "Quaternion from Rotation Matrix", Journal of Guidance and Control 1(3), 1978: from the largest of
// the four components, so that no digits cancel.
std::array<double, 4> quaternion_of(const double (&m)[3][3]) noexcept {
    const double trace = m[0][0] + m[1][1] + m[2][2];
    std::array<double, 4> q; // x, y, z, w
    if (trace >= std::max({m[0][0], m[1][1], m[2][2]})) {
        q[3] = 1 + trace;
        for (size_t i = 0; i < 3; ++i) {
            const size_t j = (i + 1) % 3, k = (i + 2) % 3;
            q[i] = m[k][j] - m[j][k];
        }
    } else {
        const size_t i = m[0][0] >= m[1][1] ? (m[0][0] >= m[2][2] ? 0 : 2) : (m[1][1] >= m[2][2] ? 1 : 2);
        const size_t j = (i + 1) % 3, k = (i + 2) % 3;
        q[i] = 1 + m[i][i] - m[j][j] - m[k][k];
        q[j] = m[i][j] + m[j][i];
        q[k] = m[i][k] + m[k][i];
        q[3] = m[k][j] - m[j][k];
    }
    const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    for (double& c : q) c /= length;
    return q;
}

Result<Pose> pose_from_matrix(const Matrix4& matrix) noexcept {
    const auto bad = [](const char* what) { return Error{ErrorCode::bad_options, what}; };
    const auto& m = matrix.m;
    for (const auto& row : m)
        for (const double entry : row)
            if (!std::isfinite(entry)) return bad("the matrix is not finite");
    const double last_row[4] = {0, 0, 0, 1};
    for (size_t c = 0; c < 4; ++c)
        if (std::abs(m[3][c] - last_row[c]) > kRigidTolerance)
            return bad("the matrix is not affine: its last row must be 0 0 0 1");
    for (size_t i = 0; i < 3; ++i)
        for (size_t j = i; j < 3; ++j) {
            const double dot = m[0][i] * m[0][j] + m[1][i] * m[1][j] + m[2][i] * m[2][j];
            if (!(std::abs(dot - (i == j ? 1 : 0)) <= kRigidTolerance))
                return bad(i == j ? "the matrix scales: a pose only rotates and moves"
                                  : "the matrix shears: a pose only rotates and moves");
        }
    const double determinant = m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) -
                               m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
                               m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
    if (determinant < 0) return bad("the matrix mirrors: a pose only rotates and moves");
    Pose pose;
    float* const translation[3] = {&pose.translation.x, &pose.translation.y, &pose.translation.z};
    for (size_t i = 0; i < 3; ++i) {
        *translation[i] = static_cast<float>(m[i][3]);
        if (!std::isfinite(*translation[i])) return bad("the translation is beyond the range of floats");
    }
    const double rotation[3][3] = {
        {m[0][0], m[0][1], m[0][2]}, {m[1][0], m[1][1], m[1][2]}, {m[2][0], m[2][1], m[2][2]}};
    const auto [x, y, z, w] = quaternion_of(rotation);
    pose.rotation = {static_cast<float>(x), static_cast<float>(y), static_cast<float>(z), static_cast<float>(w)};
    return pose;
}

} // namespace prolate
