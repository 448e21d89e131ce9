// Proof that a tree covers a mesh, independent of how the tree was built.
#pragma once

#include <prolate/mesh.hpp>
#include <prolate/tree.hpp>

#include <cstdint>
#include <functional>
#include <vector>

namespace prolate {

/// Verdict on one level's cut.
struct LevelProof {
    bool covered = false;            ///< proved: every point of the solid lies in an ellipsoid of the cut
    bool has_counterexample = false; ///< `point` belongs to the solid and lies in no ellipsoid of the cut
    double point[3] = {};            ///< the counterexample, or where the subdivision gave up
    double depth = 0;    ///< of the counterexample: smallest |L^-1 (p - c)| - 1 over the ellipsoids of the cut
    uint64_t pieces = 0; ///< pieces of the solid that were looked at
};

/// Result of verify().
struct VerifyReport {
    bool covered = false;  ///< every level is covered, `bounded`, `holes_kept` and `inner_inside` hold
    bool exact = false;    ///< the tree holds triangles
    bool same_mesh = true; ///< of an exact tree: its triangles are the mesh's. If not, no level counts as covered.
    /// Of a tree without triangles: each bounding volume holds all that lies below its node. If not, queries may
    /// overlook some of it, and `unbounded_node` is the first node whose bounding volume fails.
    bool bounded = true;
    uint32_t unbounded_node = 0;
    /// Of a whole tree that was baked with `keep_holes`: a ball of that radius passes the leaves wherever a somewhat
    /// larger one passes the mesh (BuildOptions::keep_holes says by how much). If not, the ball whose center is
    /// `blocked` is not certainly free.
    bool holes_kept = true;
    double blocked[3] = {};
    /// Of a tree with an inner cover: all ellipsoids of that lie inside the solid. If not, `protruding_node` is its
    /// first node that does not certainly do so.
    bool has_inner = false, inner_inside = true;
    uint32_t protruding_node = 0;
    bool surface_mode = false;      ///< the mesh is open: the proof is about its triangles, there is no inside
    std::vector<LevelProof> levels; ///< the root first
};

/// Options of verify().
struct VerifyOptions {
    uint32_t threads = 0; ///< 0 = all cores
    /// Called several times a second, from one thread at a time, with the fraction done. Return false to cancel:
    /// verify() then ends within a second.
    std::function<bool(double)> progress;
};

/// Proves that each level of `tree` covers, by adaptive subdivision of space. A cell is done when the part of the solid
/// in it (triangles clipped to the cell, and corners of the cell inside the solid) lies in one node of the *decoded*
/// tree; since an ellipsoid is convex, everything in between does, too. Levels are proved one by one, because each is a
/// cover by itself. The bounding volumes, by which queries cull, are proved to hold all ellipsoids below.
///
/// Of a tree that was baked with `fill`, the solid is the filled one: all that such a ball cannot reach.
///
/// The mesh is given as it was read. It is welded as when the tree was baked, and points that this moves are proved
/// where they were. A point of the solid in no node ends the proof as a counterexample; a cell that cannot be decided
/// at 1e-9 of the mesh's size ends it as "not proved".
///
/// An inner cover is proved node by node: no triangle meets the ellipsoid, and its center is inside.
///
/// Of an exact tree, the triangles are compared with the mesh's, and each must lie in all ellipsoids above it. A prefix
/// of one is proved to cover the triangles, as in surface mode. Queries descend by its nodes, so there each part must
/// lie in a node and in all nodes above it. Thread-safe. Fails with bad_mesh (also if the ball of the tree's fill or
/// keep_holes does not suit this mesh, see ball_range()) or cancelled.
Result<VerifyReport> verify(const TreeView& tree, MeshView mesh, const VerifyOptions& options = {});

} // namespace prolate
