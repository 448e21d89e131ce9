// Where does a ray first meet a body?
//
// query.hpp says what the verdicts certify, the ray in the place of the second body:
//  - separated:   no point of the ray lies in a leaf ellipsoid of a tree without triangles, nor on a triangle of an
//  exact
//                 tree; with a margin, none comes as near to it as that.
//  - overlapping: the ray meets a leaf ellipsoid, or a triangle, or comes nearer to it than rounding error can tell
//                 apart (about 1e-12 of the lengths that enter: the body's size and the distance of the ray's origin).
//                 So a ray through an edge or a vertex never slips through, and one in the plane of a triangle meets it
//                 at its rim.
//  - undecided:   the budget ran out before a hit was found; or the pose or the ray is not finite, or the direction 0.
// Exact trees are met at their triangles only, from either side, wherever the ray begins.
#pragma once

#include <prolate/query.hpp>

#include <cstdint>
#include <limits>

namespace prolate {

/// The points origin + t direction, 0 <= t <= max_t, in the world. `direction` may have any length but 0; t counts in
/// multiples of it, so a unit vector makes it metres. A negative max_t leaves no ray.
struct Ray {
    Vec3 origin;
    Vec3 direction{0, 0, 1};
    float max_t = std::numeric_limits<float>::infinity();
};

/// Answer of raycast().
struct RaycastResult {
    Verdict verdict = Verdict::undecided;
    /// Of the hit; infinite without one, when only `clear` and `stats` mean something beside it. Computed in double
    /// precision: wrong by about 1e-12 of the lengths that enter, times how fast the hit moves as the ray does (large
    /// where it grazes).
    double t = std::numeric_limits<double>::infinity();
    /// Nothing is met before this t: the same as t, unless the budget ran out, or any hit was asked for; max_t if
    /// separated.
    double clear = 0;
    Vec3 point; ///< of the ray, in the world: origin + t direction
    /// Unit normal in the world, outwards: of the ellipsoid, or by the triangle's orientation, whichever side was met.
    /// With a margin, from the body's nearest point, which is point - margin * normal, to the ray's. Against the ray if
    /// there is none: if the ray begins inside an ellipsoid or within the margin, or the triangle has no area.
    Vec3 normal;
    uint32_t node = 0;               ///< the leaf that was hit, or the node at max_level
    uint32_t triangle = kNoTriangle; ///< of an exact tree's leaf
    QueryStats stats;
};

/// First hit of the ray with the body, or where it first comes as near as options.margin: what a ball of this radius
/// meets that flies along it. A ray that begins so near, or inside a leaf ellipsoid, hits it at t = 0. Nodes at
/// options.max_level count as the ellipsoids that hold all below them. Every margin has an answer (query.hpp): with an
/// infinite one or NaN, all rays hit at t = 0. Nodes are visited nearest first, and not at all beyond the best hit.
/// Thread-safe on shared trees. The descent is told in query/raycast/raycast.cpp, the tests in query/raycast/ray.hpp.
RaycastResult raycast(const TreeView& tree, const Pose& pose, const Ray& ray, QueryContext& context,
                      const QueryOptions& options = {}) noexcept;

/// The same, but stops at any hit, which may not be the first: for shadows and lines of sight. The verdict is that of
/// raycast().
RaycastResult raycast_any(const TreeView& tree, const Pose& pose, const Ray& ray, QueryContext& context,
                          const QueryOptions& options = {}) noexcept;

} // namespace prolate
