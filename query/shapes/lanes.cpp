#include "query/shapes/lanes.hpp"

#include <algorithm>
#include <cmath>

namespace prolate::query {
namespace {

/// Least half extent of the ellipsoid that proposes directions, lattice steps: a point has no directions.
constexpr double kLeastExtent = 0x1p-10;

float dot(float x, float y, float z, float u, float v, float w) {
    return x * u + y * v + z * w;
}

// |L^T n|
float width(const LaneNode& e, float x, float y, float z) {
    const float along[3] = {dot(e.l11, e.l21, e.l31, x, y, z), e.l22 * y + e.l32 * z, e.l33 * z};
    return std::sqrt(along[0] * along[0] + along[1] * along[1] + along[2] * along[2]);
}

float size_of(const LaneNode& e) {
    const float xx = e.l11 * e.l11, yy = e.l21 * e.l21 + e.l22 * e.l22;
    return std::sqrt(xx + yy + dot(e.l31, e.l32, e.l33, e.l31, e.l32, e.l33));
}

} // namespace

LaneRoundedBox lane_rounded_box(const RoundedBox& box, const LatticeInfo& lattice) noexcept {
    const double per_step = power_of_two(-lattice.step_exponent), step = power_of_two(lattice.step_exponent);
    PlacedEllipsoid about{};
    about.center = box.center, about.reach = box.reach;
    for (glm::length_t i = 0; i < 3; ++i)
        about.factor[i] = box.axes[i] * std::max(box.half[i] + box.radius, kLeastExtent * step);
    LaneRoundedBox out{};
    out.single = place(about, lattice);
    out.radius = static_cast<float>(box.radius * per_step);
    float extent = out.radius;
    for (size_t i = 0; i < 3; ++i)
        for (size_t k = 0; k < 3; ++k) {
            const auto axis = static_cast<glm::length_t>(i), g = static_cast<glm::length_t>(k);
            out.edges[i][k] = static_cast<float>(box.axes[axis][g] * (box.half[axis] * per_step));
            extent += std::abs(out.edges[i][k]);
        }
    out.slack = out.single.slack + kLaneMargin * extent;
    for (size_t k = 0; k < 3; ++k) {
        const float half =
            std::abs(out.edges[0][k]) + std::abs(out.edges[1][k]) + std::abs(out.edges[2][k]) + out.radius + out.slack;
        out.single.low[k] = out.single.center[k] - half, out.single.high[k] = out.single.center[k] + half;
    }
    return out;
}

LaneHalfSpace lane_half_space(const PlacedHalfSpace& half_space, const LatticeInfo& lattice) noexcept {
    const double per_step = power_of_two(-lattice.step_exponent);
    LaneHalfSpace out{};
    double offset = half_space.offset * per_step, reach = half_space.reach * per_step;
    for (size_t i = 0; i < 3; ++i) {
        const double n = half_space.normal[static_cast<glm::length_t>(i)], origin = lattice.origin[i];
        out.normal[i] = static_cast<float>(n);
        offset -= n * origin, reach += std::abs(origin);
    }
    out.offset = static_cast<float>(offset);
    out.slack = kLaneMargin * (kLargestCenter + std::abs(out.offset)) + static_cast<float>(0x1p-42 * reach);
    return out;
}

ShapeGap shape_gap(const std::byte* block, uint32_t lane, int32_t step_exponent, const LaneRoundedBox& box) noexcept {
    const LaneNode e = load_node(block, lane, step_exponent);
    const Single& s = box.single;
    const float xx = e.l11 * e.l11, yx = e.l21 * e.l11, zx = e.l31 * e.l11;
    const float yy = e.l21 * e.l21 + e.l22 * e.l22, zy = e.l31 * e.l21 + e.l32 * e.l22;
    const float zz = dot(e.l31, e.l32, e.l33, e.l31, e.l32, e.l33), size = size_of(e);
    const float w2 = 1 / (size * (size + s.size)), weight = size * w2 * s.weight;
    const auto mix = [&](float q1, float q2) { return weight * q1 + w2 * q2; };
    const float qxx = mix(s.diagonal[0], xx), qyy = mix(s.diagonal[1], yy), qzz = mix(s.diagonal[2], zz);
    const float qyz = mix(s.off_diagonal[1], zy), qxz = mix(s.off_diagonal[2], zx), qxy = mix(s.off_diagonal[0], yx);
    const float rx = e.center[0] - s.center[0], ry = e.center[1] - s.center[1], rz = e.center[2] - s.center[2];
    const float axx = qyy * qzz - qyz * qyz, ayy = qxx * qzz - qxz * qxz, azz = qxx * qyy - qxy * qxy;
    const float axy = qxz * qyz - qxy * qzz, axz = qxy * qyz - qxz * qyy, ayz = qxy * qxz - qxx * qyz;
    const float x = dot(axx, axy, axz, rx, ry, rz), y = dot(axy, ayy, ayz, rx, ry, rz),
                z = dot(axz, ayz, azz, rx, ry, rz);
    const auto along = [&](const float(&edge)[3]) { return std::abs(dot(edge[0], edge[1], edge[2], x, y, z)); };
    const float edges = along(box.edges[0]) + along(box.edges[1]) + along(box.edges[2]);
    const float round = box.radius * std::sqrt(x * x + y * y + z * z);
    const float p = dot(x, y, z, rx, ry, rz), sum = width(e, x, y, z) + (edges + round);
    const float length = std::abs(x) + std::abs(y) + std::abs(z);
    const float gap = p - sum - (box.slack + kLaneMargin * size) * length;
    return {length > kLaneDirection ? gap : 0, p / sum};
}

ShapeGap shape_gap(const std::byte* block, uint32_t lane, int32_t step_exponent, const LaneHalfSpace& h) noexcept {
    const LaneNode e = load_node(block, lane, step_exponent);
    const auto& n = h.normal;
    const float height = dot(n[0], n[1], n[2], e.center[0], e.center[1], e.center[2]) - h.offset;
    const float low = height - width(e, n[0], n[1], n[2]);
    return {low - (h.slack + kLaneMargin * size_of(e)), low};
}

} // namespace prolate::query
