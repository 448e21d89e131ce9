// Does a body meet a simple shape: a sphere, a capsule, a box, a half-space? For triggers, queries of a region, ground.
//
// query.hpp says what the verdicts certify; the shape takes the place of the second body, and is solid. Against an
// exact tree whose mesh is closed, a shape wholly inside the solid overlaps, too. What is reported to overlap may be
// apart by a little: an ellipsoid by 1e-10 of the lengths that enter at axis ratios up to 3, 1e-8 at 1000; a triangle,
// and anything against a half-space, by 1e-11.
#pragma once

#include <prolate/query.hpp>

#include <cstdint>

namespace prolate {

/// All shapes are placed in the world. Lengths in metres; radii and half extents may be 0. Negative ones count as 0;
/// with infinite or NaN ones, or any other number that is not finite, a shape overlaps all.
struct Sphere {
    Vec3 center;
    float radius = 1;
};
/// All points not farther than `radius` from the segment between `a` and `b`, which may be the same.
struct Capsule {
    Vec3 a, b;
    float radius = 1;
};
/// The box |x| <= half.x, |y| <= half.y, |z| <= half.z at `pose`.
struct Box {
    Pose pose;
    Vec3 half{1, 1, 1};
};
/// All points whose height along `normal` is at most `offset`. The normal is made a unit vector first, in double
/// precision, so its length need not be exactly 1. With a normal of 0, it overlaps all.
struct HalfSpace {
    Vec3 normal{0, 0, 1};
    float offset = 0;
};

/// Answer of overlap().
struct OverlapResult {
    Verdict verdict = Verdict::undecided;
    bool enclosed = false;           ///< overlapping though no triangle meets the shape: it lies inside the solid
    uint32_t node = 0;               ///< if overlapping: a leaf (or a node at max_level) that meets the shape
    uint32_t triangle = kNoTriangle; ///< its triangle that does, of an exact tree
    QueryStats stats;
};

/// Do the tree at `pose` and the shape meet, or come as near as options.margin? Stops at the first leaf, or triangle,
/// that does. Thread-safe on shared trees. The descent is told in query/shapes/shapes.cpp, the tests in
/// query/shapes/rounded_box.hpp.
OverlapResult overlap(const TreeView& tree, const Pose& pose, const Sphere& sphere, QueryContext& context,
                      const QueryOptions& options = {}) noexcept;
OverlapResult overlap(const TreeView& tree, const Pose& pose, const Capsule& capsule, QueryContext& context,
                      const QueryOptions& options = {}) noexcept;
OverlapResult overlap(const TreeView& tree, const Pose& pose, const Box& box, QueryContext& context,
                      const QueryOptions& options = {}) noexcept;
OverlapResult overlap(const TreeView& tree, const Pose& pose, const HalfSpace& half_space, QueryContext& context,
                      const QueryOptions& options = {}) noexcept;

} // namespace prolate
