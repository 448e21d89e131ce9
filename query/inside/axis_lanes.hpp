// What the axis tests of axis_lanes-inl.hpp take and give.
#pragma once

#include "query/ellipsoid/placed.hpp"
#include "query/node/lanes.hpp"

#include <prolate/tree.hpp>

#include <cstddef>
#include <cstdint>

namespace prolate::query {

inline constexpr float kAxisScale = 0x1p-32f; ///< of n: keeps its squares in range

/// The lane-independent part of the margin of a ray, a multiple of |n|_1. `span` is 0 for rays along the axes.
float ray_slack(const float origin[3], const float span[3], double reach) noexcept;

/// A point in the lattice coordinates of a tree, the origin of rays along its axes.
struct LatticePoint {
    float position[3];
    float slack; ///< ray_slack()
};
LatticePoint lattice_point(const PlacedPoint& point, const LatticeInfo& lattice) noexcept;

/// Which lanes of a block the line through a point along an axis may meet: bit i of `ahead` is set if it may meet lane
/// i in the axis's direction, of `behind` if in the opposite one.
struct AxisMask {
    uint32_t ahead, behind;
};

} // namespace prolate::query
