// One distance() query: what the vectorised traversal (search.cpp) and the decisions at its leaves (leaves.cpp) share.
// Everything in the frame of body A, in metres.
#pragma once

#include "query/node/lattice.hpp"
#include "query/node/limits.hpp"
#include "query/node/order.hpp"
#include "query/node/scratch.hpp"
#include "query/node/tree_side.hpp"
#include "query/triangle/distance.hpp"
#include "query/triangle/slab.hpp"

#include <prolate/distance.hpp>

#include <glm/vec3.hpp>

#include <algorithm>
#include <cstdint>
#include <limits>

namespace prolate::query {

struct DistanceSearch {
    TreeSide a, b;
    const RelativePose b_to_a;
    const LatticePose lattice_b_to_a, lattice_a_to_b;
    const DistanceOptions options; // sound
    const double radii;            ///< of rounded bodies, whose cores are looked at
    Scratch::Entry* const entries;
    const uint32_t room; ///< for entries that wait in the heap
    QueryStats stats;

    bool complete = false;    ///< no budget ran out
    bool overlapping = false; ///< the witness meets
    /// Does one body hold a part of the other? Settled before the traversal, so that no budget that settles more of
    /// that leaves too little for this.
    Verdict enclosure = Verdict::separated;
    /// Of all pairs of leaves: those decided are not nearer than `decided`, those ruled out than `skipped`, and those
    /// still open, when a limit ended the search, than `open`.
    double decided = kInfinity, skipped = kInfinity, open = kInfinity;
    /// The nearest pair found, no farther apart than `upper`.
    double upper = kInfinity;
    MeetingPair witness;
    glm::dvec3 on_a{0, 0, 0}, on_b{0, 0, 0};
    glm::dvec3 normal{0, 0, 0};   ///< unit, from on_a to on_b; 0 if they coincide or are not known
    glm::dvec3 normal_b{0, 0, 0}; ///< the same as B's frame has it
    uint32_t normals_found = 0;   ///< of which this is the last

    DistanceSearch(const OrderedBodies<Pose>& bodies, Scratch context,
                   const DistanceOptions& distance_options) noexcept;

    /// Pairs whose bound is at least this, > 0, need not be looked at: they cannot improve the answer by more than the
    /// tolerance, nor meet.
    double enough() const {
        // Not less by its rounding: pairs are left out just here.
        const double improving = upper < kInfinity ? (upper - tolerance(upper)) * (1 + 0x1p-52) : kInfinity;
        return std::max(std::min(options.max_distance, improving), std::numeric_limits<double>::min());
    }
    /// Notes a pair of this bound if it need not be looked at.
    bool skips(double bound) {
        if (!(bound >= enough())) return false;
        skipped = std::min(skipped, bound);
        return true;
    }
    /// How far bounds around this distance of the cores may be from each other: a share of what the radii leave of it.
    double tolerance(double distance) const {
        const double left = distance > radii ? distance - radii : distance;
        return std::max(options.tolerance_absolute, options.tolerance_relative * left);
    }
    double reach_of_triangles() const { return triangle_reach_; } ///< S of query/triangle/support.hpp
    /// Tests left of the budget.
    uint64_t left() const { return tests_left(options.max_pair_tests, stats.tests()); }
    double lower() const { return std::max(0.0, std::min({decided, skipped, open, upper})); }

    /// A lower bound on the distance of what is below two nodes, from slabs (query/triangle/slab.hpp): not positive, or
    /// NaN, if they say nothing.
    double slabs_apart(const NodeWithHull& node_a, const NodeWithHull& node_b) const noexcept;

    /// Decides on two leaves that are not nearer than `bound`. Sets `overlapping` if they meet. False, and nothing
    /// done, if the budget may not suffice.
    bool decide(uint32_t node_a, uint32_t node_b, double bound) noexcept;
    /// Decides on two triangles, of leaves that are not nearer than `bound`, which do not matter if they are at least
    /// `limit` apart. Does not count them.
    void decide_triangles(const MeetingPair& pair, double limit, double bound) noexcept;
    /// The same as decide() for what an earlier query found, which is not trusted to be of these trees.
    bool try_first(const MeetingPair& pair) noexcept;

    static constexpr double kInfinity = std::numeric_limits<double>::infinity();
    static constexpr double kLeastTolerance = 1e-12, kMostTolerance = 1;

private:
    double triangle_reach_; // S of query/triangle/support.hpp

    void take(const TriangleDistance& found, const MeetingPair& pair, double bound, bool meet) noexcept;
    void decide_ellipsoids(uint32_t node_a, uint32_t node_b, double bound) noexcept;
    void decide_triangles(uint32_t node_a, uint32_t node_b, TriangleRange in_a, TriangleRange in_b,
                          double bound) noexcept;
};

/// Bound on the distance of the roots, from spheres around them, in double precision.
double root_bound(const DistanceSearch& search) noexcept;

/// The traversal: leaves every pair of leaves decided, skipped or open.
void traverse(DistanceSearch& search) noexcept;

} // namespace prolate::query
