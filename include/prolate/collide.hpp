// Do two bodies meet? query.hpp says what the verdicts certify.
#pragma once

#include <prolate/query.hpp>

#include <span>

namespace prolate {

/// Two leaves that meet.
struct MeetingPair {
    uint32_t node_a = 0, node_b = 0;
    /// Their triangles that meet; kNoTriangle for a tree without triangles.
    uint32_t triangle_a = kNoTriangle, triangle_b = kNoTriangle;
    friend bool operator==(const MeetingPair&, const MeetingPair&) = default;
};

/// Answer of collide().
struct CollideResult {
    Verdict verdict = Verdict::undecided;
    bool enclosed = false; ///< overlapping though no surfaces meet: a part of one body lies inside the other
    MeetingPair pair;      ///< if overlapping: nodes or triangles found to meet; the roots if enclosed
    QueryStats stats;
};

/// Temporal coherence of one pair of bodies, owned by the caller: what the last query knew that still helps the next if
/// the bodies have moved little. Reset it (`= {}`) when a body's tree changes. The verdict is the same with and
/// without; which of several meeting pairs is named, and the counters, may differ.
///
/// After *separated* it holds a distance that the bodies certainly keep, and while they move less, nothing is tested.
/// (The query looks for that distance with a margin, an analogue of the skin of a Verlet list: Verlet 1967.) After
/// *overlapping* it holds the pair that met, which is tested first.
struct PairCache {
    Verdict verdict = Verdict::undecided; ///< of the last query
    MeetingPair pair;                     ///< if overlapping at leaves
    float distance = 0;                   ///< if separated: certified lower bound at the poses below, metres
    Pose pose_a, pose_b;                  ///< where the bodies were
};
static_assert(sizeof(PairCache) == 80);

/// Do `a` at `pose_a` and `b` at `pose_b` meet, or come as near as options.margin? Stops at the first pair of leaves,
/// or of their triangles, that do. Symmetric: swapping the bodies gives the same verdict. Thread-safe on shared trees.
/// Perram and Wertheim 1985 (query/ellipsoid/separation.hpp); the descent is told in query/collide/collide.cpp.
CollideResult collide(const TreeView& a, const Pose& pose_a, const TreeView& b, const Pose& pose_b,
                      QueryContext& context, const QueryOptions& options = {}, PairCache* cache = nullptr) noexcept;

/// Answer of collide_all().
struct CollideAllResult {
    Verdict verdict = Verdict::undecided;
    bool enclosed = false; ///< no surfaces meet, but a part of one body lies inside the other: no pairs then
    uint64_t found = 0;    ///< pairs that meet, also those beyond the end of the span
    QueryStats stats;
};

/// All pairs of leaves (of trees with triangles: of triangles) that meet, or come as near as options.margin, in a fixed
/// order; the first pairs.size() of them are written. If the budget runs out, verdict is overlapping if one was found,
/// else undecided, and `found` counts those found so far.
CollideAllResult collide_all(const TreeView& a, const Pose& pose_a, const TreeView& b, const Pose& pose_b,
                             std::span<MeetingPair> pairs, QueryContext& context,
                             const QueryOptions& options = {}) noexcept;

} // namespace prolate
