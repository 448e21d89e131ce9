#include "query/inside/axis_lanes.hpp"

#include <cmath>

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

} // namespace

float ray_slack(const float origin[3], const float span[3], double reach) noexcept {
    float lengths = kLargestCenter;
    for (size_t i = 0; i < 3; ++i) lengths += std::abs(origin[i]) + std::abs(span[i]);
    return kLaneMargin * lengths + static_cast<float>(0x1p-42 * reach);
}

LatticePoint lattice_point(const PlacedPoint& point, const LatticeInfo& lattice) noexcept {
    const double per_step = power_of_two(-lattice.step_exponent);
    LatticePoint out{};
    double reach = point.reach * per_step;
    for (size_t i = 0; i < 3; ++i) {
        const double origin = lattice.origin[i];
        out.position[i] = static_cast<float>(point.position[static_cast<glm::length_t>(i)] * per_step - origin);
        reach += std::abs(origin);
    }
    constexpr float kNoSpan[3] = {};
    out.slack = ray_slack(out.position, kNoSpan, reach);
    return out;
}

AxisMask axis_mask(const std::byte* block, uint32_t lane, int32_t step_exponent, const LatticePoint& point,
                   uint32_t axis) noexcept {
    const LaneNode e = load_node(block, lane, step_exponent);
    const float factor[3][3] = {{e.l11, 0, 0}, {e.l21, e.l22, 0}, {e.l31, e.l32, e.l33}}; // rows
    float r[3];
    for (size_t i = 0; i < 3; ++i) r[i] = e.center[i] - point.position[i];
    const size_t i = (axis + 1) % 3, j = (axis + 2) % 3;
    // Products with the zeros of the factor change nothing.
    const auto row_product = [&](size_t p, size_t q) {
        return dot(factor[p][0], factor[p][1], factor[p][2], factor[q][0], factor[q][1], factor[q][2]);
    };
    const float a = row_product(i, i), b = row_product(i, j), c = row_product(j, j);
    const float si = r[i] * kAxisScale, sj = r[j] * kAxisScale;
    const float ni = c * si - b * sj, nj = a * sj - b * si;
    float along[3];
    for (size_t k = 0; k < 3; ++k) along[k] = factor[i][k] * ni + factor[j][k] * nj;
    const float margin = point.slack + kLaneMargin * entry_sum(e), length = std::abs(ni) + std::abs(nj);
    const float width = std::sqrt(sum_of_squares(along[0], along[1], along[2]));
    const float g = (ni * r[i] + nj * r[j]) - width - margin * length;
    if (g > 0 && length > kLaneDirection) return {0, 0};
    const float widened = std::sqrt(row_product(axis, axis)) + margin;
    return {!(widened + r[axis] < 0), !(widened - r[axis] < 0)};
}

} // namespace prolate::query
