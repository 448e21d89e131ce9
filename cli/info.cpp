// prolate info: what an .etree file holds and how it was made.
#include "cli/commands.hpp"
#include "cli/console.hpp"
#include "cli/grouped.hpp"
#include "cli/inputs.hpp"
#include "cli/levels.hpp"
#include "cli/words.hpp"

#include <prolate/mesh.hpp>
#include <prolate/version.hpp>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

namespace prolate::cli {
namespace {

constexpr const char* kInfoExamples = R"(

Examples:
  prolate info horse.etree
  prolate info horse.etree --json | jq .levels)";

struct InfoArguments {
    std::string tree;
    bool json = false;
};

// Kinds of sections that this version makes nothing of.
std::vector<std::string> unknown_sections(const TreeView& tree) {
    std::vector<std::string> out;
    for (uint32_t s = 0; s < tree.section_count(); ++s) {
        const Section section = tree.section(s);
        const std::string kind(section.kind, sizeof section.kind);
        if (kind != "INNR" && kind != "DFRM") out.push_back(kind);
    }
    return out;
}

std::string as_json(const TreeView& tree) {
    nlohmann::ordered_json out;
    out["format_version"] = tree.format_version();
    out["is_prefix"] = tree.is_prefix();
    out.update(header_json(tree));
    out["unknown_sections"] = nlohmann::ordered_json::array();
    for (const std::string& kind : unknown_sections(tree)) out["unknown_sections"].push_back(kind);
    out["levels"] = nlohmann::ordered_json::array();
    for (uint32_t l = 0; l < tree.level_count(); ++l) {
        const LevelInfo level = tree.level(l);
        nlohmann::ordered_json one{{"first_node", level.first_slot},
                                   {"nodes", level.node_count},
                                   {"blocks", level.block_count},
                                   {"cut", cut_size(tree, l)},
                                   {"end_byte", level.end_byte}};
        one.update(level_json(tree, l));
        out["levels"].push_back(std::move(one));
    }
    return text_of(out);
}

// How far apart vertices may have been that clean() joined.
double weld_tolerance(const TreeView& tree) {
    if (const float asked = tree.bake_info().weld; asked >= 0) return double{asked};
    float largest = 0;
    for (uint32_t v = 0; v < tree.vertex_count(); ++v) {
        const Vec3 p = tree.vertex(v);
        largest = std::max({largest, std::abs(p.x), std::abs(p.y), std::abs(p.z)});
    }
    return default_weld(largest);
}

// Volume, centre and tensor of the solid with density 1.
std::string mass_text(const MassProperties& mass) {
    const auto& [x, y, z] = mass.center;
    const auto& [xx, yy, zz, xy, xz, yz] = mass.inertia;
    return fmt::format("  mass      {:.9g} (+/- {:.0e}) at density 1, centre ({:.9g}, {:.9g}, {:.9g}) (+/- {:.0e})\n"
                       "  inertia   about the centre, xx yy zz xy xz yz: {:.9g} {:.9g} {:.9g} {:.9g} {:.9g} {:.9g} "
                       "(+/- {:.0e})\n",
                       mass.volume, mass.volume_error, x, y, z, mass.center_error, xx, yy, zz, xy, xz, yz,
                       mass.inertia_error);
}

std::string as_text(const std::string& name, const TreeView& tree) {
    const BakeInfo info = tree.bake_info();
    std::string out = fmt::format("{}: ellipsoid tree, format version {}, {} bytes\n", visible(name),
                                  tree.format_version(), grouped(tree.bytes().size()));
    if (tree.is_prefix()) out += "  a prefix of a longer file: a coarser tree\n";
    out += fmt::format("  nodes     {} in {} levels, degree {}; {} blocks, {:.1f} bytes a node\n",
                       grouped(tree.node_count()), tree.level_count(), tree.degree(), grouped(tree.block_count()),
                       bytes_per_node(tree));
    if (tree.has_triangles())
        out += fmt::format("  exact     {} triangles on {} vertices, {} connected component{}\n",
                           grouped(tree.triangle_count()), grouped(tree.vertex_count()),
                           grouped(tree.component_count()), tree.component_count() == 1 ? "" : "s");
    if (const double weld = weld_tolerance(tree); info.exact && weld > 0)
        out += fmt::format("  welded    corners up to {:.2g} m apart may be one, where that closed the mesh\n", weld);
    if (info.surface_mode)
        out +=
            fmt::format("  covers    the triangles of an open mesh (surface mode), diagonal {:.6g}\n", info.diagonal);
    else
        out += fmt::format("  covers    {} of volume {:.6g} (+/- {:.0e}), diagonal {:.6g}\n",
                           info.exact ? "the surface of a solid" : "a solid", info.solid_volume,
                           info.solid_volume * double{info.solid_volume_error}, info.diagonal);
    if (info.fill > 0)
        out += fmt::format("  filled    what a ball of radius {:g} cannot reach from outside is part of the solid\n",
                           info.fill);
    if (info.mass.volume > 0) out += mass_text(info.mass);
    if (const auto& [x, y, z] = info.placement.scale; info.placement.scale != Placement{}.scale)
        out += fmt::format("  scale     the mesh's file times {:g}, {:g}, {:g}\n", x, y, z);
    if (const auto& [x, y, z] = info.placement.origin; info.placement.origin != Placement{}.origin)
        out += fmt::format(
            "  origin    ({:.12g}, {:.12g}, {:.12g}): all coordinates here and in answers are relative to it\n", x, y,
            z);
    if (!info.exact)
        out += fmt::format("  baked     method {}, primitive {}, quality {}, alpha {:g}, beta {:g}, seed {}, "
                           "resolution {}\n",
                           name_of(info.method), name_of(info.primitive), name_of(info.quality), info.alpha, info.beta,
                           info.seed, info.resolution);
    if (info.levels > 0) out += fmt::format("  asked     {} levels below the root\n", info.levels);
    const bool at_most = info.tolerance > 0 || info.distance > 0 || info.keep_holes > 0;
    if (info.ellipsoids > 0)
        out += fmt::format("  asked     {}{} leaves\n", at_most ? "at most " : "", grouped(info.ellipsoids));
    if (info.tolerance > 0) out += fmt::format("  asked     outside ratio of at most {:g}\n", info.tolerance);
    if (info.distance > 0)
        out += fmt::format("  asked     distance of at most {:g} % of the diagonal ({:.3g})\n", info.distance,
                           0.01 * double{info.distance} * info.diagonal);
    if (info.keep_holes > 0) out += fmt::format("  asked     holes free for a ball of radius {:g}\n", info.keep_holes);
    if (!info.goal_reached) out += "  missed    what was asked could not be met at this resolution\n";
    out += inner_text(tree) + motion_text(tree);
    for (const std::string& kind : unknown_sections(tree))
        out += fmt::format("  skipped   a section {}, which this version does not know\n", kind);
    out += fmt::format("  hashes    source {:016x}, options {:016x}\n", info.source_hash, info.options_hash);
    out += level_table(tree);
    return out;
}

Outcome<ExitCode> run(const InfoArguments& a) {
    const auto tree = read_tree(a.tree);
    if (!tree) return tree.error();
    print(a.json ? as_json(tree->view()) : as_text(a.tree, tree->view()));
    return kDone;
}

} // namespace

void add_info(CLI::App& app, Work& chosen) {
    auto a = std::make_shared<InfoArguments>();
    CLI::App* command = app.add_subcommand("info", "Show what an .etree file holds and how it was made");
    command->add_option("tree", a->tree, "the .etree file, or - for standard input")->required();
    command->add_flag("--json", a->json, "print JSON");
    command->footer(std::string(kLevelTableHelp) + kInfoExamples);
    command->callback([&chosen, a] { chosen = [a] { return run(*a); }; });
}

} // namespace prolate::cli
