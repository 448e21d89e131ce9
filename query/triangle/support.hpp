// How far the triangles of a leaf reach along a direction, in double precision: the cheapest way to tell that two
// leaves are separated, if one knows along which direction to look.
//
// With n from A to B, of length 1 but for rounding, the triangles are apart by at least
//     n.t - support(A, n) - support(B, -R^T n),     x_A = R x_B + t.
// The terms of its error are those of separation.hpp: there B's corners are turned, here the direction, with the same
// error, so kSeparationMargin S pays for it; S = triangle_reach(A) + triangle_reach(B) + |t|.
#pragma once

#include <prolate/tree.hpp>

#include <glm/vec3.hpp>

namespace prolate::query {

/// The greatest n.x of the corners x of some triangles, body frame.
double triangle_support(const TreeView& tree, const TriangleRange& range, const glm::dvec3& n) noexcept;

/// Bounds the distance of an exact tree's corners, or of another's ellipsoids, from its frame's origin: they lie in the
/// root's bounding volume.
double triangle_reach(const TreeView& tree) noexcept;

} // namespace prolate::query
