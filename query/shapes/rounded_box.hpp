// A box blown up by a radius: what a sphere, a capsule, a box, and all of them with a margin, are. And a half-space.
// Are they separated from a triangle or an ellipsoid? Scalar, in double precision, in the tree's frame.
//
// With the box's half edges e_i and radius rho, any direction n certifies that it is separated from a convex body K if
//     min n.(x - c) over K  -  sum |n.e_i|  -  rho |n|  >  0.                                                       (1)
// n is sought by Gilbert, Johnson and Keerthi's algorithm (1988) for the point v of K - box that is nearest to the
// origin: n = v. It ends when n certifies, when |v| <= rho, when the difference holds the origin, or when v gains no
// more; but for the first, they meet. So an inexact v costs decisions, never correctness. Where a triangle nearly
// touches, v has lost its digits; the directions of the separating axis theorem (Gottschalk, Lin and Manocha 1996) have
// not.
//
// Rounding, in the terms and with the bounds of query/ellipsoid/separation.hpp: the frame is the tree's, so K is exact
// and the box is body B: |n.(x - c)| is wrong by 81 u |n| S, |L^T n| by 7 u |n| |L|, |n.e_i| by 74 u |n| |e_i|, rho |n|
// by 4 u, and two sums by 4 u |n| S, S = |x| + |d| + |L| + sum |e_i| + rho: less than 90 u |n| S in all.
// kSeparationMargin, 256 u, is demanded.
//
// Half-space: its normal decides alone. The placed normal is wrong by 35 u, its offset by 40 u (|offset| + |t|); with
// S = |offset| + |t| + |x| + |L|, less than 90 u S again.
//
// Cost: about 300 flops a step; triangles take 2 to 5 steps, ellipsoids 4 to 20.
#pragma once

#include "query/ellipsoid/separation.hpp"
#include "query/triangle/placed.hpp"

#include <prolate/shapes.hpp>

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

namespace prolate::query {

struct RoundedBox {
    glm::dvec3 center;
    glm::dmat3 axes; ///< columns, orthonormal
    glm::dvec3 half; ///< half extents along the axes, >= 0
    double radius;
    double reach; ///< all lengths that enter: its share of S
};
/// Shapes of the world in the frame of a tree at `pose`, blown up by `margin`.
RoundedBox place(const Sphere& sphere, const Pose& pose, double margin) noexcept;
RoundedBox place(const Capsule& capsule, const Pose& pose, double margin) noexcept;
RoundedBox place(const Box& box, const Pose& pose, double margin) noexcept;

struct PlacedHalfSpace {
    glm::dvec3 normal; ///< unit
    double offset;
    double reach;
};
PlacedHalfSpace place(const HalfSpace& half_space, const Pose& pose, double margin) noexcept;
/// `to_world`: from the tree's frame.
PlacedHalfSpace place(const HalfSpace& half_space, const RelativePose& to_world, double margin) noexcept;

/// True only if they have no common point. The margin is a parameter only so that the tests can show that wrong ones
/// are caught.
bool separated(const PlacedTriangle& triangle, const RoundedBox& box, double margin = kSeparationMargin) noexcept;
bool separated(const PlacedEllipsoid& ellipsoid, const RoundedBox& box, double margin = kSeparationMargin) noexcept;
bool separated(const PlacedTriangle& triangle, const PlacedHalfSpace& half_space,
               double margin = kSeparationMargin) noexcept;
bool separated(const PlacedEllipsoid& ellipsoid, const PlacedHalfSpace& half_space,
               double margin = kSeparationMargin) noexcept;

} // namespace prolate::query
