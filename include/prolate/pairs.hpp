// Single ellipsoids: one pair at a time, or many.
//
// Batches are made for particles (granular media, crowds, swarms): each body lies in many pairs, so it is placed once a
// step (place()) in a form that eight pairs at a time can be tested from, and pairs are two indices each, as a
// broadphase gives them. What eight single-precision lanes cannot certify goes to the double-precision functions for
// single pairs, so that answers are those of single pairs, only sooner.
//
// Every function here is noexcept, allocates nothing, keeps no state, may be called from many threads at once, and
// returns the same bits for the same input on every processor.
#pragma once

#include <prolate/query.hpp>
#include <prolate/types.hpp>

#include <cstdint>
#include <span>

namespace prolate {

/// Are two ellipsoids farther apart than `margin` (metres, at least 0)? `separated` is certified: their distance is
/// greater than the margin. `overlapping`: it is not, or comes so close to it that rounding (about 1e-13 of the lengths
/// that enter) cannot tell; with a margin, of one in 10^5 pairs of axis ratios above 100, within 1e-5 of their size.
/// Symmetric. A pose that is not finite, or whose quaternion is zero, never separates. Perram and Wertheim 1985.
Verdict collide(const Ellipsoid& a, const Pose& pose_a, const Ellipsoid& b, const Pose& pose_b,
                float margin = 0) noexcept;

/// Distance of two ellipsoids, or their penetration depth, in world coordinates and metres.
struct PairDistance {
    /// Certified bounds of the signed distance: above 0, bodies are that far apart; below 0, minus the length of the
    /// shortest translation that parts them. Bodies with lower > 0 are certainly apart, with upper < 0 they certainly
    /// overlap. -lower is then the least depth found (a local minimum), never less than the true one; -upper is a
    /// certified depth, but a loose one.
    float lower, upper;
    Vec3 normal;           ///< unit, from A to B: the direction in which B should move to get away
    Vec3 point_a, point_b; ///< nearest points; of overlapping bodies, those that are deepest in the other
};

/// Distance or depth of two ellipsoids. Of bodies that are apart, upper - lower is at most `tolerance` (metres)
/// wherever rounding allows (1e-13 of the lengths that enter, and the rounding of the answer to floats).
PairDistance distance(const Ellipsoid& a, const Pose& pose_a, const Ellipsoid& b, const Pose& pose_b,
                      float tolerance = 0) noexcept;

/// A body as batches read it, in world coordinates: single precision, with a bound of what that loses.
/// One cache line.
struct alignas(64) WorldEllipsoid {
    float center[3];
    float slack;     ///< bound of the errors that this body brings into a gap along a unit normal, metres
    float factor[6]; ///< l11, l21, l22, l31, l32, l33 of a factor of the turned shape matrix
    float thinness;  ///< upper bound of 1 / smallest semi-axis
    float size;      ///< Frobenius norm of the factor, about
};

/// One pair of a batch: indices of bodies.
struct IndexPair {
    uint32_t a, b;
};

/// The bodies of a batch, one element each in three arrays of equal length; `world` comes from place().
struct EllipsoidBodies {
    std::span<const Ellipsoid> shapes;
    std::span<const Pose> poses;
    std::span<const WorldEllipsoid> world;
};

/// Places bodies for batches: world[i] from shapes[i] at poses[i]. All three have the same length.
void place(std::span<const Ellipsoid> shapes, std::span<const Pose> poses, std::span<WorldEllipsoid> world) noexcept;

/// Work that a batch did.
struct PairStats {
    uint64_t evaluations = 0; ///< evaluations of certificates in lanes
    uint64_t in_double = 0;   ///< pairs that went to double precision
};

/// verdicts[i] = collide() of pairs[i]. Both have the same length; indices must be below the number of bodies.
PairStats collide(const EllipsoidBodies& bodies, std::span<const IndexPair> pairs, std::span<Verdict> verdicts,
                  float margin = 0) noexcept;

/// distances[i] = distance() of pairs[i], though perhaps with other bounds, normals and points within `tolerance`
/// (metres). Lanes reach about 1e-5 of the bodies' size; a smaller tolerance is as slow as single pairs. Bodies that
/// overlap are left to double precision.
PairStats distance(const EllipsoidBodies& bodies, std::span<const IndexPair> pairs, std::span<PairDistance> distances,
                   float tolerance) noexcept;

} // namespace prolate
