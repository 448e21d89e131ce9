// What the viewer's page is told: bodies, levels, nodes, meshes, colours. viewer/scene.js reads it.
#pragma once

#include "cli/shown_mesh.hpp"
#include "cli/view/page.hpp"

#include <prolate/mesh.hpp>
#include <prolate/tree.hpp>

#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace prolate::cli {

/// A tree with its mesh, if there is one. An exact tree brings its own.
struct ViewBody {
    std::string tree_name, mesh_name;
    TreeView tree;
    std::optional<CleanMesh> mesh;
    bool own_mesh = true; ///< the mesh is the one that the tree was baked from
    /// What a unit of each mode adds to each vertex of `mesh`, M by V by 3, metres; empty if that is not known.
    std::vector<float> displacements = {};
    std::optional<ShownSkin> skin = {};
};

/// Describes one body, and puts its numbers into `numbers`. `with_file`: the bytes of the tree too, for queries.
/// `progress`, called with the fraction done, may return false to stop; then there is no answer.
std::optional<nlohmann::ordered_json> view_body(const ViewBody& body, NumberBlock& numbers, bool with_file,
                                                const std::function<bool(double)>& progress);

} // namespace prolate::cli
