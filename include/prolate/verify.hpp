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
    bool covered = false;  ///< every level is covered, and `bounded` holds
    bool exact = false;    ///< the tree holds triangles
    bool same_mesh = true; ///< of an exact tree: its triangles are the mesh's. If not, no level counts as covered.
    /// Of a tree without triangles: each bounding volume holds all that lies below its node. If not, queries may
    /// overlook some of it, and `unbounded_node` is the first node whose bounding volume fails.
    bool bounded = true;
    uint32_t unbounded_node = 0;
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

/// Proves each level of `tree` by adaptive subdivision of space: a cell is done when all of the solid in it (triangles
/// clipped to the cell, and its corners inside the solid) lies in one node of the *decoded* tree, because then, an
/// ellipsoid being convex, everything in between does. Levels are proved one by one, as each is a cover by itself; the
/// bounding volumes, by which queries get there, are proved to hold all ellipsoids below. The mesh is given as it was
/// read: it is welded as when the tree was baked, and where that moves points, they are proved where they stood. A point
/// of the solid in no node ends the proof as a counterexample; a cell that cannot be decided at 1e-9 of the mesh's size
/// ends it as "not proved". Of an exact tree, the triangles are compared with the mesh's, and each is looked for in
/// every ellipsoid above it. A prefix of one is proved to cover the triangles, as in surface mode: there, as queries
/// descend by its nodes, to lie in a node is to lie in all nodes above it, too. Thread-safe. Fails with bad_mesh or
/// cancelled.
Result<VerifyReport> verify(const TreeView& tree, MeshView mesh, const VerifyOptions& options = {});

} // namespace prolate
