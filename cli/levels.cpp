#include "cli/levels.hpp"

#include "cli/generator.hpp"
#include "cli/grouped.hpp"

#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <cstring>

namespace prolate::cli {
namespace {

// The file holds floats: the shortest decimal number that gives the same float, instead of all digits of a double.
double shortest(double value) {
    return std::isfinite(value) ? std::strtod(fmt::format("{}", static_cast<float>(value)).c_str(), nullptr) : value;
}

std::string known(const char* format, double value) {
    return std::isnan(value) ? "-" : fmt::format(fmt::runtime(format), value);
}

double percent(double length, double diagonal) {
    return diagonal > 0 ? 100 * length / diagonal : LevelFigures::kUnknown;
}

// Bytes of a section, by its kind.
size_t section_size(const TreeView& tree, const char* kind) {
    for (uint32_t s = 0; s < tree.section_count(); ++s)
        if (std::memcmp(tree.section(s).kind, kind, 4) == 0) return tree.section(s).content.size();
    return 0;
}

} // namespace

const char* const kLevelTableHelp = R"(
The table has a row for each level. Its figures are about the cut: the nodes of that level and the leaves above it,
as stored in the file. Every cut covers the solid; that of an exact tree covers the surface, and has no figures.
  outside ratio  volume of the cut outside the solid / volume of the solid
  +/-            estimated error of that ratio
  singly         the same ratio, summed over the ellipsoids one by one, so that overlaps count several times
  E_sur          largest radial distance between an ellipsoid and the surface points that it stands for
  H              distance of the cover from the solid (one-sided Hausdorff; of an open mesh, from its triangles):
                 maximum, and mean and 99th percentile over the cover's surface
E_sur and H are in percent of the diagonal of the mesh's bounding box.)";

uint32_t cut_size(const TreeView& tree, uint32_t level) {
    uint32_t count = 0;
    tree.for_each_in_cut(level, [&count](uint32_t) { ++count; });
    return count;
}

double bytes_per_node(const TreeView& tree) {
    return static_cast<double>(kBlockBytes) * tree.block_count() / tree.node_count();
}

std::string level_table(const TreeView& tree, std::span<const double> seconds) {
    const BakeInfo info = tree.bake_info();
    std::string out = fmt::format("{:>26}{:>32}\n", "outside ratio", "% of the diagonal");
    out +=
        fmt::format("level {:>7} {:>8} {:>6} {:>8} {:>7} {:>7} {:>7} {:>7} {:>7} {:>11}{}\n", "nodes", "union", "+/-",
                    "singly", "E_sur", "H max", "mean", "99 %", "covered", "bytes", seconds.empty() ? "" : "  seconds");
    for (uint32_t l = 0; l < tree.level_count(); ++l) {
        const LevelInfo level = tree.level(l);
        const auto share = [&](double length) { return known("{:.3f}", percent(length, info.diagonal)); };
        out += fmt::format("{:>5} {:>7} {:>8} {:>6} {:>8} {:>7} {:>7} {:>7} {:>7} {:>7} {:>11}", l,
                           grouped(cut_size(tree, l)), known("{:.4f}", level.outside_ratio),
                           known("{:.0e}", level.outside_ratio_error), known("{:.3f}", level.sum_outside_ratio),
                           share(level.surface_error), share(level.hausdorff_max), share(level.hausdorff_mean),
                           share(level.hausdorff_p99), info.proved ? "proved" : "-", grouped(level.end_byte));
        out += l < seconds.size() ? fmt::format(" {:>8.2f}\n", seconds[l]) : "\n";
    }
    if (tree.has_triangles())
        out += fmt::format("with {} triangles {:>82}\n", grouped(tree.triangle_count()), grouped(tree.bytes().size()));
    return out;
}

nlohmann::ordered_json level_json(const TreeView& tree, uint32_t l) {
    const LevelInfo level = tree.level(l);
    const BakeInfo info = tree.bake_info();
    const auto share = [&](double length) { return shortest(percent(length, info.diagonal)); };
    return {{"outside_ratio", shortest(level.outside_ratio)},
            {"outside_ratio_error", shortest(level.outside_ratio_error)},
            {"sum_outside_ratio", shortest(level.sum_outside_ratio)},
            {"union_volume", level.union_volume},
            {"surface_error", shortest(level.surface_error)},
            {"hausdorff_max", shortest(level.hausdorff_max)},
            {"hausdorff_mean", shortest(level.hausdorff_mean)},
            {"hausdorff_p99", shortest(level.hausdorff_p99)},
            {"percent_of_diagonal",
             {{"surface_error", share(level.surface_error)},
              {"hausdorff_max", share(level.hausdorff_max)},
              {"hausdorff_mean", share(level.hausdorff_mean)},
              {"hausdorff_p99", share(level.hausdorff_p99)}}},
            {"covered", info.proved}};
}

nlohmann::ordered_json inner_json(const TreeView& tree) {
    const auto inner = tree.inner();
    if (!inner) return nullptr;
    const uint32_t last = inner->level_count() - 1;
    const double volume = inner->level(last).union_volume;
    return {{"ellipsoids", cut_size(*inner, last)},
            {"levels", inner->level_count()},
            {"bytes", inner->bytes().size()},
            {"union_volume", volume},
            {"share_of_solid", shortest(volume / inner->bake_info().solid_volume)}};
}

std::string inner_text(const TreeView& tree) {
    const auto inner = tree.inner();
    if (!inner) return "";
    const uint32_t last = inner->level_count() - 1;
    return fmt::format("  inside    {} ellipsoids in {} levels, {:.1f} % of the solid; proved; {} bytes\n",
                       grouped(cut_size(*inner, last)), inner->level_count(),
                       100 * inner->level(last).union_volume / inner->bake_info().solid_volume,
                       grouped(inner->bytes().size()));
}

std::string motion_text(const TreeView& tree) {
    std::string out;
    if (const auto modes = tree.deformation()) {
        std::string ranges;
        for (uint32_t m = 0; m < modes->mode_count(); ++m)
            ranges += fmt::format("{}{:g}", m == 0 ? "" : ", ", modes->range(m));
        out += fmt::format("  deforms   by {} mode{}, coordinates within {}; proved; {} bytes\n", modes->mode_count(),
                           modes->mode_count() == 1 ? "" : "s", ranges, grouped(section_size(tree, "DFRM")));
    }
    if (const auto skin = tree.skin())
        out += fmt::format("  skinned   by {} bone{}, at all matrices; proved; {} bytes\n", skin->bone_count(),
                           skin->bone_count() == 1 ? "" : "s", grouped(section_size(tree, "SKIN")));
    return out;
}

nlohmann::ordered_json header_json(const TreeView& tree) {
    const BakeInfo info = tree.bake_info();
    nlohmann::ordered_json out;
    out["bytes"] = tree.bytes().size();
    out["mode_ranges"] = nlohmann::ordered_json::array();
    if (const auto modes = tree.deformation())
        for (uint32_t m = 0; m < modes->mode_count(); ++m) out["mode_ranges"].push_back(modes->range(m));
    out["modes_bytes"] = section_size(tree, "DFRM");
    out["bones"] = tree.skin() ? tree.skin()->bone_count() : 0;
    out["skin_bytes"] = section_size(tree, "SKIN");
    out["nodes"] = tree.node_count();
    out["blocks"] = tree.block_count();
    out["bytes_per_node"] = bytes_per_node(tree);
    out["degree"] = tree.degree();
    out["exact"] = info.exact;
    out["triangles"] = tree.triangle_count(); // 0 in a prefix, as the next two
    out["vertices"] = tree.vertex_count();
    out["components"] = tree.component_count();
    out["method"] = name_of(info.method);
    out["primitive"] = name_of(info.primitive);
    out["quality"] = name_of(info.quality);
    out["alpha"] = shortest(info.alpha);
    out["beta"] = shortest(info.beta);
    out["seed"] = info.seed;
    out["asked"] = {{"levels", info.levels},
                    {"ellipsoids", info.ellipsoids},
                    {"tolerance", shortest(info.tolerance)},
                    {"distance", shortest(info.distance)},
                    {"keep_holes", shortest(info.keep_holes)}};
    out["fill"] = shortest(info.fill);
    out["goal_reached"] = info.goal_reached;
    out["source_hash"] = fmt::format("{:016x}", info.source_hash);
    out["options_hash"] = fmt::format("{:016x}", info.options_hash);
    out["surface_mode"] = info.surface_mode;
    out["solid_volume"] = info.solid_volume;
    out["solid_volume_error"] = shortest(info.solid_volume * double{info.solid_volume_error});
    const MassProperties& mass = info.mass;
    out["mass"] = {{"volume", mass.volume},   {"volume_error", mass.volume_error},
                   {"center", mass.center},   {"center_error", mass.center_error},
                   {"inertia", mass.inertia}, {"inertia_error", mass.inertia_error}};
    out["diagonal"] = info.diagonal;
    out["scale"] = info.placement.scale;
    out["origin"] = info.placement.origin;
    out["weld"] = info.weld < 0 ? nlohmann::ordered_json("default") : nlohmann::ordered_json(shortest(info.weld));
    out["resolution"] = info.resolution;
    out["inner"] = inner_json(tree);
    return out;
}

std::string text_of(const nlohmann::ordered_json& json) {
    nlohmann::ordered_json out{{"generator", generator()}};
    out.update(json);
    return out.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + '\n';
}

const char* name_of(Method method) {
    return method == Method::voxel ? "voxel" : "analytic";
}
const char* name_of(Primitive primitive) {
    return primitive == Primitive::ellipsoid ? "ellipsoid" : "sphere";
}
const char* name_of(Quality quality) {
    return quality == Quality::fast ? "fast" : quality == Quality::normal ? "normal" : "best";
}

} // namespace prolate::cli
