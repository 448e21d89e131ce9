#include "query/inside/axis_lanes.hpp"

#include <cmath>

namespace prolate::query {

float ray_slack(const float origin[3], const float span[3], double reach) noexcept {
    float lengths = kLargestCenter;
    for (size_t i = 0; i < 3; ++i) lengths += std::abs(origin[i]) + std::abs(span[i]);
    return kLaneMargin * lengths + static_cast<float>(0x1p-42 * reach);
}

LatticePoint lattice_point(const PlacedPoint& point, const LatticeInfo& lattice) noexcept {
    const double per_step = steps_per_metre(lattice);
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

} // namespace prolate::query
