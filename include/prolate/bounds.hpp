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

/// A box that holds the body that is at `pose`, and all points nearer to it than `margin` (metres, >= 0). A body is
/// what queries answer for: the triangles of an exact tree, or the ellipsoids of the leaves (of a prefix, the cut at
/// its last level). Certified: rounding is outward, for every pose, however far from the origin.
///
/// Tight: along each axis it is at most 1 % longer than the least box (measured: on average 0.5 %), of trees without
/// triangles 2 %, plus rounding to floats; of sheets, by up to 1e-4 of their longest side. Infinite where a pose is not
/// finite, its quaternion zero, the box beyond the range of floats, or the margin NaN. A negative margin counts as 0.
///
/// Thread-safe, allocates nothing. Takes a few microseconds, for trees of any size: it opens no more than 12 nodes in
/// each of the six directions. Only of a prefix of an exact tree all leaves are looked at.
Bounds bounds(const TreeView& tree, const Pose& pose, float margin = 0) noexcept;

} // namespace prolate
