// Axis-aligned boxes around placed bodies, for a broadphase.
#pragma once

#include <prolate/tree.hpp>
#include <prolate/types.hpp>

namespace prolate {

/// Axis-aligned box in world coordinates, metres, its faces included.
struct Bounds {
    Vec3 lower, upper;
    friend bool operator==(const Bounds&, const Bounds&) = default;
};

/// Do two boxes have a common point? A coordinate that is NaN bounds nothing: the box reaches to infinity there.
inline bool overlap(const Bounds& a, const Bounds& b) noexcept {
    return !((a.lower.x > b.upper.x) | (b.lower.x > a.upper.x) | (a.lower.y > b.upper.y) | (b.lower.y > a.upper.y) |
             (a.lower.z > b.upper.z) | (b.lower.z > a.upper.z));
}

/// A box that holds the body at `pose` and all points within `margin` (metres) of it. query.hpp says what a body is; of
/// a prefix of an exact tree, it is the cut at its last level. Certified: rounding is outward, for every pose, however
/// far from the origin.
///
/// Along each axis the box is at most 1 % longer than the smallest one (measured: 0.5 % on average), of trees without
/// triangles 2 %, plus rounding to floats; of sheets, by up to 1e-4 of their longest side. It is infinite if the pose
/// is not finite, its quaternion is zero, the box is beyond the range of floats, or the margin is NaN. A negative
/// margin counts as 0.
///
/// Thread-safe, allocates nothing. Takes a few microseconds whatever the size of the tree, because it opens at most 12
/// nodes for each of the six directions. Only a prefix of an exact tree has all its leaves looked at.
Bounds bounds(const TreeView& tree, const Pose& pose, float margin = 0) noexcept;

} // namespace prolate
