// Ground: how far is a body from a half-space, where does it touch it, and when does it meet it? The half-space takes
// the place of the second body; query.hpp says what bodies are. shapes.hpp has HalfSpace, and asks for the verdict
// alone.
//
// A half-space is no tree, and reaches everywhere: these queries cost a small part of those against a box for a floor
// (primitives.hpp).
#pragma once

#include <prolate/contacts.hpp>
#include <prolate/distance.hpp>
#include <prolate/shapes.hpp>
#include <prolate/sweep.hpp>

namespace prolate {

/// Distance of the body from the half-space: as that of two bodies, with the same certificates, point_b on the plane
/// below point_a, and the normal against that of the half-space. The verdict is that of overlap(). Of `pair`, node_b
/// and triangle_b mean nothing. With a half-space that is not finite, or whose normal is 0, nothing is certain:
/// undecided, 0 <= distance <= infinity. max_level of the options is not used. Thread-safe on shared trees.
DistanceResult distance(const TreeView& tree, const Pose& pose, const HalfSpace& half_space, Scratch context,
                        const DistanceOptions& options = {}) noexcept;

/// Contacts of the body with the half-space: one manifold, whose normal is against that of the half-space (moving the
/// half-space along it takes it out of the body). Its points are the corners of an exact tree, or of ellipsoids the
/// deepest points, that lie in the half-space or within options.margin of it: the deepest (to within 1 %, or 1e-4 of
/// the body's size), and those that span the largest area with it, where each metre of height counts as sixteen less
/// of extent: so of a round body those are found that it rolls onto, however large the margin. Where no more than four
/// corners of a mesh of at most 64 do, they are the points. An id is that of a vertex, or node, alone.
///
/// Replaces the contents of `manifolds`; points that were there before keep their age and impulse. The search begins
/// with these points, and keeps those that touch while others reach no farther out by a sixteenth of the extent: what
/// rests costs a fraction of what has just landed. So keep the manifolds, and reset them when the tree changes.
///
/// The verdict is that of overlap(), at full depth; if it is overlapping, there is a point. ContactResult::found counts
/// the corners that were looked at and touch. Thread-safe on shared trees.
ContactResult contacts(const TreeView& tree, const Pose& pose, const HalfSpace& half_space, ContactManifolds& manifolds,
                       Scratch context, const QueryOptions& options = {}) noexcept;

/// When does the moving body first meet the half-space, which is at rest? As sweep() of two bodies, with the same
/// certificates and tolerance (the body is the smaller one); point_b on the plane below point_a. With a half-space that
/// is not finite, or whose normal is 0, nothing is certain: undecided, time_lower = 0. Thread-safe on shared trees.
///
/// Conservative advancement of the whole body: its lowest point and a bound on the speed of any point towards the
/// plane.
SweepResult sweep(const TreeView& tree, const Motion& motion, const HalfSpace& half_space, Scratch context,
                  const SweepOptions& options = {}) noexcept;

} // namespace prolate
