// What all queries share: verdicts, limits, counters, scratch. Queries ask about rigid bodies whose shapes are
// ellipsoid trees: collide.hpp, distance.hpp, contacts.hpp, sweep.hpp, raycast.hpp, shapes.hpp; pairs.hpp asks about
// two single ellipsoids, world.hpp about many bodies at once.
//
// Every query is noexcept, allocates nothing, keeps no state but what the caller hands in, and returns the same bits
// for the same input, on every processor and from every compiler that keeps to IEEE 754 (README, "Determinism"). Trees
// may be shared between threads; a context or cache belongs to one query at a time.
//
// What a body is, for all of them:
//  - a tree without triangles is the union of its leaf ellipsoids, exactly as they decode, filled. The leaves of a
//    prefix are the nodes of its last level. Inner nodes do not matter: they only tell soon where no leaf is.
//  - an exact tree is its triangles, and if its mesh is closed, all that they enclose.
// (A prefix of an exact tree covers the surface and is no body: of it, only *separated* and lower bounds are
// certified.)
//
// What is certified, for trees that cover their solids:
//  - separated:   a plane was found between every pair of leaves, or of nodes above them, beyond the rounding error of
//                 the test. The bodies do not touch, and so neither do the solids.
//  - overlapping: two leaf ellipsoids have a common point (or come nearer than rounding error can tell apart). The
//                 covers meet; the solids may still be apart by what the covers stick out.
//  - undecided:   a budget ran out first. Nothing is claimed.
// Of exact trees:
//  - separated:   neither do the triangles of the two bodies touch, nor does a closed one enclose a part of the other.
//  - overlapping: two triangles have a common point (coplanar and touching ones too; or come nearer than rounding error
//                 can tell apart, about 1e-13 of the lengths that enter), or a vertex of one body lies inside the
//                 other. Against a tree without triangles, its leaf ellipsoids take the triangles' place.
// Two leaves, or triangles, are decided on by one test with the bodies in one order, so all queries of the same two
// bodies give the same verdict to the bit: collide(), collide_all() (`found`), distance(), contacts(), and those of a
// world. sweep() has a tolerance: where it separates collide() does, and where that overlaps at the start, it says so.
//
// A pose that is not finite, or whose quaternion is zero, never separates. Lengths are defined for every number:
// margins, radii, half extents and max_distance that are negative count as 0, and NaN as infinite; with an infinite
// margin, all bodies meet. Tolerances that are negative or NaN count as 0.
#pragma once

#include <prolate/tree.hpp>
#include <prolate/types.hpp>

#include <cstddef>
#include <cstdint>

namespace prolate {

enum class Verdict : uint8_t { separated, overlapping, undecided };

/// Limits of a query.
struct QueryOptions {
    /// Look no deeper than this level of either tree (0 = roots only): where the descent would go deeper, two nodes
    /// that the culling test cannot tell apart count as meeting, with all that may lie below them. Which pairs of nodes
    /// are tested does not depend on it, so deeper never contradicts shallower: a shallow *separated* holds at every
    /// depth. Ellipsoids of exact trees cover surfaces; short of the leaves nothing is said of what they enclose, nor
    /// is it by a prefix of such a tree.
    uint32_t max_level = kMaxLevels;
    /// Stop before this many tests, of nodes and of triangles together, would be exceeded: QueryStats::tests().
    uint64_t max_pair_tests = UINT64_MAX;
    /// Inflate the bodies by this distance together, metres: bodies not farther apart than this count as meeting.
    /// Negative counts as 0; infinite or NaN: all meet.
    float margin = 0;
};

/// Work that a query did.
struct QueryStats {
    uint64_t pair_tests = 0;     ///< nodes tested against a node, a shape or a ray
    uint64_t block_tests = 0;    ///< blocks of up to eight siblings that were tested at once: the unit of time
    uint64_t triangle_tests = 0; ///< triangles tested against triangles, leaf ellipsoids, shapes or rays
    uint32_t deepest_level = 0;  ///< deepest level that a tested node came from

    uint64_t tests() const noexcept { return pair_tests + triangle_tests; } ///< what a budget is spent on
};

inline constexpr uint32_t kNoTriangle = UINT32_MAX;

/// Scratch of a query, owned by the caller: 80 KiB, so rather on the heap than on a thread's stack. Reusable for any
/// number of queries of any kind, by one query at a time. Needs no initialisation.
struct QueryContext {
    /// A pair of nodes still to be looked at. What the last two mean is up to the query.
    struct Entry {
        uint32_t node_a, node_b;
        float bound;
        uint32_t flags;
    };
    static constexpr size_t kEntries = 5120;
    alignas(64) Entry entries[kEntries];
};
static_assert(sizeof(QueryContext) == 80 * 1024);

} // namespace prolate
