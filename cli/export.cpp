// prolate export: the tree's ellipsoids for other programs.
#include "cli/commands.hpp"
#include "cli/export/formats.hpp"
#include "cli/inputs.hpp"
#include "cli/outputs.hpp"
#include "cli/view_option.hpp"
#include "cli/words.hpp"

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <memory>

namespace prolate::cli {
namespace {

constexpr const char* kFormats[] = {"csv", "json", "ply", "obj", "glb", "pov"};

constexpr const char* kExportFooter = R"(
The cut at a level (its nodes and the leaves above it) covers the solid. With --level L, the cut at L is exported.
Without, csv has the cut at every level, so that leaves appear once for each level; json has every node once, with
its own level; the others have the finest cut. Nodes are named by their slots in the file, which have gaps. For an
exact tree, these are the ellipsoids, and json adds the triangles of each leaf, by their index in the file.

  csv   level,cx,cy,cz,r1,r2,r3,R11,...,R33: center, radii, and the rotation row by row; its column i is the direction
        of radius i
  json  the same, the factor L of {center + L u : |u| <= 1} row by row, and the tree's links
  ply, obj  ellipsoids as meshes
  glb   glTF 2.0, for Blender and viewers: a sphere, and for each ellipsoid a node that moves, rotates and stretches it
  pov   a POV-Ray scene with true ellipsoids, a camera, an area light and a ground plane

What covers: centers and factors (json, pov) are exact, even when read in single precision. Radii (csv, json) are
rounded up and cover when read in double precision; for single precision, multiply them by 1 + 3e-7 r1 / r3. Meshes
for collision (ply and obj, unless you give --no-outer) have their triangles outside the ellipsoids, even when read
in single precision, and cover. Meshes for viewing (glb, unless you give --outer) have their corners on the
ellipsoids and do not cover.

An obj for collision has no parts and no colors, because simulators drop triangles of parts; many of them take the
convex hull of a whole file. With --no-outer, obj names each ellipsoid by its node. ply has a color for each corner.

Colors are those of "prolate render": a hue for each child of the root, shared by all nodes below it.

Examples:
  prolate export horse.etree -o cover.csv --level 2
  prolate export horse.etree -o - --format csv | wc -l
  prolate export horse.etree -o cover.glb --level 2
  prolate export horse.etree -o cover.obj --segments 64
  prolate export horse.etree -o cover.pov && povray +Icover.pov +W1200 +H900 +A0.1)";

struct ExportArguments {
    std::string tree, output, format;
    std::optional<uint32_t> level;
    uint32_t segments = 32;
    std::optional<bool> outer;
    ViewWords view;
    Outputs outputs;
};

void add_cut(const TreeView& tree, uint32_t level, Selection& to) {
    tree.for_each_in_cut(level, [&to](uint32_t node) { to.nodes.push_back(node); });
    to.levels.resize(to.nodes.size(), level);
}

// Of each level what covers the solid: whoever reads the rows of one level has a whole cover.
Selection all_cuts(const TreeView& tree) {
    Selection out;
    for (uint32_t l = 0; l < tree.level_count(); ++l) add_cut(tree, l, out);
    return out;
}

Selection all_nodes(const TreeView& tree) {
    Selection out;
    for (uint32_t l = 0; l < tree.level_count(); ++l) {
        tree.for_each_node(l, [&out](uint32_t node) { out.nodes.push_back(node); });
        out.levels.resize(out.nodes.size(), l);
    }
    return out;
}

Selection cut_at(const TreeView& tree, uint32_t level) {
    Selection out;
    add_cut(tree, level, out);
    return out;
}

std::string content(const TreeView& tree, std::string_view format, const ExportArguments& a, const View& view) {
    if (format == "csv") return as_csv(tree, a.level ? cut_at(tree, *a.level) : all_cuts(tree));
    if (format == "json") return as_json(tree, a.level ? cut_at(tree, *a.level) : all_nodes(tree));
    const std::vector<Piece> pieces = pieces_of(tree, a.level.value_or(tree.level_count() - 1));
    const Facets facets = a.outer.value_or(format != "glb") ? Facets::outer : Facets::inscribed;
    if (format == "ply") return as_ply(pieces, a.segments, facets);
    if (format == "obj") return as_obj(pieces, a.segments, facets);
    if (format == "glb") return as_glb(pieces, a.segments, facets);
    return as_pov(pieces, view);
}

Outcome<ExitCode> run(ExportArguments& a) {
    const std::string format = a.format.empty() ? extension(a.output) : a.format;
    if (std::find(std::begin(kFormats), std::end(kFormats), format) == std::end(kFormats))
        return Failure{kUsage, format.empty() ? a.output : format,
                       format.empty() ? "the format is not clear from the name" : "no such export format",
                       "use csv, json, ply, obj, glb or pov, as the extension or with --format"};
    const auto viewer = view_of(a.view);
    if (!viewer) return viewer.error();
    a.outputs.reads(a.tree, "the tree");
    if (const auto claimed = a.outputs.claim(a.output, "the output", format); !claimed) return claimed.error();
    const auto tree = read_tree(a.tree);
    if (!tree) return tree.error();
    const TreeView view = tree->view();
    if (a.level && *a.level >= view.level_count())
        return Failure{kUsage, "--level", fmt::format("the tree has no level {}", *a.level),
                       fmt::format("its levels are 0 to {}", view.level_count() - 1)};
    const auto written = a.outputs.write(a.output, content(view, format, a, *viewer));
    if (!written) return written.error();
    return kDone;
}

} // namespace

void add_export(CLI::App& app, Work& chosen) {
    auto a = std::make_shared<ExportArguments>();
    CLI::App* command = app.add_subcommand("export", "Write a tree's ellipsoids as csv, json, ply, obj, glb or pov");
    command->add_option("tree", a->tree, "the .etree file, or - for standard input")->required();
    command->add_option("-o,--output", a->output, "the file to write, or - for standard output")->required();
    command->add_option("--format", a->format, "csv, json, ply, obj, glb or pov (default: the output's extension)");
    command->add_option("--level", a->level, "export the cut at this level, 0 = the root");
    command->add_option("--segments", a->segments, "ply, obj, glb: edges around an ellipsoid, a multiple of 4")
        ->check(CLI::Range(4u, kMaxSegments))
        ->capture_default_str();
    command->add_flag_function(
        "--outer,!--no-outer", [a](int64_t count) { a->outer = count > 0; },
        "ply, obj, glb: triangles outside the ellipsoids, so that the meshes cover (default: not for glb)");
    declare_view(*command, a->view, "pov: ");
    a->outputs.declare(*command);
    command->footer(kExportFooter);
    command->callback([&chosen, a] { chosen = [a] { return run(*a); }; });
}

} // namespace prolate::cli
