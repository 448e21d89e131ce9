// prolate info: what an .etree file holds and how it was made.
#include "cli/common.hpp"

#include <prolate/version.hpp>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <cmath>
#include <memory>

namespace prolate::cli {
namespace {

constexpr const char* kFooter = R"(
The cut at a level is the nodes of that level and the leaves above it; every cut covers the solid.
The outside ratio is the volume of the cut outside of the solid, divided by the solid's volume.

Examples:
  prolate info horse.etree
  prolate info horse.etree --json | jq .levels)";

struct InfoArguments {
    std::string tree;
    bool json = false;
};

constexpr const char* kMethods[] = {"voxel", "analytic"};
constexpr const char* kPrimitives[] = {"ellipsoid", "sphere"};
constexpr const char* kQualities[] = {"fast", "normal", "best"};

uint32_t cut_size(const TreeView& tree, uint32_t level) {
    uint32_t count = 0;
    tree.for_each_in_cut(level, [&count](uint32_t) { ++count; });
    return count;
}

std::string as_json(const TreeView& tree) {
    nlohmann::ordered_json out;
    const BakeInfo info = tree.bake_info();
    out["format_version"] = kFormatVersion; // the only one that opens
    out["bytes"] = tree.bytes().size();
    out["is_prefix"] = tree.is_prefix();
    out["nodes"] = tree.node_count();
    out["degree"] = tree.degree();
    out["surface_mode"] = info.surface_mode;
    out["solid_volume"] = info.solid_volume;
    out["source_hash"] = fmt::format("{:016x}", info.source_hash);
    out["options_hash"] = fmt::format("{:016x}", info.options_hash);
    out["method"] = kMethods[static_cast<size_t>(info.method)];
    out["primitive"] = kPrimitives[static_cast<size_t>(info.primitive)];
    out["quality"] = kQualities[static_cast<size_t>(info.quality)];
    out["alpha"] = info.alpha;
    out["beta"] = info.beta;
    out["asked"] = {{"levels", info.levels}, {"ellipsoids", info.ellipsoids}, {"tolerance", info.tolerance}};
    out["seed"] = info.seed;
    out["resolution"] = info.resolution;
    out["levels"] = nlohmann::ordered_json::array();
    for (uint32_t l = 0; l < tree.level_count(); ++l) {
        const LevelInfo level = tree.level(l);
        out["levels"].push_back({{"first_node", level.first_node},
                                 {"nodes", level.node_count},
                                 {"cut", cut_size(tree, l)},
                                 {"end_byte", level.end_byte},
                                 {"outside_ratio", level.outside_ratio},
                                 {"surface_error", level.surface_error}});
    }
    return out.dump(2) + '\n';
}

std::string known(float value) {
    return std::isnan(value) ? "-" : fmt::format("{:.4g}", value);
}

std::string as_text(const std::string& name, const TreeView& tree) {
    const BakeInfo info = tree.bake_info();
    std::string out = fmt::format("{}: ellipsoid tree, format version {}, {} bytes\n", name, kFormatVersion,
                                  grouped(tree.bytes().size()));
    if (tree.is_prefix()) out += "  a prefix of a longer file: a coarser tree\n";
    out += fmt::format("  nodes     {} in {} levels, degree {}\n", grouped(tree.node_count()), tree.level_count(),
                       tree.degree());
    if (info.surface_mode)
        out += "  covers    the triangles of an open mesh (surface mode)\n";
    else
        out += fmt::format("  covers    a solid of volume {:.6g}\n", info.solid_volume);
    out +=
        fmt::format("  baked     method {}, primitive {}, quality {}, alpha {:g}, beta {:g}, seed {}, "
                    "resolution {}\n",
                    kMethods[static_cast<size_t>(info.method)], kPrimitives[static_cast<size_t>(info.primitive)],
                    kQualities[static_cast<size_t>(info.quality)], info.alpha, info.beta, info.seed, info.resolution);
    if (info.levels > 0) out += fmt::format("  asked     {} levels below the root\n", info.levels);
    if (info.ellipsoids > 0) out += fmt::format("  asked     {} leaves\n", grouped(info.ellipsoids));
    if (info.tolerance > 0) out += fmt::format("  asked     tolerance {:g}\n", info.tolerance);
    out += fmt::format("  hashes    source {:016x}, options {:016x}\n", info.source_hash, info.options_hash);
    out += "level    nodes      cut  outside ratio  surface error    end byte\n";
    for (uint32_t l = 0; l < tree.level_count(); ++l) {
        const LevelInfo level = tree.level(l);
        out += fmt::format("{:>5} {:>8} {:>8} {:>14} {:>14} {:>11}\n", l, grouped(level.node_count),
                           grouped(cut_size(tree, l)), known(level.outside_ratio), known(level.surface_error),
                           grouped(level.end_byte));
    }
    return out;
}

int run(const InfoArguments& a) {
    int code = kDone;
    const auto tree = read_tree(a.tree, code);
    if (!tree) return code;
    print(a.json ? as_json(tree->view()) : as_text(a.tree, tree->view()));
    return kDone;
}

} // namespace

void add_info(CLI::App& app, Work& chosen) {
    auto a = std::make_shared<InfoArguments>();
    CLI::App* command = app.add_subcommand("info", "Show what an .etree file holds and how it was made");
    command->add_option("tree", a->tree, "the .etree file")->required();
    command->add_flag("--json", a->json, "print JSON");
    command->footer(kFooter);
    command->callback([&chosen, a] { chosen = [a] { return run(*a); }; });
}

} // namespace prolate::cli
