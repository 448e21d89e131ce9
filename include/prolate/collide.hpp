// Do two bodies meet? query.hpp says what bodies are and what the verdicts certify.
#pragma once

#include <prolate/query.hpp>

#include <span>

namespace prolate {

/// Two leaves that meet.
struct MeetingPair {
    uint32_t node_a = 0, node_b = 0; ///< slots of the leaves
    /// The triangles of these leaves that meet; kNoTriangle for a tree without triangles.
    uint32_t triangle_a = kNoTriangle, triangle_b = kNoTriangle;
    friend bool operator==(const MeetingPair&, const MeetingPair&) = default;
};

/// Answer of collide().
struct CollideResult {
    Verdict verdict = Verdict::undecided;
    bool enclosed = false; ///< overlapping though no surfaces meet: a part of one body lies inside the other
    MeetingPair pair;      ///< if overlapping: leaves, and their triangles, that meet; the roots if enclosed
    QueryStats stats;
};

/// Temporal coherence of one pair of bodies: what the last query found that may spare the next one work. Owned by the
/// caller, 80 bytes. Reset it (`= {}`) when a body's tree changes. The verdict is the same with and without; the
/// counters may differ, and so may which of several meeting pairs is named.
///
/// After *separated* it holds a certified lower bound of the distance, and no test is made until the bodies have moved
/// by that much. To find such a bound, the query inflates the bodies by a skin, as neighbour lists do in molecular
/// dynamics (Verlet, Physical Review 159, 1967). After *overlapping* it holds the pair that met, which is tested first.
struct PairCache {
    Verdict verdict = Verdict::undecided; ///< of the last query
    MeetingPair pair;                     ///< if overlapping at leaves
    float distance = 0;                   ///< if separated: certified lower bound at the poses below, metres
    Pose pose_a, pose_b;                  ///< where the bodies were
};
static_assert(sizeof(PairCache) == 80);

/// Do `a` at `pose_a` and `b` at `pose_b` meet, or come within options.margin of each other? Stops at the first pair of
/// leaves, or of their triangles, that does. Symmetric: swapping the bodies gives the same verdict. Thread-safe on
/// shared trees. The search is described in query/collide/search.cpp, the test of two ellipsoids (J. W. Perram, M. S.
/// Wertheim, "Statistical mechanics of hard ellipsoids", Journal of Computational Physics 58, 1985) in
/// query/ellipsoid/separation.hpp.
CollideResult collide(const TreeView& a, const Pose& pose_a, const TreeView& b, const Pose& pose_b, Scratch context,
                      const QueryOptions& options = {}, PairCache* cache = nullptr) noexcept;

/// Answer of collide_all().
struct CollideAllResult {
    Verdict verdict = Verdict::undecided;
    bool enclosed = false; ///< overlapping though no surfaces meet: a part of one body lies inside the other. No pairs.
    uint64_t found = 0;    ///< number of pairs that meet, those that found no room in the span included
    QueryStats stats;
};

/// All pairs of leaves (of trees with triangles: of triangles) that meet or come within options.margin of each other,
/// in a fixed order. The first pairs.size() of them are written. If the budget runs out, the verdict is overlapping if
/// a pair was found before, else undecided, and `found` counts those found so far. Thread-safe on shared trees.
CollideAllResult collide_all(const TreeView& a, const Pose& pose_a, const TreeView& b, const Pose& pose_b,
                             std::span<MeetingPair> pairs, Scratch context, const QueryOptions& options = {}) noexcept;

} // namespace prolate
