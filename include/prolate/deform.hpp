// Bodies that deform, by modes or by bones: do they meet, how far apart are they, and where does a ray meet them?
// deformation.hpp and skin.hpp say how they deform.
//
// What a deforming body is, at coordinates q:
//  - its surface: the triangles of its mesh, each with its corners where q moves them, and if the mesh is closed, all
//    that this surface encloses. An exact tree is asked about these triangles; of a tree without triangles only their
//    cover is known, the leaf ellipsoids as q moves and enlarges them.
//  - A tree without deformation and skin (or any tree, with no coordinates and matrices) is the rigid body of
//  query.hpp.
//
// What is certified:
//  - separated:   the surfaces do not touch, and neither body holds a part of the other. Of the deformed mesh, whatever
//                 the tree.
//  - overlapping: exact trees: two triangles have a common point (or are so close that rounding hides the gap). Else
//  two
//                 leaf ellipsoids do, and the surfaces may still be separated. Or, if `enclosed`, the surfaces are
//                 separated, but none of the rays that were tried leads from a part of one body out of the other: that
//                 part lies inside, or in a deep hollow.
//  - undecided:   see Undecided.
//
// A query looks at no vertex but the corners of the triangles of exact leaves that it comes down to. It costs what it
// opens: in double precision, node by node, about 0.15 us for each test of a body with ten modes, and
// 30 ns for each bone that moves the node.
//
// TreeView::scaled() scales the displacements and the bones' translations, too; TreeView::rounded() rounds the deformed
// body.
#pragma once

#include <prolate/bounds.hpp>
#include <prolate/collide.hpp>
#include <prolate/distance.hpp>
#include <prolate/raycast.hpp>

#include <cstdint>
#include <span>

namespace prolate {

/// A body at a pose, deformed. Coordinates and matrices are borrowed. No coordinates: all are 0.
struct DeformedBody {
    TreeView tree;
    Pose pose = {};
    std::span<const float> q = {}; ///< as many as the tree's deformation has modes, |q[i]| <= range(i)
    /// As many as the tree's skin has bones; none of them: all are the identity. Finite, entries of at most
    /// kLargestBoneFactor, translations of at most kLargestCoordinate.
    std::span<const BoneMatrix> bones = {};
};

/// Why a query of deformed bodies decided nothing.
enum class Undecided : uint8_t {
    no,          ///< it did decide
    coordinates, ///< there are more or fewer than the tree has modes, or bones, or one is out of range or NaN
    input,       ///< a pose or a ray is not finite, or the scratch is too small
    budget,      ///< options.max_pair_tests ran out, or distance() was to look no deeper than options.max_level
};

/// Answer of collide() for deformed bodies.
struct DeformedCollideResult : CollideResult {
    Undecided reason = Undecided::input;
};

/// Do two bodies meet, or come within options.margin of each other? Of CollideResult, `pair` names leaves, and their
/// triangles, that meet; the roots if enclosed. options.max_level is taken as collide() takes it. Swapping the bodies
/// gives the same verdict but for gaps that rounding hides. Takes as much scratch as collide() of the same trees.
/// Thread-safe on shared trees.
DeformedCollideResult collide(const DeformedBody& a, const DeformedBody& b, Scratch context,
                              const QueryOptions& options = {}) noexcept;

/// Answer of distance() for deformed bodies. `lower`, metres, is certified of the deformed meshes, their inside
/// included: they are not nearer. `upper` is that of triangles of exact trees, and of the leaf ellipsoids of others:
/// such bodies are not farther apart. Leaves count as no nearer to each other than what the nodes above them hold: then
/// points are named that are less than `upper` apart. If `enclosed`, a part of one body may lie inside the other, and
/// lower is 0; upper and the points are those of the surfaces. Undecided: 0 <= distance <= infinity, unless the budget
/// is why.
struct DeformedDistanceResult : DistanceResult {
    Undecided reason = Undecided::input;
};

/// How far apart are two bodies, and where? As distance() of rigid bodies, anytime and with its options.
/// `overlapping` only if collide() says so, and where it does, `separated` only for gaps that rounding hides. Takes as
/// much scratch as distance() of the same trees. Thread-safe on shared trees.
DeformedDistanceResult distance(const DeformedBody& a, const DeformedBody& b, Scratch context,
                                const DistanceOptions& options = {}) noexcept;

/// Answer of raycast() for deformed bodies.
struct DeformedRaycastResult : RaycastResult {
    Undecided reason = Undecided::input;
};

/// Where does the ray first meet the deformed leaf ellipsoids, or the deformed triangles of an exact tree? As raycast()
/// of a rigid body. Thread-safe on shared trees.
DeformedRaycastResult raycast(const DeformedBody& body, const Ray& ray, Scratch context,
                              const QueryOptions& options = {}) noexcept;

/// A box in the world that holds the deformed mesh and all points within `margin`, metres, of it, for a broadphase:
/// that of the root where it has moved, so less tight than bounds() of a rigid body. Infinite if the coordinates are
/// those of Undecided::coordinates, or the pose is not finite. Thread-safe on shared trees.
Bounds bounds(const DeformedBody& body, float margin = 0) noexcept;

} // namespace prolate
