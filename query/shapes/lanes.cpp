#include "query/shapes/lanes.hpp"

#include <algorithm>
#include <cmath>

namespace prolate::query {
namespace {

/// Least half extent of the ellipsoid that proposes directions, lattice steps: a point has no directions.
constexpr double kLeastExtent = 0x1p-10;

} // namespace

LaneRoundedBox lane_rounded_box(const RoundedBox& box, const LatticeInfo& lattice) noexcept {
    const double per_step = steps_per_metre(lattice), step = step_of(lattice);
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
    const double per_step = steps_per_metre(lattice);
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

} // namespace prolate::query
