// Does a point lie inside the solid that an exact tree's triangles bound?
//
// The winding number of a closed surface around a point is the number of triangles that a ray from it leaves through,
// less those that it enters through. The ray is the tree's own +z axis, so nothing but the point is rotated.
//
// Exact: each vertex minus the point is rounded once (by less than 2^-53 of its length), the same for all triangles
// that share it; of that nearby mesh the crossings are counted exactly:
//  - does the ray hit the triangle: signs of 2x2 determinants, from the order of two products and, if they round to the
//    same, of their errors. Ties are broken as if the point were moved by (t, t^2, 0), t -> 0 (Edelsbrunner and Muecke
//    1990, simulation of simplicity), so that a ray through an edge or a vertex is counted once;
//  - ahead or behind: sign of the 3x3 determinant, if the corners do not tell, as an exact sum (Shewchuk 1997, Adaptive
//    Precision Floating-Point Arithmetic, Grow-Expansion).
// So the answer is right for every point that is farther from the surface than the rounding of its own coordinates and
// that of the vertices; nearer ones may count as inside or outside.
//
// Nodes are culled by the boxes of their ellipsoids, widened by kSeparationMargin of all lengths that enter.
#pragma once

#include "query/separation.hpp"

#include <prolate/tree.hpp>

#include <glm/vec3.hpp>

#include <cstdint>
#include <optional>

namespace prolate::query {

/// A point in the tree's frame, and the lengths that went into it: its share of S (separation.hpp).
struct PlacedPoint {
    glm::dvec3 position;
    double reach;
};
PlacedPoint place(const Vec3& p, const RelativePose& to_frame) noexcept;

/// Winding number of the surface of `tree`, which has triangles and is closed, around the point. Counts each node that
/// it looks at in `tests`; empty if that would exceed `most_tests`.
std::optional<int64_t> winding_number(const TreeView& tree, const PlacedPoint& point, uint64_t& tests,
                                      uint64_t most_tests) noexcept;

} // namespace prolate::query
