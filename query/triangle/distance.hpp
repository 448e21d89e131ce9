// How far are two triangles apart? Scalar, in double precision; bounds that hold in spite of rounding.
//
// Source: Ericson, Real-Time Collision Detection (2005), section 5.1.10: the closest points lie on two edges, or on a
// corner and a face; and where an edge pierces a face they coincide. Like Larsen et al. ("Fast proximity queries with
// swept sphere volumes", 1999) we stop as soon as the planes through the closest points so far separate as far as these
// points are apart.
//
// Upper bound: any two points of the triangles, taken as convex combinations of the computed corners, so that an
// inexact weight costs tightness only. Each is wrong by what the corners are, 75 u |b| + 37 u |d| or nothing
// (query/ellipsoid/separation.hpp), plus 4 u for the corner relative to A's first, of up to 2 S, and 12 u S for the
// combination: with the difference and its norm less than 110 u S. Lower bound: gap(n) / |n| of any direction n, wrong
// by 91 u S (separation.hpp) and 2 u S for the norm and the division. kSeparationMargin, 256 u S, is added and taken
// off.
//
// Cost: half of all pairs end after a few edges. The rest, among them all that meet, takes all 26 directions of
// separation.hpp. In the tests the bounds are at most 2e-9 S apart. So much only where the triangles are nearer than
// 1e-7 S: there the direction from one closest point to the other has lost its digits.
#pragma once

#include "query/triangle/separation.hpp"

namespace prolate::query {

/// A lower bound this near to the upper one cannot be improved by more than rounding.
inline constexpr double kTightBound = 1 - 0x1p-40;

struct TriangleDistance {
    double lower;          // the triangles are not nearer; 0 if they meet
    double upper;          // nor farther; infinite if a pose was not finite
    glm::dvec3 on_a, on_b; // points of the triangles, in A's frame, `upper` apart but for rounding
    // From A to B, of any length: along it the gap is `lower`. The way from on_a to on_b loses its digits sooner: where
    // edges are nearly parallel, points along them are equally near, and one pair of them says nothing of the
    // direction.
    glm::dvec3 normal{0, 0, 0};
};
/// With the same margin, `lower` is positive only if separated() of separation.hpp holds, and always if it does. The
/// margin is a parameter only so that the tests can show that wrong ones are caught.
TriangleDistance distance(const PlacedTriangle& a, const PlacedTriangle& b, double margin = kSeparationMargin) noexcept;
/// A lower bound from one direction n, of length 1 but for rounding, pointing from A to B.
double gap_along(const PlacedTriangle& a, const PlacedTriangle& b, const glm::dvec3& n) noexcept;

} // namespace prolate::query
