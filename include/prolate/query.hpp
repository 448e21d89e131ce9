// Collision queries between rigid bodies whose shapes are ellipsoid trees.
//
// Every function here is noexcept, allocates nothing, keeps no state but the caller's context, and returns the same
// bits for the same input. Trees may be shared between threads; a context belongs to one query at a time.
//
// What the verdicts mean, for trees that cover their solids:
//  - separated:   certified. A plane was found between every pair of nodes that could meet, beyond the rounding error
//                 of the test. The solids do not touch.
//  - overlapping: two leaf ellipsoids have a common point (or come nearer than rounding error can tell apart). The
//                 covers meet; the solids may still be apart by what the covers stick out.
//  - undecided:   the budget ran out first. Nothing is claimed.
// An exact tree is its triangles, and if its mesh is closed, all that they enclose:
//  - separated:   neither do the triangles of the two bodies touch, nor does a closed one enclose a part of the other.
//  - overlapping: two triangles have a common point (coplanar and touching ones too; or come nearer than rounding error
//                 can tell apart, about 1e-13 of the lengths that enter), or a vertex of one body lies inside the
//                 other. Against a tree without triangles, its leaf ellipsoids take the triangles' place.
// Short of the leaves, at QueryOptions::max_level, overlapping again speaks of ellipsoids, which here cover surfaces. A
// prefix of an exact tree is such a cover, and knows no inside: separated then does not exclude that its solid encloses
// the other body.
// A pose that is not finite, or whose quaternion is zero, never separates.
#pragma once

#include <prolate/tree.hpp>
#include <prolate/types.hpp>

#include <cstdint>

namespace prolate {

enum class Verdict : uint8_t { separated, overlapping, undecided };

/// Limits of a query.
struct QueryOptions {
    /// Look no deeper than this level (0 = roots only); nodes there count as leaves. The answer is that of the coarser
    /// covers. If a shallow query says separated, every deeper one does too.
    uint32_t max_level = kMaxLevels;
    /// Stop after this many tests of ellipsoids: QueryStats::pair_tests.
    uint64_t max_pair_tests = UINT64_MAX;
};

/// Work that a query did.
struct QueryStats {
    uint64_t pair_tests = 0;     ///< ellipsoids tested against each other, or against the ray of a point-in-solid test
    uint64_t evaluations = 0;    ///< evaluations of the ellipsoids' certificates, one to a few per pair
    uint64_t triangle_tests = 0; ///< triangles tested against triangles or leaf ellipsoids
    uint32_t deepest_level = 0;  ///< deepest level that a node tested against another came from
};

/// Scratch of a collide() call, owned by the caller, reusable for any number of queries. Needs no initialisation.
class CollideContext {
public:
    /// One pair of nodes whose children are being paired: bit i of a mask is child i.
    struct Frame {
        uint32_t node_a, node_b;
        uint64_t children_a, children_b; // survivors of the tests against the other parent
        uint32_t next_a, next_b;         // cursor over the product
        uint32_t level;
    };
    Frame frames[kMaxLevels];
};

inline constexpr uint32_t kNoTriangle = UINT32_MAX;

/// Answer of collide().
struct CollideResult {
    Verdict verdict = Verdict::undecided;
    uint32_t node_a = 0, node_b = 0; ///< if overlapping: the first pair of nodes found to meet; the roots if enclosed
    /// If overlapping at leaves of exact trees: their triangles that meet. kNoTriangle for a tree without triangles.
    uint32_t triangle_a = kNoTriangle, triangle_b = kNoTriangle;
    bool enclosed = false; ///< overlapping though no surfaces meet: a part of one body lies inside the other
    QueryStats stats;
};

/// Do `a` at `pose_a` and `b` at `pose_b` meet? Stops at the first pair of leaves, or of their triangles, that do.
/// Symmetric: swapping the bodies gives the same verdict. Perram and Wertheim 1985; README, "How it works".
CollideResult collide(const TreeView& a, const Pose& pose_a, const TreeView& b, const Pose& pose_b,
                      CollideContext& context, const QueryOptions& options = {}) noexcept;

/// The same question for two single ellipsoids: separated or overlapping, certified as above.
Verdict collide(const Ellipsoid& a, const Pose& pose_a, const Ellipsoid& b, const Pose& pose_b) noexcept;

} // namespace prolate
