// How far are a triangle and an ellipsoid apart? Scalar, in double precision; bounds that hold in spite of rounding.
//
// The distance of a point x from the ellipsoid {c + L u : |u| <= 1}, Q = L L^T, is convex in x, so its least value on
// the triangle lies where the face is parallel to the ellipsoid's tangent plane, or on an edge, where its derivative
// along the edge changes sign: found by regula falsi (Dowell and Jarratt 1971, Illinois), the direction of the distance
// of a point by query/ellipsoid/nearest_direction.hpp.
//
// Upper bound: the distance of any point of the triangle and any of the ellipsoid. Lower bound: the gap along any
// direction. Both are wrong by at most 100 u S, by the terms of query/ellipsoid/gap.hpp and separation.hpp;
// kSeparationMargin S, 256 u S, is added and taken off. So inexact points and directions cost tightness only.
//
// Cost: 1 to 40 evaluations of about 300 flops; a tree with triangles against one without is rare.
#pragma once

#include "query/triangle/distance.hpp"

namespace prolate::query {

/// TriangleDistance::on_a lies on the triangle, on_b on the ellipsoid. The margin is a parameter only so that the tests
/// can show that wrong ones are caught.
TriangleDistance distance(const PlacedTriangle& triangle, const PlacedEllipsoid& ellipsoid,
                          double margin = kSeparationMargin) noexcept;

} // namespace prolate::query
