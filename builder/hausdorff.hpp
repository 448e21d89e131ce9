// How far a union of ellipsoids sticks out of the solid: the one-sided Hausdorff distance from the one to the other.
//
// The distance d(x) of a point to the solid is 0 inside it. Its supremum over the union is found by branch and bound,
// over the ellipsoids' insides too: where the union fills a cavity, or the space between limbs, the worst point need
// not be on its boundary. Mean and percentile are over the union's boundary, by area, from evenly spread samples.
//
// Bounds: if n is the point of the solid that is nearest to some q, then d(x) <= |x - n| for every x. That is convex,
// so that its largest value over (cell ∩ ellipsoid) is bounded by those at the corners of the cell, cut by a plane that
// touches the ellipsoid. It is off by the square of the cell's size only: also where a whole surface is about equally
// far, the cells need not become as small as the tolerance. If q is inside, t below the surface, d(x) <= |x - q| - t.
#pragma once

#include "builder/eigen.hpp"
#include "builder/winding.hpp"

#include <prolate/types.hpp>

#include <cstdint>
#include <span>

namespace prolate {

/// Distances from a union of ellipsoids to the solid, metres. All are 0 for an empty union.
struct HausdorffDistance {
    double max = 0;       ///< some point of the union is as far as that
    double max_error = 0; ///< and none is farther than max + max_error
    double mean = 0;      ///< over the union's boundary (the share of it inside the solid counts 0)
    double p99 = 0;       ///< of all but 1 % of that boundary's area it is at most that
    double area = 0;      ///< of the union's boundary, square metres
    uint64_t samples = 0; ///< on that boundary; mean and area have a relative error of about 1 / sqrt(samples), or less
};

/// Measures `ellipsoids` against the solid: where the winding number of a closed mesh is not 0, and its triangles; of
/// an open mesh (`closed` false) the triangles alone. `tolerance`, metres and above 0, is what max_error is to be; only
/// if that takes unreasonably long it is more. About `samples` points are spread over the boundary, evenly by area.
/// In parallel; the same figures for any number of threads. Near-linear in the number of ellipsoids.
HausdorffDistance hausdorff_distance(std::span<const Ellipsoid> ellipsoids, const Winding& winding, bool closed,
                                     double tolerance, uint32_t samples = 20'000);

} // namespace prolate
