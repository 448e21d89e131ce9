// When do two moving bodies meet? Continuous collision detection: nothing tunnels, however fast or thin it is.
// query.hpp says what bodies are and what the verdicts certify.
#pragma once

#include <prolate/collide.hpp>
#include <prolate/query.hpp>

#include <cstdint>
#include <limits>

namespace prolate {

/// A rigid motion during the time 0 ... 1, as integrators step bodies: one point of the body, usually its center of
/// mass, moves along a straight line at constant speed, and the body rotates about this point at a constant rate.
/// motion_between() makes the motion from one pose to another.
struct Motion {
    Pose start;
    Vec3 linear;  ///< displacement of `center`, world, metres: its velocity times the length of the step
    Vec3 angular; ///< rotation vector, world, radians: the angular velocity times the length of the step, full turns
                  ///< included; at most kMaxTurn long
    Vec3 center;  ///< the point rotated about, in the body's frame, metres
    friend bool operator==(const Motion&, const Motion&) = default;
};

/// Largest length of Motion::angular. A longer one leaves the answer undecided.
inline constexpr double kMaxTurn = 1e6;

/// The pose at time t, 0 ... 1, rounded to floats once. Thread-safe.
Pose pose_at(const Motion& motion, double t) noexcept;

/// The motion from `start` to `end` by the smaller angle, at most half a turn, about `center` (in the body's frame). It
/// arrives at `end` except for the rounding of floats. Thread-safe.
Motion motion_between(const Pose& start, const Pose& end, const Vec3& center = {}) noexcept;

/// Limits of a sweep() query.
struct SweepOptions {
    /// Bodies that come within margin + tolerance of each other may count as meeting, metres. Bodies that stay farther
    /// apart do not. A larger tolerance is faster. 0, negative and NaN stand for 1e-4 of the smaller body's size |L|, L
    /// the root's factor.
    ///
    /// Rounding sets a floor: smaller tolerances are raised to 2^-24 of both sizes, and to 2^-27 of all lengths
    /// involved (2^-38 * (1 + the angles rotated by) of them, if that is more).
    double tolerance = 0;
    /// Look no deeper than this level of either tree (0 = roots only). The bodies are then its coarser covers, which
    /// meet no later.
    uint32_t max_level = kMaxLevels;
    /// Stop before more than this many tests, of nodes and of triangles together, are made: QueryStats::tests(). Two
    /// leaves are looked at only if the budget suffices for all their pairs of triangles.
    uint64_t max_pair_tests = UINT64_MAX;
    /// Bodies at most this far apart count as meeting, metres. Negative counts as 0; with infinity or NaN, they meet at
    /// once.
    float margin = 0;
};

/// Answer of sweep().
struct SweepResult {
    /// separated: the bodies stay farther apart than the margin all the time. overlapping: they come within margin +
    /// tolerance of each other at time_upper, and no earlier within the margin. undecided: a limit was reached first.
    Verdict verdict = Verdict::undecided;
    /// Overlapping at time 0 because a part of one body lies inside the other; no surfaces meet, or the budget ended
    /// before any were found to.
    bool enclosed = false;
    /// Certified: at every time t < time_lower the solids are farther apart than the margin. 1 if separated.
    double time_lower = 0;
    /// A time at which the bodies are within margin + tolerance of each other; infinite if none is known. If
    /// overlapping, both times are the same, the time of impact; 0 if the bodies meet at the start.
    double time_upper = std::numeric_limits<double>::infinity();

    // The rest describes the bodies at time_upper, and means nothing if that is infinite.

    double distance = 0;   ///< upper bound of the bodies' distance, metres; 0 if they have a common point
    Vec3 point_a, point_b; ///< points of the two bodies, world, `distance` apart; not set if enclosed
    Vec3 normal;           ///< unit vector from point_a to point_b, world; 0 if the points coincide
    MeetingPair pair;      ///< the leaves that the points lie in, and their triangles; the roots if enclosed
    QueryStats stats;
};

/// The first time that `a` and `b` meet, or come within the margin of each other. Certified for the motions as they are
/// defined above, in real numbers: rounding errors are bounded and accounted for. Symmetric: swapping the bodies swaps
/// the answer. Thread-safe on shared trees. For a body at rest, leave linear and angular 0.
///
/// Anytime: with a larger max_pair_tests, time_lower never falls, time_upper never rises, and a verdict stays. A motion
/// that is not finite, rotates by more than kMaxTurn, or starts with a quaternion of zero leaves everything open:
/// undecided, time_lower = 0.
///
/// Conservative advancement (B. Mirtich, "Impulse-based Dynamic Simulation of Rigid Body Systems", PhD thesis,
/// Berkeley, 1996; X. Zhang, S. Redon, M. Lee, Y. J. Kim, "Continuous Collision Detection for Articulated Models Using
/// Taylor Models and Temporal Culling", ACM Transactions on Graphics 26(3), 2007) of pairs of nodes, each at its own
/// pace, the earliest first; query/sweep/search.cpp.
SweepResult sweep(const TreeView& a, const Motion& motion_a, const TreeView& b, const Motion& motion_b, Scratch context,
                  const SweepOptions& options = {}) noexcept;

} // namespace prolate
