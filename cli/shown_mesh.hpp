// The mesh of a tree, as pages and pictures show it, and how it moves if the tree deforms.
#pragma once

#include "cli/mesh_options.hpp"

#include <optional>
#include <string>
#include <vector>

namespace prolate::cli {

/// Bones, and how they move each vertex of a mesh (rig.hpp).
struct ShownSkin {
    std::vector<std::string> bones;
    std::vector<uint32_t> parents;
    std::vector<Vec3> joints;
    uint32_t each = 0;
    std::vector<uint16_t> indices;
    std::vector<float> weights;
};

struct ShownMesh {
    std::optional<CleanMesh> mesh;
    bool own = true; ///< it is the one that the tree was baked from
    /// What a unit of each mode adds to each vertex of `mesh`, M by V by 3, metres; empty if that is not known.
    std::vector<float> displacements = {};
    std::optional<ShownSkin> skin = {}; ///< likewise
};

/// Reads the mesh, and if the tree deforms, the modes, which verify_modes() then proves the tree to hold. Either path
/// may be empty. If bones move the tree and the mesh's file has a rig, the same of that. An exact tree brings its own
/// mesh, if none is named, and knows its modes. Fails where modes are
/// named and the tree has no deformation, or that of other modes.
Outcome<ShownMesh> read_shown_mesh(const TreeView& tree, const std::string& path, const MeshOptions& options,
                                   const std::string& modes_path);

} // namespace prolate::cli
