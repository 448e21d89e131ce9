#include "cli/shown_mesh.hpp"

#include "cli/moving.hpp"

#include <utility>

namespace prolate::cli {
namespace {

// The mesh that an exact tree holds.
CleanMesh mesh_of_tree(const TreeView& tree) {
    CleanMesh out;
    for (uint32_t v = 0; v < tree.vertex_count(); ++v) out.mesh.vertices.push_back(tree.vertex(v));
    for (uint32_t t = 0; t < tree.triangle_count(); ++t) out.mesh.triangles.push_back(tree.triangle(t));
    out.report.closed = !tree.surface_mode();
    return out;
}

} // namespace

Outcome<ShownMesh> read_shown_mesh(const TreeView& tree, const std::string& path, const MeshOptions& options,
                                   const std::string& modes_path) {
    ShownMesh out;
    if (!modes_path.empty() && path.empty())
        return Failure{kUsage, "--modes", "there is no mesh that they move", "name the mesh after the tree"};
    if (!path.empty()) {
        auto read = read_mesh_of(tree, path, options);
        if (!read) return read.error();
        out.own = read->own;
        if (!modes_path.empty()) {
            auto displacements = displacements_of(tree, read->as_read, read->cleaned.mesh.vertices, modes_path);
            if (!displacements) return displacements.error();
            out.displacements = std::move(*displacements);
        }
        out.mesh = std::move(read->cleaned);
    }
    // By the numbers of the tree's own vertices it knows how they move.
    if (tree.has_triangles() && out.own && (!out.mesh || tree.deformation())) {
        out.mesh = mesh_of_tree(tree);
        if (tree.deformation()) out.displacements = displacements_of(tree);
    }
    return out;
}

} // namespace prolate::cli
