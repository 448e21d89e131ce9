#include "cli/mesh_options.hpp"

#include "cli/console.hpp"
#include "cli/grouped.hpp"
#include "cli/inputs.hpp"
#include "cli/length.hpp"

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace prolate::cli {

void declare_mesh_options(CLI::App& app, MeshOptions& options, bool tree) {
    const std::string unless = tree ? " (default: as the tree was baked)" : "";
    std::vector<std::string> names;
    for (const LengthUnit& unit : length_units()) names.emplace_back(unit.name);
    app.add_option("--unit", options.unit,
                   "unit of the mesh's file: mm, cm, m, in or ft; coordinates become metres" + unless)
        ->check(CLI::IsMember(names));
    app.add_option("--scale", options.scale,
                   "multiply the mesh's coordinates by S, or by X,Y,Z; negative mirrors" + unless)
        ->delimiter(',')
        ->expected(1, 3)
        ->allow_extra_args(false); // or it would swallow the file names that follow
    app.add_flag("--recentre", options.recentre, "read a mesh far from (0, 0, 0) around a local origin" + unless);
}

Outcome<ImportOptions> import_options(const MeshOptions& options, const std::optional<Placement>& placement) {
    const bool says_nothing = options.unit.empty() && options.scale.empty() && !options.recentre;
    if (placement && says_nothing) return placed_as(*placement);
    ImportOptions out;
    if (const LengthUnit* const unit = find_length_unit(options.unit)) out.unit = unit->metres;
    const auto sound = [](double s) { return std::isfinite(s) && s != 0; };
    if (options.scale.size() == 2 || !std::all_of(options.scale.begin(), options.scale.end(), sound))
        return Failure{kUsage, "--scale", "must be one number or three, none of them 0", "write it as 0.001 or 1,1,-1"};
    for (size_t k = 0; k < 3 && !options.scale.empty(); ++k)
        out.scale[k] = options.scale[options.scale.size() == 3 ? k : 0];
    out.recentre = options.recentre;
    return out;
}

Outcome<MeshOfTree> read_mesh_of(const TreeView& tree, const std::string& path, const MeshOptions& options) {
    const BakeInfo info = tree.bake_info();
    const auto import = import_options(options, info.placement);
    if (!import) return import.error();
    auto mesh = read_mesh(path, *import);
    if (!mesh) return mesh.error();
    auto cleaned = clean(mesh->view(), info.weld);
    if (!cleaned) return failure_of(path, cleaned.error());
    const bool own = hash(cleaned->mesh.view()) == info.source_hash;
    return MeshOfTree{std::move(*mesh), std::move(*cleaned), own};
}

std::string size_text(const MeshReport& report) {
    return fmt::format("{:.6g} x {:.6g} x {:.6g} m", report.size[0], report.size[1], report.size[2]);
}

void describe_mesh(const std::string& path, const MeshReport& report, TreeKind tree) {
    // Some readers give each triangle corners of its own, so the number merged says little of the file.
    const uint32_t distinct =
        report.input_vertices - report.merged_vertices - report.welded_vertices - report.unused_vertices;
    note(path, fmt::format("{} triangles on {} distinct vertices ({} as read), box {}", grouped(report.input_triangles),
                           grouped(distinct), grouped(report.input_vertices), size_text(report)));
    if (report.welded_vertices > 0)
        note(path, fmt::format("{} vertices joined with others up to {:.2g} m away, which closes the mesh; {}",
                               grouped(report.welded_vertices), report.weld_distance,
                               tree.exact ? "answers are for the joined mesh"
                                          : "the surface is covered as it was before, too"));
    if (report.turned_shells > 0)
        note(path, fmt::format("{} closed part{} inside out: reversed", grouped(report.turned_shells),
                               report.turned_shells == 1 ? " was" : "s were"));
    if (report.degenerate_triangles > 0)
        note(path, fmt::format("{} triangles have no area", grouped(report.degenerate_triangles)));
    if (report.non_manifold_edges > 0)
        note(path, fmt::format("{} edges belong to three or more triangles", grouped(report.non_manifold_edges)));
    if (!report.closed && report.open_edges == 0 && !tree.filled)
        note(path, "each triangle is also there in reverse, so the mesh encloses nothing (surface mode)");
    if (report.open_edges > 0 && !tree.filled)
        note(path,
             fmt::format("{} open edges: no inside can be promised, so only the triangles are covered (surface mode)",
                         grouped(report.open_edges)));
}

} // namespace prolate::cli
