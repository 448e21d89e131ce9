#include "query/lanes.hpp"

#include <glm/mat3x3.hpp>

#include <algorithm>
#include <bit>
#include <cmath>

namespace prolate::query {

void place_shape(Single& s) noexcept {
    const auto& f = s.factor;
    for (size_t j = 0; j < 3; ++j)
        for (size_t i = 0; i < 4; ++i) s.shape[j][i] = f[0][i] * f[0][j] + f[1][i] * f[1][j] + f[2][i] * f[2][j];
}

void place_factor(const LaneNode& e, const LatticePose& pose, Single& s) noexcept {
    const auto& r = pose.linear_rounded;
    for (size_t i = 0; i < 4; ++i) {
        s.factor[0][i] = r[0][i] * e.l11 + r[1][i] * e.l21 + r[2][i] * e.l31;
        s.factor[1][i] = r[1][i] * e.l22 + r[2][i] * e.l32;
        s.factor[2][i] = r[2][i] * e.l33;
    }
    place_shape(s);
}

Single place(const std::byte* block, uint32_t lane, const LatticePose& pose) noexcept {
    const LaneNode e = load_node(block, lane, pose.exponent_from);
    Single s;
    place_center(e, pose, s);
    place_factor(e, pose, s);
    place_size(pose.reach, s);
    place_box(s);
    cut_box(block, lane, pose, s);
    return s;
}

Single place(const PlacedEllipsoid& ellipsoid, const LatticeInfo& lattice) noexcept {
    const double per_step = std::ldexp(1.0, -lattice.step_exponent);
    Single s{};
    double reach = ellipsoid.reach * per_step;
    for (size_t i = 0; i < 3; ++i) {
        const auto g = static_cast<glm::length_t>(i);
        s.exact[i] = ellipsoid.center[g] * per_step - lattice.origin[i];
        s.center[i] = static_cast<float>(s.exact[i]);
        reach += std::abs(static_cast<double>(lattice.origin[i]));
        for (size_t column = 0; column < 3; ++column)
            s.factor[column][i] =
                static_cast<float>(ellipsoid.factor[static_cast<glm::length_t>(column)][g] * per_step);
    }
    place_shape(s);
    place_size(reach, s);
    place_box(s);
    return s;
}

bool boxes_apart(const std::byte* block, uint32_t lane, const Single& s, float margin) noexcept {
    for (size_t i = 0; i < 3; ++i) {
        const auto [least, most] = box_thresholds(block, i, s, margin);
        const auto byte = [&](size_t array) {
            return int32_t{load_le<uint8_t>(block + array + kBlockLanes * i + lane)};
        };
        if (byte(kBlockBoxLow) > most || byte(kBlockBoxHigh) < least) return true;
    }
    return false;
}

LaneGap lane_gap(const std::byte* block, uint32_t lane, int32_t step_exponent, const Single& s) noexcept {
    const LaneNode e = load_node(block, lane, step_exponent);
    const auto dot = [](float x, float y, float z, float u, float v, float w) { return x * u + y * v + z * w; };
    const float xx = e.l11 * e.l11, yx = e.l21 * e.l11, zx = e.l31 * e.l11;
    const float yy = e.l21 * e.l21 + e.l22 * e.l22, zy = e.l31 * e.l21 + e.l32 * e.l22;
    const float zz = dot(e.l31, e.l32, e.l33, e.l31, e.l32, e.l33);
    LaneGap out{};
    out.size = std::sqrt(xx + yy + zz);
    const float w2 = 1 / (out.size * (out.size + s.size)), w1 = out.size * w2 * s.weight;
    const auto mix = [&](float q1, float q2) { return w1 * q1 + w2 * q2; };
    const float qxx = mix(s.shape[0][0], xx), qyy = mix(s.shape[1][1], yy), qzz = mix(s.shape[2][2], zz);
    const float qyz = mix(s.shape[1][2], zy), qxz = mix(s.shape[0][2], zx), qxy = mix(s.shape[0][1], yx);
    const float rx = e.center[0] - s.center[0], ry = e.center[1] - s.center[1], rz = e.center[2] - s.center[2];
    const float axx = qyy * qzz - qyz * qyz, ayy = qxx * qzz - qxz * qxz, azz = qxx * qyy - qxy * qxy;
    const float axy = qxz * qyz - qxy * qzz, axz = qxy * qyz - qxz * qyy, ayz = qxy * qxz - qxx * qyz;
    const float x = dot(axx, axy, axz, rx, ry, rz), y = dot(axy, ayy, ayz, rx, ry, rz),
                z = dot(axz, ayz, azz, rx, ry, rz);
    const auto along = [&](size_t c) { return dot(s.factor[c][0], s.factor[c][1], s.factor[c][2], x, y, z); };
    const float a1 = along(0), a2 = along(1), a3 = along(2);
    const float b1 = dot(e.l11, e.l21, e.l31, x, y, z), b2 = e.l22 * y + e.l32 * z, b3 = e.l33 * z;
    const float a = std::sqrt(a1 * a1 + a2 * a2 + a3 * a3), b = std::sqrt(b1 * b1 + b2 * b2 + b3 * b3);
    const float p = dot(x, y, z, rx, ry, rz), sum = a + b, length = std::abs(x) + std::abs(y) + std::abs(z);
    out.gap = p - sum - (s.slack + kLaneMargin * out.size) * length;
    out.square = x * x + y * y + z * z;
    out.depth = p / sum;
    if (!(length > kLaneDirection)) out.gap = 0;
    return out;
}

} // namespace prolate::query
