// How far is a point from a body, on which side of its surface, and where is the nearest point? query.hpp says what
// bodies are, and that "separated" is certain.
#pragma once

#include <prolate/query.hpp>

#include <cstdint>
#include <limits>
#include <span>

namespace prolate {

/// Limits of a signed_distance() query.
struct PointOptions {
    /// Stop as soon as it is certain that the point is at least this far from the surface, metres. Distant points then
    /// cost little. Negative counts as 0, NaN as infinite.
    double max_distance = std::numeric_limits<double>::infinity();
    /// Stop before more than this many tests, of nodes and of triangles together, are made: QueryStats::tests().
    uint64_t max_pair_tests = UINT64_MAX;
};

/// Answer of signed_distance(). The signed distance is that from the body's surface: above 0 outside, below 0 inside.
struct SignedDistance {
    /// separated: the point is outside, certainly. overlapping: it is inside, or so near to the surface that rounding
    /// hides the gap (about 1e-13 of the lengths involved). undecided: a limit was reached before it was known.
    Verdict verdict = Verdict::undecided;
    /// Certified: lower <= signed distance <= upper, metres. Of an exact tree they are equal except for rounding, which
    /// near the surface is up to 4e-9 of the lengths involved, and so are those of points outside a tree without
    /// triangles. Inside overlapping ellipsoids there is room between them: the point is at least as deep as in the
    /// deepest single ellipsoid, and at most as deep as `point` is far.
    double lower = -std::numeric_limits<double>::infinity(), upper = std::numeric_limits<double>::infinity();
    /// The nearest point of the surface that was found, world. Of several that are equally near, the one on the
    /// triangle, or in the node, of the least index. Means nothing, as the three fields below, if none was reached.
    Vec3 point;
    /// Unit vector, world, along which the signed distance grows fastest: away from `point` outside, towards it
    /// inside. If the point lies on the surface, its normal there.
    Vec3 gradient;
    uint32_t node = 0;               ///< slot of the leaf that `point` lies on
    uint32_t triangle = kNoTriangle; ///< and the triangle, of an exact tree
    QueryStats stats;
};

/// Signed distance of `point`, in the world, from the body at `pose`.
///
/// Of an exact tree of a closed mesh, inside is where the winding number of its triangles is not 0, whether the mesh
/// overlaps itself or not. An exact tree of an open mesh has no inside: distances are those from its triangles, above
/// 0. Of a prefix of an exact tree, which has no triangles, only `lower` is certified, of the distance from outside.
///
/// Of a rounded body (TreeView::rounded()), how deep a point inside lies is not known: `lower` is then -infinity.
///
/// Anytime: a small budget only widens the bounds. A pose or point that is not finite, or a quaternion of zero, leaves
/// everything open. Thread-safe on shared trees. The search is described in query/points/search.cpp.
SignedDistance signed_distance(const TreeView& tree, const Pose& pose, const Vec3& point, Scratch context,
                               const PointOptions& options = {}) noexcept;

/// The same for many points: out[i] is the answer for points[i], for as many as both spans have. All but the counters
/// are those of the single query, to the bit. Points that follow each other closely are answered sooner: each search
/// begins with the last one's triangle, and a point within the last one's distance needs no ray to tell its side.
void signed_distance(const TreeView& tree, const Pose& pose, std::span<const Vec3> points,
                     std::span<SignedDistance> out, Scratch context, const PointOptions& options = {}) noexcept;

/// Only the side: the verdict of signed_distance() for each point, sooner.
Verdict contains(const TreeView& tree, const Pose& pose, const Vec3& point, Scratch context) noexcept;
void contains(const TreeView& tree, const Pose& pose, std::span<const Vec3> points, std::span<Verdict> out,
              Scratch context) noexcept;

} // namespace prolate
