// Does a body meet a simple shape: a sphere, a capsule, a box, a half-space? For triggers, region queries and ground.
//
// query.hpp says what the verdicts certify; the shape takes the place of the second body, and is solid. A shape that
// lies wholly inside the solid of a closed exact tree overlaps it. What is called overlapping may be separated by a gap
// that rounding hides: of an ellipsoid, 1e-10 of the lengths involved at axis ratios up to 3, 1e-8 at 1000; of a
// triangle, or against a half-space, 1e-11.
#pragma once

#include <prolate/query.hpp>

#include <cstdint>

namespace prolate {

// All shapes are placed in the world, lengths in metres. Radii and half extents may be 0, and negative ones count as 0.
// If any number of a shape is not finite, it overlaps everything.

/// All points at most `radius` from `center`.
struct Sphere {
    Vec3 center;
    float radius = 1;
};
/// All points at most `radius` from the segment between `a` and `b`, which may coincide.
struct Capsule {
    Vec3 a, b;
    float radius = 1;
};
/// The box |x| <= half.x, |y| <= half.y, |z| <= half.z at `pose`.
struct Box {
    Pose pose;
    Vec3 half{1, 1, 1};
};
/// All points p with dot(normal, p) <= offset. The normal is made a unit vector first, in double precision, so its
/// length need not be exactly 1. With a normal of 0, the half-space overlaps everything.
struct HalfSpace {
    Vec3 normal{0, 0, 1};
    float offset = 0;
};

/// Answer of overlap().
struct OverlapResult {
    Verdict verdict = Verdict::undecided;
    bool enclosed = false;           ///< overlapping though no triangle meets the shape: it lies inside the solid
    uint32_t node = 0;               ///< if overlapping: slot of a leaf (or node at max_level) that meets the shape
    uint32_t triangle = kNoTriangle; ///< if overlapping: its triangle that meets the shape, of an exact tree
    QueryStats stats;
};

/// Do the body at `pose` and the shape meet, or come within options.margin of each other? Stops at the first leaf, or
/// triangle, that does. Thread-safe on shared trees. The search is described in query/shapes/search.cpp, the tests in
/// query/shapes/rounded_box.hpp.
OverlapResult overlap(const TreeView& tree, const Pose& pose, const Sphere& sphere, Scratch context,
                      const QueryOptions& options = {}) noexcept;
OverlapResult overlap(const TreeView& tree, const Pose& pose, const Capsule& capsule, Scratch context,
                      const QueryOptions& options = {}) noexcept;
OverlapResult overlap(const TreeView& tree, const Pose& pose, const Box& box, Scratch context,
                      const QueryOptions& options = {}) noexcept;
OverlapResult overlap(const TreeView& tree, const Pose& pose, const HalfSpace& half_space, Scratch context,
                      const QueryOptions& options = {}) noexcept;

} // namespace prolate
