// Axis-aligned boxes around placed bodies: what a broadphase compares.
#pragma once

#include <prolate/tree.hpp>
#include <prolate/types.hpp>

namespace prolate {

/// Axis-aligned box in world coordinates, metres. Its faces belong to it.
struct Bounds {
    Vec3 lower, upper;
    friend bool operator==(const Bounds&, const Bounds&) = default;
};

/// Do two boxes have a common point? A face that is NaN bounds nothing.
inline bool overlap(const Bounds& a, const Bounds& b) noexcept {
    return !((a.lower.x > b.upper.x) | (b.lower.x > a.upper.x) | (a.lower.y > b.upper.y) | (b.lower.y > a.upper.y) |
             (a.lower.z > b.upper.z) | (b.lower.z > a.upper.z));
}

/// A box that holds the solid that `tree` covers, at `pose`, and all points nearer to it than `margin` (metres, >= 0).
/// Certified: rounding is outward, for every pose, however far from the origin. It is the box of the nodes of level 1,
/// cut by that of the root and by a turned box around a deeper cut; leaf ellipsoids of a proxy tree may stick out of it
/// where no solid is. Infinite where a pose is not finite, its quaternion zero, or the box beyond the range of floats.
/// Thread-safe, allocates nothing. Looks at up to 64 nodes or so: a World keeps what does not depend on the pose.
Bounds bounds(const TreeView& tree, const Pose& pose, float margin = 0) noexcept;

} // namespace prolate
