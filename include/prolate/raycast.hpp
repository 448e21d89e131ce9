// Where does a ray first meet a body?
//
// query.hpp says what the verdicts certify, the ray in the place of the second body:
//  - separated:   no point of the ray lies in a leaf ellipsoid of a tree without triangles, or on a triangle of an
//                 exact tree, or within the margin of one.
//  - overlapping: the ray meets a leaf ellipsoid or a triangle, or passes so close that rounding hides the gap (about
//                 1e-12 of the lengths involved: the body's size and the distance of the ray's origin). So a ray never
//                 slips through an edge or a vertex, and a ray in the plane of a triangle meets it at its rim.
//  - undecided:   the budget ran out before a hit was found, or the pose or the ray is not finite, or the direction is
//                 0.
// Exact trees are hit at their triangles only, from either side, wherever the ray begins.
#pragma once

#include <prolate/query.hpp>

#include <cstdint>
#include <limits>
#include <span>

namespace prolate {

/// The points origin + t * direction with 0 <= t <= max_t, in the world. `direction` may have any length except 0; with
/// a unit vector, t is in metres. With a negative max_t there is no ray.
struct Ray {
    Vec3 origin;
    Vec3 direction{0, 0, 1};
    float max_t = std::numeric_limits<float>::infinity();
};

/// Answer of raycast().
struct RaycastResult {
    Verdict verdict = Verdict::undecided;
    /// Parameter of the hit. Infinite if there is none; then only `verdict`, `clear` and `stats` mean anything.
    /// Computed in double precision, with an error of about 1e-12 of the lengths involved, amplified where the ray
    /// grazes the surface.
    double t = std::numeric_limits<double>::infinity();
    /// Nothing is hit before this parameter. The same as t, unless the budget ran out or any hit was asked for; max_t
    /// if separated.
    double clear = 0;
    Vec3 point; ///< origin + t * direction, world
    /// Outward unit normal at the hit, world: of the ellipsoid, or of the triangle by its orientation, whichever side
    /// was hit. With a margin, the direction from the body's nearest point, which is point - margin * normal, to
    /// `point`. If there is no such direction (the ray begins inside an ellipsoid or within the margin, or the triangle
    /// has no area), it points against the ray.
    Vec3 normal;
    uint32_t node = 0;               ///< slot of the leaf that was hit, or of the node at max_level
    uint32_t triangle = kNoTriangle; ///< the triangle that was hit, of an exact tree
    QueryStats stats;
};

/// First hit of the ray with the body. With a margin, the first point of the ray that is within the margin of the body,
/// as if a ball of this radius flew along it. A ray that begins within the margin, or inside a leaf ellipsoid, hits at
/// t = 0; with an infinite or NaN margin, every ray does. Nodes at options.max_level count as the ellipsoids that hold
/// all that lies below them. Nodes are visited nearest first, and not at all beyond the best hit. Thread-safe on shared
/// trees. The search is described in query/raycast/search.cpp, the tests in query/raycast/ray.hpp.
RaycastResult raycast(const TreeView& tree, const Pose& pose, const Ray& ray, Scratch context,
                      const QueryOptions& options = {}) noexcept;

/// The same for many rays: out[i] is the answer for rays[i], to the bit, for as many as both spans have. What depends
/// on the body and its pose alone is prepared once.
void raycast(const TreeView& tree, const Pose& pose, std::span<const Ray> rays, std::span<RaycastResult> out,
             Scratch context, const QueryOptions& options = {}) noexcept;

/// The same as for one ray, but stops at any hit, which need not be the first: for shadows and lines of sight. The
/// verdict is that of raycast().
RaycastResult raycast_any(const TreeView& tree, const Pose& pose, const Ray& ray, Scratch context,
                          const QueryOptions& options = {}) noexcept;

} // namespace prolate
