// When do two moving bodies meet? Continuous collision detection: nothing tunnels, however fast and thin it is.
// query.hpp says what bodies are and what the verdicts certify.
#pragma once

#include <prolate/collide.hpp>
#include <prolate/query.hpp>

#include <cstdint>
#include <limits>

namespace prolate {

/// A rigid motion during the time 0 ... 1, as integrators step bodies: one point of the body, usually its center of
/// mass, moves straight and evenly, and the body turns about it at a constant rate. A velocity and an angular velocity,
/// times the length of the step, are what `linear` and `angular` want. What is between two poses: motion_between().
struct Motion {
    Pose start;
    Vec3 linear;  ///< where `center` moves, world, metres
    Vec3 angular; ///< rotation vector, world: the axis, times the angle in radians, full turns included; at most
                  ///< kMaxTurn long
    Vec3 center;  ///< the point turned about, in the body's frame, metres
    friend bool operator==(const Motion&, const Motion&) = default;
};

/// Longest Motion::angular that is understood; those beyond leave everything open.
inline constexpr double kMaxTurn = 1e6;

/// Where a motion has arrived at time t, 0 ... 1; rounded to floats once. Thread-safe.
Pose pose_at(const Motion& motion, double t) noexcept;

/// The motion from `start` to `end` by the smaller angle, at most half a turn, about `center` (in the body's frame).
/// Arrives there but for the rounding of floats. Thread-safe.
Motion motion_between(const Pose& start, const Pose& end, const Vec3& center = {}) noexcept;

/// Limits of a sweep() query.
struct SweepOptions {
    /// Bodies that come nearer than margin + tolerance count as meeting, metres; those that pass farther away do not.
    /// More is faster. 0, negative or NaN stand for 1e-4 of the smaller body's size. What is less than 2^-24 of both
    /// sizes, or than 2^-27 of all lengths that enter (2^-38 times 1 + the angles turned by, if that is more), counts
    /// as that much. Size: |L| of the root. Lengths: it, and what lies between the root and the origins.
    double tolerance = 0;
    /// Look no deeper than this level of either tree (0 = roots only): the bodies are then its coarser covers, which
    /// meet no later.
    uint32_t max_level = kMaxLevels;
    /// Stop before this many tests, of nodes and of triangles together, would be exceeded: QueryStats::tests(). Of two
    /// leaves, as many must be left as they have pairs.
    uint64_t max_pair_tests = UINT64_MAX;
    /// Inflate the bodies by this distance together, metres. Negative counts as 0; infinite or NaN: they meet at once.
    float margin = 0;
};

/// Answer of sweep().
struct SweepResult {
    /// separated: the bodies stay farther apart than the margin all the time. overlapping: at time_upper they are not
    /// farther apart than margin + tolerance, and had not been before. undecided: a limit was reached first.
    Verdict verdict = Verdict::undecided;
    /// overlapping at time 0 though no surfaces meet, or none were found to within the budget: a part of one body is
    /// inside the other
    bool enclosed = false;
    /// Certified: at every time t < time_lower the solids are farther apart than the margin. 1 if separated.
    double time_lower = 0;
    /// A time when the bodies are within margin + tolerance; infinite if none is known. If overlapping, both times
    /// are the same: the time of impact. 0 if the bodies meet at the start.
    double time_upper = std::numeric_limits<double>::infinity();
    /// The rest is about time_upper, unless it is infinite.
    double distance = 0;   ///< the bodies are not farther apart, metres; 0 if they have a common point
    Vec3 point_a, point_b; ///< points of the two bodies, in the world, so far apart; unless enclosed
    /// Unit vector from `a` to `b`, in the world, along which they are; 0 if the points coincide.
    Vec3 normal;
    MeetingPair pair; ///< leaves that the points lie in, and their triangles; the roots if enclosed
    QueryStats stats;
};

/// The first time that `a` and `b` meet, or come as near as the margin. Certified for the motions as they are defined
/// above, in real numbers: what double precision rounds off is paid for. Symmetric: swapping the bodies swaps the
/// answer. Thread-safe on shared trees. Of a body at rest, leave linear and angular 0.
///
/// Anytime: with a larger max_pair_tests, time_lower never falls, time_upper never rises, and a verdict stays. A motion
/// that is not finite, turns by more than kMaxTurn, or starts with a quaternion of zero leaves everything open:
/// undecided, time_lower = 0.
///
/// Conservative advancement of pairs of nodes, each at its own pace, the earliest first: Mirtich 1996, Zhang et al.
/// 2007, and query/sweep/sweep.cpp.
SweepResult sweep(const TreeView& a, const Motion& motion_a, const TreeView& b, const Motion& motion_b,
                  QueryContext& context, const SweepOptions& options = {}) noexcept;

} // namespace prolate
