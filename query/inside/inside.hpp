// Does a point lie inside the solid that an exact tree's triangles bound?
//
// The winding number of a closed surface around a point is the number of triangles that a ray from it leaves through,
// less those that it enters through. The ray runs along an axis of the tree's own frame, so nothing but the point is
// rotated; of the six directions that one is taken which meets the fewest children of the root. It is counted exactly
// (crossing.hpp), so the answer is right for every point that is farther from the surface than the rounding of its own
// coordinates and that of the vertices; nearer ones may count as inside or outside. For such points, and for surfaces
// with open edges, the direction may decide.
//
// Nodes are culled eight at a time (axis_lanes-inl.hpp).
#pragma once

#include "query/ellipsoid/placed.hpp"

#include <prolate/query.hpp>

#include <cstdint>
#include <optional>

namespace prolate::query {

/// Winding number of the surface of `tree`, which has triangles and is closed, around the point. Counts in `stats`;
/// empty if stats.tests() would exceed `most_tests`.
std::optional<int64_t> winding_number(const TreeView& tree, const PlacedPoint& point, QueryStats& stats,
                                      uint64_t most_tests) noexcept;

} // namespace prolate::query
