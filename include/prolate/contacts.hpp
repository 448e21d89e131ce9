// Where and how deep do two bodies touch? Contact manifolds for a solver: points, normals, depths, and ids by which a
// point is known again at the next step. query.hpp says what bodies are and what the verdicts certify.
#pragma once

#include <prolate/collide.hpp>
#include <prolate/query.hpp>

#include <cstdint>

namespace prolate {

/// One point of contact.
struct ContactPoint {
    Vec3 point_a, point_b; ///< on the surfaces of the two bodies, opposite each other along the normal; world, metres
    /// Along the manifold's normal, metres: above 0, how far the surfaces are in each other there; below, how far
    /// apart, by at most the margin.
    float depth = 0;
    /// Queries in a row, before this one, that found the point. 0: it is new, and so is `impulse`.
    uint32_t age = 0;
    /// What touches: of triangles, a vertex, or a crossing of two edges; of ellipsoids, their nodes. The same as long
    /// as that is so, whatever triangles meet beneath; another if the bodies are exchanged.
    uint64_t id = 0;
    /// The caller's own: normal and tangential impulses, say. Kept as long as the point is.
    float impulse[3] = {};
};

inline constexpr uint32_t kManifoldPoints = 4; ///< of one manifold, at most
inline constexpr uint32_t kManifolds = 4;      ///< of two bodies, at most

/// Up to four points with one normal.
struct Manifold {
    Vec3 normal; ///< unit vector from `a` to `b`, world: moved along it, `b` leaves `a`
    uint32_t count = 0;
    ContactPoint points[kManifoldPoints]; ///< by id
};

/// All that two bodies have in contact, owned by the caller and kept from one query to the next, as a solver wants it
/// for warm starts: a manifold for each direction in which they touch – one for a box on the floor, or a table on its
/// four feet; two for one that also leans against a wall. Reset it (`= {}`) when a body's tree changes.
struct ContactManifolds {
    uint32_t count = 0;
    Manifold manifolds[kManifolds]; ///< the deepest first
};
static_assert(sizeof(ContactManifolds) <= 968); // less where 8-byte integers are aligned to 4

/// Answer of contacts().
struct ContactResult {
    Verdict verdict = Verdict::undecided; ///< as collide() has it
    /// overlapping, though no surfaces meet: a part of one body lies inside the other. There are no points then.
    bool enclosed = false;
    uint64_t found = 0; ///< pairs of leaves, or of triangles, that meet
    QueryStats stats;   ///< looking around triangles counts as tests of triangles
};

/// Contacts of `a` at `pose_a` and `b` at `pose_b`, and what comes as near as options.margin. Replaces what `manifolds`
/// holds; points that were there keep age and impulse. Symmetric: for the bodies exchanged, points and normals are,
/// too. Thread-safe on shared trees.
///
/// The verdict is certified; points are not: they are right but for rounding where surfaces touch or meet by little. If
/// it is overlapping and not `enclosed`, there is a point.
///  - Trees without triangles: each two leaf ellipsoids that meet have a point, along the direction in which they part
///    soonest.
///  - Exact trees: each two triangles that meet have one of their normals, or the product of two edges, for normal: the
///    one along which what surrounds them, not they alone, overlaps least. So edges and vertices count only in
///    directions in which no surface rises from them: the inner ones of flat ground give no normals, convex ones those
///    between their faces', concave ones both faces'. Points are the corners of what the one triangle covers of the
///    other, seen along the normal, and the deepest vertex of each body around there in the other one. A closed mesh is
///    pushed out of, an open one towards the nearer side. Vertices that are at the same place are to be one vertex, as
///    build() sees to. Bodies that are deeper in each other than about half their size may be taken apart through
///    another side than the nearest; sweep() prevents that.
///
/// From all of these, in this order:
///  1. Points are grouped by their normals: those within 25 degrees of a group's first belong to it. Its normal is
///     their mean, weighted by depth, and its depth that of its deepest point.
///  2. A group is dropped if another one resolves all it stands for: if the bodies, moved by that one's depth along its
///     normal, would be apart there. The deepest is tried first.
///  3. Of the rest the four deepest are kept (kManifolds).
///  4. Each keeps four points at most (kManifoldPoints): the deepest, to a hundredth, and those that make the largest
///     area with it; points of the last query before others.
/// With max_level or a prefix, nodes stand for what is in them. What meets is gone through twice, and counted once.
///
/// Gregorius, "Robust contact creation for physics simulations" (GDC 2015), for 4; query/triangle/contact.hpp for the
/// normals, query/contacts/contacts.cpp for the rest.
ContactResult contacts(const TreeView& a, const Pose& pose_a, const TreeView& b, const Pose& pose_b,
                       ContactManifolds& manifolds, QueryContext& context, const QueryOptions& options = {}) noexcept;

} // namespace prolate
