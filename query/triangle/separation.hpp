// Are two triangles, or a triangle and an ellipsoid, separated? Scalar, in double precision.
//
// Any direction n whose plane leaves the bodies on different sides certifies that they are:
//     min n.(b_j - a_0) - max n.(a_i - a_0) > 0    (or with the bodies exchanged), for triangles a, b;
//     min n.(a_i - c) - |L^T n| > 0,               for a triangle and {c + L u : |u| <= 1},
// so candidates may be inexact: that costs decisions, never correctness. Touching triangles have no such plane, nor
// have coplanar ones that overlap, nor does a triangle inside an ellipsoid: all these meet.
//
// Candidates for triangles: the 11 directions of the separating axis theorem (both normals, the products of their
// edges) and the 6 edge normals in the planes, which coplanar triangles need (Gottschalk, Lin and Manocha 1996), from
// accurate edges; and the differences of the closest points of each two edges (Ericson 2005, section 5.1.9), one of
// which is the direction of the distance if no normal is, however degenerate the triangles. Candidates for a triangle
// and an ellipsoid: seen from the ellipsoid as the unit ball, the triangle's normal and the points of its edges closest
// to the center, one of which is the direction of the distance.
//
// Rounding, in the terms and with the bounds of query/ellipsoid/separation.hpp: |b_j| is wrong by 75 u |b_j| + 37 u
// |d|, n.(b_j - a_0) by 81 u |n| S, n.(a_i - a_0) by 8 u |n| S, and their difference by 91 u |n| S, S = max |a_i| + max
// |b_j| + |d|. For the ellipsoid, n.(a_i - c) and |L^T n| add up to 83 u |n| S. kSeparationMargin, 256 u, is demanded
// of both; so computed corners are separated too, by more than 90 u S, which the point-in-solid test builds on. What is
// not found separated is nearer than 1e-13 S in the tests' pairs, needles and slivers among them.
//
// Cost: 2 to 26 directions of about 40 flops; most pairs need one or two.
#pragma once

#include "query/ellipsoid/separation.hpp"
#include "query/triangle/placed.hpp"

namespace prolate::query {

/// True only if they have no common point; triangles: only if they are more than `distance` >= 0 apart. The margin is a
/// parameter only so that the tests can show that wrong ones are caught.
bool separated(const PlacedTriangle& a, const PlacedTriangle& b, double distance = 0,
               double margin = kSeparationMargin) noexcept;
bool separated(const PlacedTriangle& triangle, const PlacedEllipsoid& ellipsoid,
               double margin = kSeparationMargin) noexcept;

} // namespace prolate::query
