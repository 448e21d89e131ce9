#include "query/raycast/lanes.hpp"

#include <cmath>
#include <limits>

namespace prolate::query {
namespace {

float sum_of_squares(float x, float y, float z) {
    return x * x + y * y + z * z;
}
float dot(float x, float y, float z, float u, float v, float w) {
    return x * u + y * v + z * w;
}

float entry_sum(const LaneNode& e) {
    return e.l11 + e.l22 + e.l33 + (std::abs(e.l21) + std::abs(e.l31) + std::abs(e.l32));
}

/// Far below the slack, in lattice steps.
constexpr float kLeastSpan = 0x1p-60f;
constexpr double kRoundUp = 1 + 0x1p-20; // also pays for the rounding of thickness |n|

} // namespace

LatticeRay lattice_ray(const double origin[3], const double span[3], double reach, double thickness) noexcept {
    LatticeRay out{};
    for (size_t i = 0; i < 3; ++i) {
        out.origin[i] = static_cast<float>(origin[i]), out.span[i] = static_cast<float>(span[i]);
        const bool still = std::abs(out.span[i]) < kLeastSpan;
        out.inverse[i] = 1 / (still ? std::copysign(kLeastSpan, out.span[i]) : out.span[i]);
    }
    out.thickness = static_cast<float>(thickness * kRoundUp);
    out.slack = ray_slack(out.origin, out.span, reach);
    return out;
}

float box_entry(const std::byte* block, uint32_t lane, const BoxRay& ray, float limit) noexcept {
    float enter = 0, leave = limit;
    for (size_t i = 0; i < 3; ++i) {
        const auto side = [&](size_t at) {
            return static_cast<float>(load_le<uint8_t>(block + at + kBlockLanes * i + lane));
        };
        const float in = (side(ray.near_side[i]) - ray.near[i]) * ray.inverse[i];
        const float out = (side(ray.far_side[i]) - ray.far[i]) * ray.inverse[i];
        if (in > enter) enter = in;
        if (out < leave) leave = out;
    }
    return enter > leave ? std::numeric_limits<float>::infinity() : enter;
}

float ray_entry(const std::byte* block, uint32_t lane, int32_t step_exponent, const LatticeRay& ray,
                float limit) noexcept {
    const LaneNode e = load_node(block, lane, step_exponent);
    const auto& s = ray.span;
    const float rx = e.center[0] - ray.origin[0], ry = e.center[1] - ray.origin[1], rz = e.center[2] - ray.origin[2];
    const float i1 = 1 / e.l11, i2 = 1 / e.l22, i3 = 1 / e.l33;
    const float y1 = rx * i1, y2 = (ry - e.l21 * y1) * i2, y3 = (rz - e.l31 * y1 - e.l32 * y2) * i3;
    const float v1 = s[0] * i1, v2 = (s[1] - e.l21 * v1) * i2, v3 = (s[2] - e.l31 * v1 - e.l32 * v2) * i3;
    const float vv = sum_of_squares(v1, v2, v3), nearest = dot(y1, y2, y3, v1, v2, v3) / vv;
    const float m1 = y1 - nearest * v1, m2 = y2 - nearest * v2, m3 = y3 - nearest * v3;
    const float outside = sum_of_squares(m1, m2, m3), inside = 1 - outside > 0 ? 1 - outside : 0;
    const float back = std::sqrt(inside / vv);
    const bool ahead = nearest > back;
    const float z1 = ahead ? m1 + back * v1 : y1, z2 = ahead ? m2 + back * v2 : y2, z3 = ahead ? m3 + back * v3 : y3;
    const float nz = z3 * i3, ny = (z2 - e.l32 * nz) * i2, nx = (z1 - e.l21 * ny - e.l31 * nz) * i1;
    const float width =
        std::sqrt(sum_of_squares(dot(e.l11, e.l21, e.l31, nx, ny, nz), e.l22 * ny + e.l32 * nz, e.l33 * nz));
    const float length = std::abs(nx) + std::abs(ny) + std::abs(nz), margin = ray.slack + kLaneMargin * entry_sum(e);
    float g = dot(nx, ny, nz, rx, ry, rz) - width - margin * length;
    if (ray.thickness > 0) g -= ray.thickness * std::sqrt(sum_of_squares(nx, ny, nz));
    const float along = dot(nx, ny, nz, s[0], s[1], s[2]);
    if (!(length > kLaneDirection && g > 0)) return 0;
    if (g > limit * along) return std::numeric_limits<float>::infinity();
    return along > 0 ? g / along : 0;
}

} // namespace prolate::query
