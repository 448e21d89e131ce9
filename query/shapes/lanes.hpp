// What the culling tests of lanes-inl.hpp take: shapes in the lattice coordinates of a tree.
#pragma once

#include "query/node/lanes.hpp"
#include "query/shapes/rounded_box.hpp"

#include <cstddef>
#include <cstdint>

namespace prolate::query {

/// A rounded box in the lattice coordinates of a tree.
struct LaneRoundedBox {
    Single single;     ///< an ellipsoid of about its shape, which proposes directions; low and high are the box's own
    float edges[3][3]; ///< half edges
    float radius;
    float slack; ///< the lane-independent part of the margin, a multiple of |n|_1
};
LaneRoundedBox lane_rounded_box(const RoundedBox& box, const LatticeInfo& lattice) noexcept;

struct LaneHalfSpace {
    float normal[3];
    float offset;
    float slack; ///< the lane-independent part of the margin, a multiple of |n|
};
LaneHalfSpace lane_half_space(const PlacedHalfSpace& half_space, const LatticeInfo& lattice) noexcept;

} // namespace prolate::query
