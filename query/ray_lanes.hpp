// What the ray tests of ray_lanes-inl.hpp take and give, and the same tests on one lane in plain C++: the operations of
// the SIMD kernels in the same order, so that both give the same bits. Tests compare the two; nothing else uses it.
#pragma once

#include "query/crossing.hpp"
#include "query/inside.hpp"
#include "query/lanes.hpp"

#include <prolate/tree.hpp>

#include <cstddef>
#include <cstdint>

namespace prolate::query {

inline constexpr float kAxisScale = 0x1p-32f; ///< of n: keeps its squares in range

/// A point in the lattice coordinates of a tree, the origin of rays along its axes.
struct LatticePoint {
    float position[3];
    float slack; ///< the lane-independent part of the margin, a multiple of |n|_1
};
LatticePoint lattice_point(const PlacedPoint& point, const LatticeInfo& lattice) noexcept;

/// The part of a ray that may meet a tree, in the tree's lattice coordinates: origin + s span, 0 <= s <= 1.
struct LatticeRay {
    float origin[3], span[3];
    float slack; ///< as above
};
/// From doubles in lattice coordinates that are right within 2^-44 reach.
LatticeRay lattice_ray(const double origin[3], const double span[3], double reach) noexcept;

/// Which lanes of a block the line through a point along an axis may meet: bit i of `ahead` is set if it may meet lane
/// i in the axis's direction, of `behind` if in the opposite one.
struct AxisMask {
    uint32_t ahead, behind;
};

/// The twins, for one lane: bit 0 of a mask stands for it.
AxisMask axis_mask(const std::byte* block, uint32_t lane, int32_t step_exponent, const LatticePoint& point,
                   uint32_t axis) noexcept;
float ray_entry(const std::byte* block, uint32_t lane, int32_t step_exponent, const LatticeRay& ray,
                float limit) noexcept;

} // namespace prolate::query
