// Where and how deep do two bodies touch? Contact manifolds for a solver: points, normals, depths, and ids that let it
// recognise a point in the next step. query.hpp says what bodies are and what the verdicts certify.
#pragma once

#include <prolate/collide.hpp>
#include <prolate/query.hpp>

#include <cstdint>

namespace prolate {

/// One point of contact.
struct ContactPoint {
    Vec3 point_a, point_b; ///< on the surfaces of the two bodies, opposite each other along the normal; world, metres
    /// Penetration along the manifold's normal, metres. Below 0, the bodies are -depth apart there, at most the margin.
    float depth = 0;
    /// How many queries in a row found this point before. 0: it is new, and `impulse` is 0.
    uint32_t age = 0;
    /// Names the features that touch: of triangles, a vertex or two crossing edges; of ellipsoids, the two nodes. The
    /// same from query to query as long as these features touch. Differs if the bodies change places.
    uint64_t id = 0;
    /// For the caller's own use, such as normal and tangential impulses. Kept for as long as the point is found.
    float impulse[3] = {};
};

inline constexpr uint32_t kManifoldPoints = 4; ///< most points of a manifold
inline constexpr uint32_t kManifolds = 4;      ///< most manifolds of two bodies

/// Contact points that share a normal.
struct Manifold {
    Vec3 normal;                          ///< unit vector, world: moving `b` along it takes it out of `a`
    uint32_t count = 0;                   ///< of `points`, 1 ... kManifoldPoints
    ContactPoint points[kManifoldPoints]; ///< ordered by id
};

/// All contacts of two bodies: a manifold for each direction in which they touch. A box on the floor has one, and so
/// has a table on its four feet; a box that also leans against a wall has two. Owned by the caller, about 1 KB. Keep it
/// from one query to the next, so that a solver can start warm. Reset it (`= {}`) when a body's tree changes.
struct ContactManifolds {
    uint32_t count = 0;             ///< of `manifolds`, 0 ... kManifolds
    Manifold manifolds[kManifolds]; ///< the deepest first
};
static_assert(sizeof(ContactManifolds) <= 968); // less where 8-byte integers are aligned to 4

/// Answer of contacts().
struct ContactResult {
    Verdict verdict = Verdict::undecided; ///< that of collide()
    /// Overlapping though no surfaces meet: a part of one body lies inside the other. There are no points then.
    bool enclosed = false;
    /// Pairs of leaves, or of triangles, that meet; above 64 not all of them, where many have one normal.
    uint64_t found = 0;
    QueryStats stats; ///< looking around a triangle counts as a test of triangles
};

/// Contacts of `a` at `pose_a` and `b` at `pose_b`, and of what comes within options.margin of each other. Replaces the
/// contents of `manifolds`; points that were there before keep their age and impulse. Symmetric: if the bodies change
/// places, so do the points, and the normals are reversed. Thread-safe on shared trees.
///
/// The verdict is certified. Points and normals are not: they are accurate to rounding where surfaces touch or overlap
/// a little. If the verdict is overlapping and not `enclosed`, there is at least one point.
///
/// Every pair of leaves, or of triangles, that meets gives a patch of points with one normal:
///  - Of two ellipsoids: one point, along the shortest translation that separates them.
///  - Of two triangles: the normal is that of one of the triangles, or the product of two edges, whichever has the
///    least overlap of the triangles *and their neighbourhoods*. So edges and vertices count only in directions in
///    which no surface rises from them: inner edges of flat ground give no normals of their own, convex edges give
///    those between the normals of their faces, concave edges those of their faces. The points are the corners of the
///    intersection of the two triangles, seen along the normal, and each body's deepest vertex in the neighbourhood.
///
/// Manifolds are made from the patches in four steps:
///  1. Group by normal. Points within 25 degrees of a group's first normal join it. The group's normal is the mean,
///     weighted by depth; its depth is that of its deepest point.
///  2. Drop a group that another one resolves: where the bodies, moved by the other group's depth along its normal,
///     would be separated at all of its points. The deepest group is tried first.
///  3. Keep the kManifolds deepest groups.
///  4. Of each, keep kManifoldPoints points: the deepest (to within 1 %), and those that span the largest area with it;
///     points that the last query had are preferred. (D. Gregorius, "Robust Contact Creation for Physics Simulations",
///     Game Developers Conference, 2015.)
///
/// What lies in one plane with one normal needs four points, not all of its pairs: once 64 pairs meet, pairs of nodes
/// are left out along which the bodies only touch, or whose triangles are coplanar, unless they lie farther out than
/// the points so far by more than a thousandth of their extent. So flat faces cost what their outline does.
///
/// With options.max_level, or of a prefix, nodes stand for all that is in them. A closed mesh is pushed out of the
/// other body, an open one to the nearer side. Vertices in the same place must be one vertex, as build() makes them.
/// Bodies that overlap by more than about half their size may be separated through another side than the nearest;
/// sweep() keeps it from coming to that.
///
/// Of rounded bodies (TreeView::rounded()), the contacts are those of the cores, as far apart as the radii and the
/// margin allow, moved onto the round surfaces along the normals: exact where cores do not meet, but for what the mean
/// of a manifold's normals does to points that are not its deepest.
///
/// Of closed bodies one way out of all pairs is sought first (query/contacts/one_way.hpp): one manifold, whose deepest
/// point has its length for a depth, though facets may be nearer there. Without one, pairs are gone through as above;
/// the search then runs two to five times, which counters and options.max_pair_tests count as one.
ContactResult contacts(const TreeView& a, const Pose& pose_a, const TreeView& b, const Pose& pose_b,
                       ContactManifolds& manifolds, Scratch context, const QueryOptions& options = {}) noexcept;

} // namespace prolate
