#include "cli/shown_mesh.hpp"

#include "cli/console.hpp"
#include "cli/moving.hpp"

#include <prolate/rig.hpp>

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

// Fills in what the rig of the mesh's file moves, if it is the tree's.
Outcome<> add_rig(const TreeView& tree, const std::string& path, const MeshOptions& options, ShownMesh& out) {
    const auto import = import_options(options, tree.bake_info().placement);
    if (!import) return import.error();
    const auto rig = load_rigged_mesh(path.c_str(), *import);
    if (!rig || rig->bones.empty()) {
        note(path, "has no bones, so they cannot be shown; name the glTF that was baked");
        return kSuccess;
    }
    const auto proof = verify_skin(tree, rig->mesh.view(), rig->skin());
    if (!proof) return failure_of(path, proof.error());
    if (!proof->proved) {
        note(path, "its weights are not those that the tree was baked with, so its bones are not shown");
        return kSuccess;
    }
    const std::vector<uint32_t> sources = sources_of(rig->mesh, out.mesh->mesh.vertices);
    if (tree.deformation() && !rig->modes.empty() && out.displacements.empty()) {
        const auto held = verify_modes(tree, rig->mesh.view(), rig->morphs());
        if (held && held->proved) out.displacements = displacements_at(sources, rig->morphs());
    }
    ShownSkin skin{rig->bones, rig->parents, rig->joints, rig->weights_each, {}, {}};
    for (const size_t vertex : sources)
        for (size_t i = vertex * skin.each; i < (vertex + 1) * skin.each; ++i)
            skin.indices.push_back(rig->indices[i]), skin.weights.push_back(rig->weights[i]);
    out.skin = std::move(skin);
    return kSuccess;
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
    if (tree.skin() && out.own && !path.empty())
        if (const auto added = add_rig(tree, path, options, out); !added) return added.error();
    return out;
}

} // namespace prolate::cli
