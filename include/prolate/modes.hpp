// From a tree and the modes of its mesh to a tree that deforms, and the proof that its nodes hold (deformation.hpp).
#pragma once

#include <prolate/mesh.hpp>
#include <prolate/tree.hpp>

#include <cstdint>
#include <span>

namespace prolate {

/// Modes of a mesh of V vertices, those of the mesh as it was read, before clean(). Borrowed.
struct Modes {
    /// M by V by 3, row by row: what a unit of each mode adds to each vertex, metres.
    std::span<const float> displacements;
    /// M: how large each mode's coordinate may become, either way; above 0.
    std::span<const float> ranges;
};

/// What verify_modes() found.
struct ModesProof {
    bool proved = false;
    // If not: of which node the bound fails, in which mode; or 0, where a stored displacement is another one.
    uint32_t node = 0, mode = 0;
};

/// The same tree with its deformation, proved as verify_modes() does. `mesh` is what `tree` was baked from. Vertices in
/// one place must have the same displacements. Cost: as many passes over the vertices as the tree has levels, a second
/// for a million vertices and modes. The same bytes everywhere. Fails with bad_options for no mode or more than
/// kMaxModes, a range that is not above 0 and finite, or ranges in which the body would grow a thousandfold; with
/// bad_mesh for another mesh, displacements of another count or not finite (`where` is the vertex), or vertices in one
/// place that move apart (likewise); with unsupported for a prefix, a tree that has a deformation, one of a filled
/// mesh, and a mesh of which welding moved vertices; with out_of_memory. Thread-safe.
Result<Tree> add_modes(const TreeView& tree, MeshView mesh, const Modes& modes);

/// Proves a tree's deformation from its bytes, the mesh and the modes: that for every corner x of every triangle that a
/// node stands for, and every mode, |L^-1 (U(x) - d)| <= g or |U(x) - d| <= r, as all of these decode; and that stored
/// displacements are those of the modes. That the tree covers at rest is for verify() to prove. Fails as add_modes()
/// does, and with bad_options for other ranges. Thread-safe.
Result<ModesProof> verify_modes(const TreeView& tree, MeshView mesh, const Modes& modes);

} // namespace prolate
