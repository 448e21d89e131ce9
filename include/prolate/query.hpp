// What all queries share: verdicts, limits, counters, scratch. Queries ask about rigid bodies whose shapes are
// ellipsoid trees: collide.hpp, distance.hpp, contacts.hpp, sweep.hpp, raycast.hpp, shapes.hpp, bounds.hpp. solids.hpp
// asks about the solids that covers stand for, pairs.hpp about two single ellipsoids, poses.hpp about many poses of two
// bodies, world.hpp and world_queries.hpp about many bodies.
//
// Every query is noexcept, allocates nothing, keeps no state except what the caller hands in, and returns the same bits
// for the same input, on every processor and from every compiler that follows IEEE 754 (README, "Determinism"). Trees
// may be shared between threads; a context or cache belongs to one query at a time.
//
// What a body is, for all queries:
//  - A tree without triangles is the union of its solid leaf ellipsoids, exactly as they decode. The leaves of a prefix
//    are the nodes of its last level and the leaves above it. Inner nodes only help to rule out regions early; they
//    have no influence on the answer.
//  - An exact tree is its triangles, and if its mesh is closed, all that they enclose.
//  - A prefix of an exact tree covers the surface but is no body. Only *separated* and lower bounds are certified of
//  it.
//
// What is certified, for trees that cover their solids:
//  - separated:   a plane was found between every two leaves, or between nodes above them, beyond the rounding error of
//                 the test. The bodies do not touch, so the solids do not either.
//  - overlapping: two leaf ellipsoids have a common point (or are so close that rounding hides the gap). The covers
//                 meet; the solids may still be separated, because covers stick out.
//  - undecided:   the budget ran out first. Nothing is claimed.
// Of exact trees:
//  - separated:   no triangles of the two bodies touch, and neither body, if closed, encloses a part of the other.
//  - overlapping: two triangles have a common point, coplanar and touching ones included (or are so close that rounding
//                 hides the gap: about 1e-13 of the lengths involved), or a vertex of one body lies inside the other.
//                 Against a tree without triangles, its leaf ellipsoids take the triangles' place.
// Two leaves, or two triangles, are always decided by the same test with the bodies in the same order. So all queries
// about the same two bodies agree on the verdict, to the bit: collide(), collide_all(), distance(), contacts(), and
// those of a world. sweep() has a tolerance: where it says separated, so does collide(); and where collide() says
// overlapping at the start, so does sweep().
//
// "The lengths involved" in such bounds are the sizes of the bodies and the distances between them and the origins of
// their frames. A pose that is not finite, or whose quaternion is zero, never separates. Lengths may be any number:
// negative margins, radii, half extents and max_distance count as 0, and NaN as infinite. With an infinite margin, all
// bodies meet. Negative and NaN tolerances count as 0.
#pragma once

#include <prolate/tree.hpp>
#include <prolate/types.hpp>

#include <cstddef>
#include <cstdint>
#include <span>

namespace prolate {

enum class Verdict : uint8_t { separated, overlapping, undecided };

/// Limits of a query.
struct QueryOptions {
    /// Look no deeper than this level of either tree (0 = roots only). There, two nodes that the culling test does not
    /// separate count as meeting, with all that lies below them. The order of the search does not depend on max_level,
    /// so a deeper search never contradicts a shallower one: a shallow *separated* holds at every depth. The ellipsoids
    /// of exact trees cover only surfaces, so above the leaves, and in a prefix, nothing is said of what they enclose.
    uint32_t max_level = kMaxLevels;
    /// Stop before more than this many tests, of nodes and of triangles together, are made: QueryStats::tests().
    uint64_t max_pair_tests = UINT64_MAX;
    /// Bodies at most this far apart count as meeting, metres. Negative counts as 0; with infinity or NaN, all meet.
    float margin = 0;
};

/// Work that a query did.
struct QueryStats {
    uint64_t pair_tests = 0;     ///< nodes tested against a node, a shape or a ray
    uint64_t block_tests = 0;    ///< blocks of up to eight siblings tested at once; time is about proportional to this
    uint64_t triangle_tests = 0; ///< triangles tested against triangles, leaf ellipsoids, shapes or rays
    uint32_t deepest_level = 0;  ///< deepest level that a tested node came from

    uint64_t tests() const noexcept { return pair_tests + triangle_tests; } ///< what a budget is spent on
};

inline constexpr uint32_t kNoTriangle = UINT32_MAX;

/// Scratch of a query, owned by the caller: 80 KiB, which is enough for every query of any trees, so rather on the heap
/// than on a thread's stack. Reusable for any number of queries of any kind, by one query at a time. Needs no
/// initialisation.
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
static_assert(sizeof(QueryContext) == size_t{80} * 1024);

/// The memory that a query works in: a QueryContext, or as much as the caller has, such as a few KiB of a fibre's
/// stack. A view, passed by value: a QueryContext converts to it. One query at a time may work in it.
///
/// With less than scratch_size() a query makes no test, and answers `undecided` (bounds that claim nothing, no points).
/// With that and less than a QueryContext the same is certified; distance() and sweep() then search depth first where
/// they would have gone best first, so they may make more tests, and give other bounds within the tolerance.
///
/// Besides, queries take up to 40 KiB of stack (contacts(); the others up to 24 KiB).
class Scratch {
public:
    using Entry = QueryContext::Entry;

    Scratch(QueryContext& context) noexcept : entries_(context.entries), count_(QueryContext::kEntries) {}
    /// Memory of any alignment, of which up to 15 bytes are not used.
    explicit Scratch(std::span<std::byte> memory) noexcept;

    Entry* entries() const noexcept { return entries_; }
    uint32_t count() const noexcept { return count_; } ///< of entries, at most QueryContext::kEntries

private:
    Entry* entries_;
    uint32_t count_;
};

/// Bytes of memory that a Scratch needs at least, for all queries of these trees: of trees as build() makes them, of
/// degree 8, about 2 to 6 KiB. Never more than sizeof(QueryContext).
size_t scratch_size(const TreeView& tree) noexcept;
size_t scratch_size(const TreeView& a, const TreeView& b) noexcept;

} // namespace prolate
