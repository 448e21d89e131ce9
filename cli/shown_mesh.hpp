// The mesh of a tree, as pages and pictures show it, and how it moves if the tree deforms.
#pragma once

#include "cli/mesh_options.hpp"

#include <optional>
#include <string>
#include <vector>

namespace prolate::cli {

struct ShownMesh {
    std::optional<CleanMesh> mesh;
    bool own = true; ///< it is the one that the tree was baked from
    /// What a unit of each mode adds to each vertex of `mesh`, M by V by 3, metres; empty if that is not known.
    std::vector<float> displacements = {};
};

/// Reads the mesh, and if the tree deforms, the modes, which verify_modes() then proves the tree to hold. Either path
/// may be empty. An exact tree brings its own mesh, if none is named, and knows how it moves. Fails where modes are
/// named and the tree has no deformation, or that of other modes.
Outcome<ShownMesh> read_shown_mesh(const TreeView& tree, const std::string& path, const MeshOptions& options,
                                   const std::string& modes_path);

} // namespace prolate::cli
