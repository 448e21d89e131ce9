// Single ellipsoids: one pair at a time, or many.
//
// Batches are made for particles (granular media, crowds, swarms). There, each body belongs to many pairs. So bodies
// are placed once a step, by place(), in a form from which eight pairs can be tested at a time; and a pair is two
// indices, as a broadphase yields them. Pairs that eight single-precision lanes cannot certify go to the
// double-precision functions for single pairs. So the answers are those of single pairs, only faster.
//
// Every function here is noexcept, allocates nothing, keeps no state, may be called from many threads at once, and
// returns the same bits for the same input on every processor.
#pragma once

#include <prolate/query.hpp>
#include <prolate/types.hpp>

#include <cstdint>
#include <span>

namespace prolate {

/// Are two ellipsoids farther apart than `margin` (metres, at least 0)?
///
/// `separated` is certified: the distance is greater than the margin. `overlapping` means that it is not, or exceeds
/// the margin by so little that rounding hides it: by about 1e-13 of the lengths involved. With a margin above 0 and
/// axis ratios above 100, one pair in 10^5 is called overlapping though its distance exceeds the margin by up to 1e-5
/// of the ellipsoids' size.
///
/// Symmetric. A pose that is not finite, or whose quaternion is zero, never separates. The test is that of J. W.
/// Perram, M. S. Wertheim, "Statistical mechanics of hard ellipsoids", Journal of Computational Physics 58, 1985.
Verdict collide(const Ellipsoid& a, const Pose& pose_a, const Ellipsoid& b, const Pose& pose_b,
                float margin = 0) noexcept;

/// Distance of two ellipsoids, or their penetration depth, in world coordinates and metres.
struct PairDistance {
    /// Certified bounds of the signed distance. Above 0, it is the distance; below 0, minus the length of the shortest
    /// translation that separates the bodies. With lower > 0 they are certainly separated, with upper < 0 they
    /// certainly overlap. Then -lower is the smallest depth found (a local minimum), never less than the true one, and
    /// -upper is a certified depth, but a loose one.
    float lower, upper;
    Vec3 normal;           ///< unit vector from A to B: the direction in which B should move to get away
    Vec3 point_a, point_b; ///< nearest points; of overlapping bodies, the points that are deepest in the other body
};

/// Distance or depth of two ellipsoids. If they are separated, upper - lower is at most `tolerance` (metres) wherever
/// rounding allows (1e-13 of the lengths involved, and the rounding of the answer to floats).
PairDistance distance(const Ellipsoid& a, const Pose& pose_a, const Ellipsoid& b, const Pose& pose_b,
                      float tolerance = 0) noexcept;

/// A body as batches read it, in world coordinates: single precision, with a bound of what that loses. One cache line.
struct alignas(64) WorldEllipsoid {
    float center[3];
    float slack;     ///< bound of this body's share in the rounding error of a gap along a unit normal, metres
    float factor[6]; ///< l11, l21, l22, l31, l32, l33 of a factor of the rotated shape matrix
    float thinness;  ///< upper bound of 1 / smallest semi-axis
    float size;      ///< Frobenius norm of the factor, approximately
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
    uint64_t evaluations = 0; ///< directions for which eight pairs' gaps were evaluated
    uint64_t in_double = 0;   ///< pairs that went to double precision
};

/// verdicts[i] = collide() of pairs[i]. Both have the same length; indices must be below the number of bodies.
PairStats collide(const EllipsoidBodies& bodies, std::span<const IndexPair> pairs, std::span<Verdict> verdicts,
                  float margin = 0) noexcept;

/// distances[i] = distance() of pairs[i], but bounds, normals and points may differ within `tolerance` (metres). The
/// lanes reach about 1e-5 of the bodies' size; a smaller tolerance is as slow as single pairs. Bodies that overlap are
/// left to double precision.
PairStats distance(const EllipsoidBodies& bodies, std::span<const IndexPair> pairs, std::span<PairDistance> distances,
                   float tolerance) noexcept;

} // namespace prolate
