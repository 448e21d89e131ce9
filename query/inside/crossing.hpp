// How a ray along an axis crosses triangles, exactly: what a winding number counts.
//
// Each vertex minus the ray's origin is rounded once (by less than 2^-53 of its length), the same for all triangles
// that share it; of that nearby mesh the crossings are counted exactly:
//  - does the ray hit the triangle: signs of 2x2 determinants, from the order of two products and, if they round to the
//    same, of their errors. Ties are broken as if the point were moved by (t, t^2, 0), t -> 0 (Edelsbrunner and Muecke
//    1990, simulation of simplicity), so that a ray through an edge or a vertex is counted once;
//  - ahead or behind: sign of the 3x3 determinant, if the corners do not tell, as an exact sum (Shewchuk 1997, Adaptive
//    Precision Floating-Point Arithmetic, Grow-Expansion).
// All this is for the ray along +z; a ray along another axis is turned there by exchanging coordinates and flipping
// signs, which rounds nothing.
#pragma once

#include <prolate/tree.hpp>

#include <glm/vec3.hpp>

#include <cstdint>

namespace prolate::query {

/// A direction of a ray: the axis 0 ... 2, or its opposite.
struct AxisDirection {
    uint32_t axis = 2;
    bool negative = false;
};

/// Times that the ray from `origin` leaves through the triangles, less those that it enters through them.
int64_t crossings(const TreeView& tree, const TriangleRange& triangles, const glm::dvec3& origin,
                  const AxisDirection& direction) noexcept;

} // namespace prolate::query
