// How far apart are two bodies, and where? query.hpp says what bodies are. The distance of bodies that meet is 0, and
// meeting means what collide() means by it.
#pragma once

#include <prolate/collide.hpp>
#include <prolate/query.hpp>

#include <cstdint>
#include <limits>

namespace prolate {

/// Limits of a distance() query.
struct DistanceOptions {
    /// Stop as soon as upper - lower is at most this, metres, ...
    double tolerance_absolute = 0;
    /// ... or at most this part of upper; clamped to 1e-12 ... 1. Neither tolerance ends the search before it is
    /// certain whether the bodies meet. Where they nearly touch, rounding limits the accuracy to 4e-9 of the lengths
    /// involved (the bodies' sizes and their distances from their origins). Negative and NaN count as 0.
    double tolerance_relative = 1e-6;
    /// Stop as soon as it is certain that the bodies are at least this far apart, metres. Distant bodies then cost
    /// little. Negative counts as 0, NaN as infinite.
    double max_distance = std::numeric_limits<double>::infinity();
    /// Look no deeper than this level of either tree (0 = roots only) to improve the lower bound, which is then the
    /// distance of the coarser covers. The upper bound comes from one descent to the leaves in any case.
    uint32_t max_level = kMaxLevels;
    /// Stop before this many tests, of nodes and of triangles together, would be exceeded: QueryStats::tests(). What
    /// is tested at once, two leaves or the few triangles below two nodes, needs as many as it has pairs.
    uint64_t max_pair_tests = UINT64_MAX;
};

/// Temporal coherence of one pair of bodies: where the last query found the smallest distance. Owned by the caller, 20
/// bytes. Reset it (`= {}`) when a body's tree changes. What is certified is the same with and without. The counters
/// may differ, the bounds within the tolerance, and which of several points that are equally near within it are named.
struct DistanceCache {
    bool valid = false;
    MeetingPair pair;
};
static_assert(sizeof(DistanceCache) == 20);

/// Answer of distance().
struct DistanceResult {
    /// separated: lower > 0. overlapping: collide() says so, too; lower is 0, and upper is 0 except for rounding, at
    /// most 1e-7 of the lengths involved. undecided: a limit was reached before it was known.
    Verdict verdict = Verdict::undecided;
    /// Overlapping because a part of one body lies inside the other; no surfaces meet, or the budget ended before any
    /// were found to.
    bool enclosed = false;
    /// Certified: lower <= distance <= upper, metres. The bodies are those of the full trees, whatever the limits were.
    /// `upper` is infinite if the limits kept the search from reaching any pair of leaves; then the fields below mean
    /// nothing.
    double lower = 0, upper = std::numeric_limits<double>::infinity();
    /// Points of the two bodies, world, `upper` apart; not set if enclosed. Computed in double precision and rounded
    /// once to these floats: off by at most 2^-23 of the largest length involved (coordinates of the points in the body
    /// and in the world, and the bodies' translations).
    Vec3 point_a, point_b;
    /// Unit vector from point_a to point_b, world; 0 if the points coincide.
    Vec3 normal;
    /// The leaves that the points lie in, and their triangles, as in collide(); the roots if enclosed.
    MeetingPair pair;
    QueryStats stats;
};

/// Distance of `a` at `pose_a` and `b` at `pose_b`. Symmetric: swapping the bodies swaps the answer. Thread-safe on
/// shared trees.
///
/// Anytime: a tight budget only widens the bounds. With a larger max_pair_tests, lower never falls, upper never rises,
/// and a verdict stays. With a larger max_level, the same holds of the bounds, to within the tolerance. Whether one
/// body holds a part of the other is settled first, where that is possible at all. A pose that is not finite, or whose
/// quaternion is zero, leaves everything open: undecided, 0 <= distance <= infinity.
///
/// Branch and bound over pairs of nodes (D. E. Johnson, E. Cohen, "A Framework for Efficient Minimum Distance
/// Computations", IEEE International Conference on Robotics and Automation, 1998); query/distance/search.cpp.
DistanceResult distance(const TreeView& a, const Pose& pose_a, const TreeView& b, const Pose& pose_b, Scratch context,
                        const DistanceOptions& options = {}, DistanceCache* cache = nullptr) noexcept;

} // namespace prolate
