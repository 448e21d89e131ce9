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
    /// ... or at most this share of upper, 1e-12 ... 1: less and more count as that. Neither ends the search before it
    /// is certain whether the bodies meet. Where they nearly touch, rounding permits no better than 4e-9 of the lengths
    /// that enter (sizes and distances of the bodies from their origins). Negative and NaN count as 0.
    double tolerance_relative = 1e-6;
    /// Stop as soon as it is certain that the bodies are at least so far apart, metres: those that are cost little.
    /// Negative counts as 0, NaN as infinite.
    double max_distance = std::numeric_limits<double>::infinity();
    /// Look no deeper than this level of either tree (0 = roots only) to improve the lower bound, which is then the
    /// distance of the coarser covers. The upper bound comes from one descent to leaves, whatever this is.
    uint32_t max_level = kMaxLevels;
    /// Stop before this many tests, of nodes and of triangles together, would be exceeded: QueryStats::tests(). Of two
    /// leaves, as many must be left as they have pairs.
    uint64_t max_pair_tests = UINT64_MAX;
};

/// Temporal coherence of one pair of bodies, owned by the caller: where the last query found the least distance. Reset
/// it (`= {}`) when a body's tree changes. What is certified is the same with and without; which of several points that
/// are equally near within the tolerance are named, the bounds within it, and the counters may differ.
struct DistanceCache {
    bool valid = false;
    MeetingPair pair;
};
static_assert(sizeof(DistanceCache) == 20);

/// Answer of distance().
struct DistanceResult {
    /// separated: lower > 0. overlapping: as collide() says it; lower = 0, and upper = 0 but for rounding, at most 1e-7
    /// of the lengths that enter. undecided: a limit was reached before it was known.
    Verdict verdict = Verdict::undecided;
    /// overlapping though no surfaces meet, or none were found to within the budget: a part of one body lies inside the
    /// other
    bool enclosed = false;
    /// Certified: lower <= distance <= upper, metres. The bodies are those of the full trees, whatever the limits were.
    /// Infinite `upper`: no limit was large enough to reach a pair of leaves; then there is no witness either.
    double lower = 0, upper = std::numeric_limits<double>::infinity();
    /// Points of the two bodies, in the world, `upper` apart. Computed in double precision, and rounded once to these
    /// floats: wrong by at most 2^-23 of the largest length that enters (coordinates of the points in body and world,
    /// and the bodies' translations). Unless enclosed.
    Vec3 point_a, point_b;
    /// Unit vector from `a` to `b`, in the world, along which they are `upper` apart; 0 if the points coincide.
    Vec3 normal;
    /// Leaves that the points lie in, and their triangles, as in collide(); the roots if enclosed.
    MeetingPair pair;
    QueryStats stats;
};

/// Distance of `a` at `pose_a` and `b` at `pose_b`. Symmetric: swapping the bodies swaps the answer. Thread-safe on
/// shared trees.
///
/// Anytime: a tight budget widens the bounds, no more. With a larger max_pair_tests, lower never falls, upper never
/// rises, and a verdict stays; the same holds of the bounds for max_level but for the tolerance. Whether one body holds
/// a part of the other is settled first, where it may. A pose that is not finite, or whose quaternion is zero, leaves
/// everything open: undecided, 0 <= distance <= infinity.
///
/// Branch and bound over pairs of nodes; Johnson and Cohen 1998, and query/distance/distance.cpp.
DistanceResult distance(const TreeView& a, const Pose& pose_a, const TreeView& b, const Pose& pose_b,
                        QueryContext& context, const DistanceOptions& options = {},
                        DistanceCache* cache = nullptr) noexcept;

} // namespace prolate
