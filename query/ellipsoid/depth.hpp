// How deep are two ellipsoids in each other, at least? A certified bound that is tight, by branch and bound over all
// directions.
//
// The depth is the least value of h(n) = a(n) + b(n) - n.r over unit vectors n (gap.hpp), a function of several local
// minima, so that a minimum that was found certifies nothing. But a(n) = |L1^T n| >= w.L1^T n for every unit vector w,
// with equality for w = L1^T n / a. So with w1, w2 from some direction m, for all n
//     h(n) >= x.n,  x = L1 w1 + L2 w2 - r.
// On a spherical triangle with corners c, n is a sum of them with weights >= 0 that sum to at least 1: x.n >= min x.c
// if that is not negative. The sphere is an octahedron's eight triangles at first. m is a triangle's middle; one whose
// bound is less than 0.9 times the least h so far, and by more than a thousandth of the smaller body, is divided into
// four. A bound is wrong by the square of its triangle's size.
//
// Rounding. x is wrong by at most 100 u S (gap.hpp), S the sum of both reaches, and lengths and places of corners by 8
// u: where neighbours are divided and a triangle is not, a gap of that width is left, along which h changes by less
// than 8 u S. kSeparationMargin S, 256 u S, is taken off.
//
// Cost: about 100 flops a triangle; of pairs that overlap, some 130 triangles at axis ratios of 3 and 210 at 30.
#pragma once

#include "query/ellipsoid/separation.hpp"

namespace prolate::query {

/// A certified lower bound of the depth, metres: 0.9 of it, less a thousandth of the smaller body. 0 if they are not
/// certain to overlap, or once a direction shows that they are not deeper than `at_least`.
double least_depth(const PlacedEllipsoid& a, const PlacedEllipsoid& b, double at_least = 0) noexcept;

} // namespace prolate::query
