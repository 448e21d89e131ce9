// Scalar references of the lane kernels: what a kernel gives for one lane, by the same operations in the same order in
// plain C++, so that every instruction set must give the same bits. Their arguments are the kernels' own.
#pragma once

#include "query/inside/axis_lanes.hpp"
#include "query/node/lanes.hpp"
#include "query/raycast/lanes.hpp"
#include "query/shapes/lanes.hpp"

#include <cstddef>
#include <cstdint>

namespace prolate::query {

/// Of query/node/lanes-inl.hpp.
struct LaneGap {
    float gap;    ///< p - a - b less the margin, a multiple of |n|: positive only if they are apart; else possibly NaN
    float square; ///< |n|^2
    float depth;  ///< p / (a + b): below 1 they overlap as seen along n, 0 at equal centers
    float size;   ///< |L2|
};
LaneGap lane_gap(const std::byte* block, uint32_t lane, int32_t step_exponent, const Single& single);

/// Of query/node/hull_lanes-inl.hpp. How far what a hull record (src/hull.hpp) describes reaches from its node's center
/// along n: v = L^T n, width = |v|. If the record knows nothing, `width`.
float hull_reach(const std::byte* hull, const float (&v)[3], float width);

/// Of query/inside/axis_lanes-inl.hpp: bit 0 of a mask stands for the lane.
AxisMask axis_mask(const std::byte* block, uint32_t lane, int32_t step_exponent, const LatticePoint& point,
                   uint32_t axis);

/// Of query/raycast/lanes-inl.hpp.
float box_entry(const std::byte* block, uint32_t lane, const LatticeRay& ray, float limit);
float ray_entry(const std::byte* block, uint32_t lane, int32_t step_exponent, const LatticeRay& ray, float limit);

/// Of query/shapes/lanes-inl.hpp.
struct ShapeGap {
    float gap; ///< positive only if they are apart; else possibly NaN
    float key; ///< the less, the deeper they overlap
};
ShapeGap shape_gap(const std::byte* block, uint32_t lane, int32_t step_exponent, const LaneRoundedBox& box);
ShapeGap shape_gap(const std::byte* block, uint32_t lane, int32_t step_exponent, const LaneHalfSpace& half_space);

} // namespace prolate::query
