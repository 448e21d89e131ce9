// Signed distance of two ellipsoids in double precision: how far apart, or how deep in each other, with the points and
// the normal where that is so, and certified bounds.
//
// Gap in direction n, |n| = 1, from body A towards body B, r = c2 - c1:
//     g(n) = n.r - a(n) - b(n),   a = |L1^T n|, b = |L2^T n|.
// The signed distance is d = max g: the distance of bodies that are separated; minus the penetration depth (the length
// of the shortest translation that separates them) of bodies that overlap. What is certified:
//   lower bound   d >= g(n) for any n, so also for one that is not optimal.
//   upper bound   x1 = c1 + Q1 n / a and x2 = c2 - Q2 n / b lie on the bodies: d <= |x2 - x1|. (r - Q1 n / a - Q2 n / b
//                 = x2 - x1 is also the gradient of g; where it is parallel to n both bounds agree.)
//   if z lies in both, with radial coordinates t1 = |L1^-1 (z - c1)| <= 1 and t2: A holds a ball about z of radius
//                 (1 - t1) w1, w1 the smallest semi-axis, and B likewise. In every direction n therefore
//                 a + b - n.r >= (1 - t1) w1 + (1 - t2) w2, so that d <= -(1 - t1) w1 - (1 - t2) w2.
// The last is a true bound but a loose one: about half of the depth for axis ratios up to 10. No cheap tight one is
// known, because the depth is the minimum of a function with several local minima. (w1 and w2 are themselves taken from
// below, by a factor of up to sqrt(3).)
//
// Rounding (u = 2^-53, S as in separation.hpp, the sum of both reaches). g / |n| is wrong by at most 85 u S
// (separation.hpp, and two roundings for the quotient). x1 and x2: the unit vector L^T n / |L^T n| is wrong by at most
// 5 u, L1 times it by 9 u |L1|, x2 by another 74 u |L2| + 75 u |c2| + 37 u |d| for its place; the difference and its
// length round by 8 u S: |x2 - x1| is wrong by at most 100 u S. Both bounds give way by kSeparationMargin S, 256 u S.
// The bound of depth takes t1 and t2 by the margins of certificate (2) of separation.hpp.
//
// The maximum. At it (Q1 / a + Q2 / b + g I) n = r: Perram and Wertheim's equation with a ball of radius g as a third
// body. So n is sought as n(rho, sigma) = M^-1 r, M = Q1 + rho Q2 + sigma I, with rho = a / b and sigma = a g: two
// unknowns, which Newton's method finds in log rho and sigma. Unlike Newton's on the sphere of n it is not troubled by
// needles and discs, whose g is almost a cone with its apex near the optimum. Where g > 0 the plain substitution
// rho <- a / b, sigma <- a g never lowers g: it maximises a minorant of g (a <= (a^2 / a0 + a0) / 2, the same for b,
// and |n| by the inequality of the means), so it replaces Newton steps that do not raise g. Where g < 0, ascent along
// the sphere with step halving does that.
//
// Complexity: about 300 flops an evaluation. Bounds 1e-9 of the bodies' size apart take 2.4 evaluations for random
// pairs of axis ratio 3 and 4.2 at 1000, near contact 4.3 and 5.7; depths take 4 to 9. Of pairs with axis ratios up to
// 1000, one in a thousand zigzags; its g is then climbed along the sphere, which leaves one in 300,000 with bounds more
// than 1e-9 of the size apart. Limits: the depth found is that
// of a local minimum (its bounds hold all the same). For bodies whose depth exceeds a third of their size, at axis
// ratios of 100 and more, one in fifty is not the least.
#pragma once

#include "query/ellipsoid/separation.hpp"

#include <glm/vec3.hpp>

#include <cstdint>

namespace prolate::query {

struct Gap {
    double lower, upper; ///< certified: lower <= signed distance <= upper
    glm::dvec3 normal;   ///< unit, from A to B; the lower bound is the gap along it
    glm::dvec3 point_a;  ///< on A, farthest along the normal
    glm::dvec3 point_b;  ///< on B, farthest against it. Overlapping bodies: point_a - point_b is about depth * normal
    uint32_t evaluations;
};

inline constexpr uint32_t kMaxNewtonEvaluations = 32, kMaxGapEvaluations = 160;

/// A lower bound of the smallest semi-axis, at most a factor of sqrt(3) too small, for a placed factor L of norm
/// `size`; 0 if rounding leaves nothing.
double least_width(const glm::dmat3& factor, double size) noexcept;

/// Distance, for bodies that are separated; it stops when upper - lower <= tolerance (metres; 0: until rounding stops
/// it). For bodies that overlap it stops as soon as that shows, and gives a normal to start depth_of() with; bounds
/// hold. `start_normal`: of an earlier, similar pair; any length, 0 if there is none. Input that is not finite gives
/// lower = -infinity, upper = infinity.
Gap distance_of(const PlacedEllipsoid& a, const PlacedEllipsoid& b, double tolerance,
                const glm::dvec3& start_normal = {0, 0, 0}) noexcept;

/// Are two leaves certainly farther apart than `margin` >= 0? All queries of trees decide so on the ellipsoids of two
/// leaves: placed alike (query/node/order.hpp), they get the same answer to the bit. With an infinite or NaN margin,
/// never.
bool separated(const PlacedEllipsoid& a, const PlacedEllipsoid& b, double margin = 0) noexcept;

/// Depth, for bodies that overlap: -lower is the least depth found, with the normal along which B leaves A soonest. It
/// stops when a step gains less than `tolerance`. -upper is a certified depth, if a loose one.
Gap depth_of(const PlacedEllipsoid& a, const PlacedEllipsoid& b, double tolerance,
             const glm::dvec3& start_normal = {0, 0, 0}) noexcept;

} // namespace prolate::query
