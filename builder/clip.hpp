// Convex polygons in space, cut by axis-aligned planes.
#pragma once

#include "builder/eigen.hpp"

#include <vector>

namespace prolate {

using Polygon = std::vector<Vec>;

/// Cuts the convex polygon `in` at the plane x[axis] = at into the parts below and above. Either may come out empty. A
/// polygon that only touches the plane goes to the side it is on; one that lies in the plane goes to both, so that the
/// closed cell on either side holds it. New corners get the coordinate `at` exactly.
/// Sutherland and Hodgman 1974, for one plane and both sides at once.
void split_polygon(const Polygon& in, int axis, double at, Polygon& below, Polygon& above);

} // namespace prolate
