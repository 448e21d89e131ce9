// Cutting a polygon into triangles, exactly.
#pragma once

#include <prolate/types.hpp>

#include <cstdint>
#include <span>
#include <vector>

namespace prolate {

/// Cuts the polygon of these corners (indices of `points`) into size - 2 triangles and appends them to `out`, in the
/// polygon's orientation. The polygon may be concave, may touch itself in points and along edges (a hole joined to the
/// border by a cut), may repeat points and have collinear ones: every corner stays a corner of some triangle, so that
/// neighbours still fit. It is seen along the axis that it faces most. False, with `out` as before, if the triangles
/// would overlap: then the polygon crosses itself. O(n^1.5) for usual polygons of n corners, O(n^2) at worst.
bool triangulate(std::span<const Vec3> points, std::span<const uint32_t> corners, std::vector<Triangle>& out);

/// How far the corners lie from the plane through their mean across their (Newell) normal; 0 if they have none.
double distance_from_flat(std::span<const Vec3> points, std::span<const uint32_t> corners);

} // namespace prolate
