// Are two ellipsoids separated? The scalar test in double precision: two certificates, one direction at a time.
//
// Source: Perram and Wertheim, "Statistical mechanics of hard ellipsoids", J. Comput. Phys. 58 (1985) 409-416.
//
// With r = c2 - c1, Q(rho) = Q1 + rho Q2 and s = Q^-1 r, their contact function f(lambda), lambda = rho / (1 + rho), is
// concave, and f' = q1 - q2 with q1 = |L1^T s|^2, q2 = |rho L2^T s|^2. (rho in place of lambda keeps full relative
// precision for bodies of very different size.) For any rho > 0:
//   (1) p - a - b > 0, p = n.r, a = |L1^T n|, b = |L2^T n|    =>  a plane with normal n separates. Holds for ANY n, so
//       n = adj(Q) r needs no division, and an inexact n costs decisions, never correctness.
//   (2) q1 <= 1 and q2 <= 1                                   =>  c1 + Q1 s = c2 - rho Q2 s lies in both: they overlap.
// The best rho makes q1 = q2; there one of the two always holds, except at exact contact.
//
// Rounding. u = 2^-53. All inputs are floats, taken as exact. Norms are Euclidean, of matrices Frobenius.
//   quaternion -> R      products exact, sum and quotient 4 roundings: |dR| <= 29 u
//   T = R1^T R2          |dT| <= (29 + 29 + 3 * 3) u + O(u^2) <= 68 u
//   d = t2 - t1          rounded once; t = R1^T d: |dt| <= 36 u |d|
//   c2' = T c2 + t       |dc2'| <= 75 u |c2| + 37 u |d|
//   r = c2' - c1         |dr| <= 77 u (|c1| + |c2| + |d|)
//   L2' = T L2           |dL2'| <= 74 u |L2|;  L1 is exact
//   p                    |dp| <= 81 u |n| (|c1| + |c2| + |d|)
//   a, b                 |da| <= 7 u |n| |L1|, |db| <= 81 u |n| |L2|
//   p - a - b            two more roundings, 2 u |n| S
// so that the computed p - a - b is wrong by at most 83 u |n| S + O(u^2), S = |c1| + |c2| + |d| + |L1| + |L2|.
// Certificate (1) demands more than kSeparationMargin |n| S, 256 u: the rest pays for the rounding of the bound itself,
// and leaves room for bodies whose positions are wrong by the 75 u S above (query/inside/inside.hpp). n is scaled to
// max-norm 1, so underflow costs at most 2^-536, far below u S for any S a float can make. The world positions t1, t2
// enter by their difference only: bodies far from the origin lose nothing.
//
// Certificate (2), with Q scaled to trace 1 (units cannot underflow): |dQ| <= 160 u, |d adj| <= 490 u,
// |dn| <= 570 u S, |d det| <= 653 u, |da| <= 651 u S |L|. It is tightened by kOverlapMargin, 1024 u, times the same.
//
// Cost: about 150 flops an evaluation; random pairs take 1.1 evaluations, pairs near contact 3.
// Limits: at axis ratios far beyond 10^4 in both bodies adj(Q) loses so many digits that pairs close to contact stay
// unresolved. Up to 16384, the most that bakes make, the tests find none.
#pragma once

#include "query/ellipsoid/placed.hpp"

#include <cstdint>

namespace prolate::query {

inline constexpr double kSeparationMargin = 0x1p-45;
inline constexpr double kOverlapMargin = 0x1p-43;
inline constexpr uint32_t kMaxEvaluations = 16;

/// `unresolved`: no plane found, and the overlap not certified either (contact within rounding, or nearly parallel
/// needles, whose det(Q) has lost its digits). Callers treat it as overlapping. In the tests' million pairs, of axis
/// ratios up to 16384, no pair with a relative gap above 1e-9 ends here.
enum class PairVerdict : uint8_t { separated, overlapping, unresolved };
struct PairResult {
    PairVerdict verdict;
    uint32_t evaluations;
};

/// The margin is a parameter only so that the tests can show that wrong ones are caught.
PairResult test_pair(const PlacedEllipsoid& a, const PlacedEllipsoid& b,
                     double separation_margin = kSeparationMargin) noexcept;

} // namespace prolate::query
