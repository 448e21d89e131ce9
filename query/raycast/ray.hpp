// Where does a ray meet an ellipsoid, or a triangle, or come near to one? Scalar, in double precision, in the frame of
// the tree.
//
// The ray is cut down to the part near the root first, and counted from there (PlacedRay), so that a far origin costs
// no more than the rounding of its own distance. u = 2^-53, S = all lengths that enter: in the terms of
// query/ellipsoid/separation.hpp the points of the placed ray are wrong by less than 75 u S (origin) and 34 u S
// (direction). What cuts them down is right within 200 u S, the ball's radius included, and kSeparationMargin, 256 u S,
// wider.
//
// Ellipsoid: as in lanes-inl.hpp, (1). n.r, |L^T n| and t n.d add up to 15 u |n| S of rounding, with the ray's own
// 124 u |n| S: kSeparationMargin, 256 u, is demanded. Not certainly missed is hit.
//
// Triangle: the ray is turned to the z-axis by exchanging coordinates and a shear (Woop, Benthin and Wald 2013,
// "Watertight ray/triangle intersection"), where the corners are wrong by less than 2 (109 u + 64 u + 3 u) S, below tau
// = kRayMargin S, 512 u. The edge functions U = c x b ... tell on which side of the edges the ray passes; each is wrong
// by less than tau (|b|_1 + |c|_1). Missed is a triangle that certainly lies on both sides of the ray, or whose box
// does not hold the ray, widened by tau; all others are hit. That is no less watertight than exact signs, and also
// meets what a ray in the plane of a triangle meets: where all three signs are in doubt, the triangle is nearly a
// segment, of a width below 9 tau, and is hit where an edge comes nearer to the ray than 16 tau.
//
// The depth of a triangle's hit is a mean of its corners' depths, weighted with the edge functions: right within tau,
// and the more of the triangle's extent the more it is seen edge-on.
//
// Within a distance m of a body: at a point x of the ray the direction n, |n| = 1, from the body's nearest point to x
// certifies that the ray keeps farther from the body than m for as long as
//     n.(o + t d) - max n.y over the body - m > 0,
// and x moves on to where that ends: Newton's method for (distance of x) - m, which is convex along the ray, so it
// comes nearer to the hit from the same side with every step, twice as many digits at a time, or where the ray only
// grazes half as far. (This is the ray cast of van den Bergen 2004, with the nearest point found at once.) Any other n
// costs steps, never correctness. Rounding: as for the ellipsoid, and 3 u (S + m) for n and m.
#pragma once

#include "query/ellipsoid/separation.hpp"
#include "query/triangle/placed.hpp"

#include <prolate/raycast.hpp>

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include <optional>

namespace prolate::query {

inline constexpr double kRayMargin = 0x1p-44;

/// How triangles are turned so that the ray is the z-axis: x' = x_i - shear[0] x_k, y' = x_j - shear[1] x_k, z' = sign
/// x_k, of points from its origin.
struct RayShear {
    size_t i, j, k; ///< k: the axis along which the ray is longest
    double shear[2], sign;
    double per_t; ///< z' for each t
};

/// A ray in the tree's frame: origin + t direction, 0 <= t <= length, where t = 0 is the ray's own t = `begin`.
struct PlacedRay {
    glm::dvec3 origin, direction;
    double begin, length;
    double reach; ///< its share of S
    RayShear shear;
    bool empty; ///< certainly misses the ball that it was cut down to
    bool valid; ///< all is finite, and the direction not 0
};
/// A ball that holds all that a ray may meet, in the tree's frame.
struct RayBound {
    glm::dvec3 center;
    double radius;
    double reach; ///< no less than the moduli of center and radius, and of any point that is met: its share of S
};

/// Of a tree, whose leaf ellipsoids or triangles it holds.
RayBound ray_bound(const TreeView& tree) noexcept;

/// `rotation`: from the world's axes to the tree's frame, in which the ray begins at `origin`, `far` from the frame's
/// own. Cuts the ray down to what may come as near to the ball as `distance`.
PlacedRay place(const Ray& ray, const glm::dmat3& rotation, const glm::dvec3& origin, double far, const RayBound& bound,
                double distance = 0) noexcept;

struct RayHit {
    double t;          ///< of the placed ray
    glm::dvec3 normal; ///< outwards, of any length; 0 if there is none
};
/// Empty only if no point of the ray lies in the ellipsoid, or on the triangle. The margins are parameters only so that
/// the tests can show that wrong ones are caught.
std::optional<RayHit> hit(const PlacedRay& ray, const PlacedEllipsoid& ellipsoid,
                          double margin = kSeparationMargin) noexcept;
std::optional<RayHit> hit(const PlacedRay& ray, const PlacedTriangle& triangle, double margin = kRayMargin) noexcept;

/// Empty only if no point of the ray comes as near as `distance` > 0 to the ellipsoid, or to the triangle.
std::optional<RayHit> hit_within(double distance, const PlacedRay& ray, const PlacedEllipsoid& ellipsoid,
                                 double margin = kSeparationMargin) noexcept;
std::optional<RayHit> hit_within(double distance, const PlacedRay& ray, const PlacedTriangle& triangle,
                                 double margin = kSeparationMargin) noexcept;

} // namespace prolate::query
