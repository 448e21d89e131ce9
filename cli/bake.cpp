// prolate bake: from a mesh file to an .etree file.
#include "cli/common.hpp"

#include <prolate/build.hpp>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <cmath>
#include <filesystem>
#include <memory>

namespace prolate::cli {
namespace {

constexpr const char* kFooter = R"(
Give at most one of --levels, --ellipsoids and --tolerance; without one, 3 levels are made.
Coordinates and lengths are in the mesh's own unit. The same mesh and options give the same bytes.
An open mesh has no certain inside: it is baked in surface mode, where the cover of its triangles is guaranteed.

Examples:
  prolate bake horse.obj -o horse.etree
  prolate bake horse.obj -o horse.etree --ellipsoids 200 --quality best --report horse.json
  prolate bake horse.obj -o horse.etree --tolerance 0.1
  prolate bake horse.obj -o - | ssh robot 'cat > horse.etree')";

struct BakeArguments {
    std::string mesh, output, report;
    std::string method = "voxel", primitive = "ellipsoid", quality = "normal";
    std::optional<uint32_t> levels, ellipsoids;
    std::optional<float> tolerance;
    BuildOptions options;
    bool exact = false, json = false;
};

// The options as the library takes them; or a complaint, in `code`.
std::optional<BuildOptions> options_of(const BakeArguments& a, int& code) {
    BuildOptions options = a.options;
    const auto refuse = [&code](const char* option, const char* what, const char* advice) {
        code = complain(kUsage, option, what, advice);
        return std::nullopt;
    };
    if (a.exact)
        return refuse("--exact", "this version does not store triangles in the leaves yet", "leave the option out");
    if (a.method == "analytic")
        return refuse("--method analytic", "this version does not have the analytic method yet", "use voxel");
    if (a.method != "voxel") return refuse("--method", "no such method", "use voxel");
    if (a.primitive == "sphere")
        return refuse("--primitive sphere", "this version does not make sphere trees yet", "use ellipsoid");
    if (a.primitive != "ellipsoid") return refuse("--primitive", "no such primitive", "use ellipsoid");
    if (a.quality == "fast")
        options.quality = Quality::fast;
    else if (a.quality == "best")
        options.quality = Quality::best;
    else if (a.quality != "normal")
        return refuse("--quality", "no such quality", "use fast, normal or best");
    // The library reads 0 as "not asked".
    if (a.levels == 0u) return refuse("--levels", "must be 1 to 31", "see 'prolate bake --help'");
    if (a.ellipsoids == 0u) return refuse("--ellipsoids", "must be 1 to 65536", "see 'prolate bake --help'");
    if (a.tolerance == 0.0f) return refuse("--tolerance", "must be above 0", "see 'prolate bake --help'");
    options.levels = a.levels.value_or(0);
    options.ellipsoids = a.ellipsoids.value_or(0);
    options.tolerance = a.tolerance.value_or(0);
    if (const auto valid = validate(options); !valid) {
        code = complain("bake", valid.error());
        return std::nullopt;
    }
    return options;
}

nlohmann::ordered_json report_of(const BakeArguments& a, const BuildOptions& options, const Build& build) {
    nlohmann::ordered_json out;
    const BakeInfo info = build.tree.view().bake_info();
    out["mesh"] = a.mesh;
    out["tree"] = a.output;
    out["bytes"] = build.tree.bytes().size();
    out["nodes"] = build.tree.view().node_count();
    out["degree"] = options.degree;
    out["quality"] = a.quality;
    out["alpha"] = options.alpha;
    out["beta"] = options.beta;
    out["seed"] = options.seed;
    out["source_hash"] = fmt::format("{:016x}", info.source_hash);
    out["options_hash"] = fmt::format("{:016x}", info.options_hash);
    out["surface_mode"] = build.surface_mode;
    out["goal_reached"] = build.goal_reached;
    out["solid_volume"] = build.solid_volume;
    out["diagonal"] = build.diagonal;
    out["resolution"] = build.resolution;
    out["seconds"] = build.seconds;
    const MeshReport& m = build.mesh;
    out["diagnosis"] = {{"input_vertices", m.input_vertices},
                        {"input_triangles", m.input_triangles},
                        {"merged_vertices", m.merged_vertices},
                        {"unused_vertices", m.unused_vertices},
                        {"degenerate_triangles", m.degenerate_triangles},
                        {"open_edges", m.open_edges},
                        {"non_manifold_edges", m.non_manifold_edges},
                        {"closed", m.closed}};
    out["levels"] = nlohmann::ordered_json::array();
    for (const LevelReport& level : build.levels)
        out["levels"].push_back({{"nodes", level.nodes},
                                 {"bytes", level.bytes},
                                 {"outside_ratio", level.outside_ratio}, // null if unknown
                                 {"sum_outside_ratio", level.sum_outside_ratio},
                                 {"union_volume", level.union_volume},
                                 {"surface_error", level.surface_error},
                                 {"covered", level.covered},
                                 {"seconds", level.seconds}});
    return out;
}

std::string table_of(const Build& build) {
    std::string out = "level   nodes  outside ratio  covered       bytes  seconds\n";
    for (size_t l = 0; l < build.levels.size(); ++l) {
        const LevelReport& level = build.levels[l];
        const std::string outside = std::isnan(level.outside_ratio) ? "-" : fmt::format("{:.4f}", level.outside_ratio);
        out += fmt::format("{:>5} {:>7} {:>14}  {:>7} {:>11} {:>8.2f}\n", l, grouped(level.nodes), outside,
                           level.covered ? "yes" : "no", grouped(level.bytes), level.seconds);
    }
    return out;
}

// What the user should know of the mesh, one line each.
void diagnose(const std::string& mesh, const MeshReport& report) {
    // Some readers give each triangle corners of its own, so the number merged says little of the file.
    const uint32_t distinct = report.input_vertices - report.merged_vertices - report.unused_vertices;
    note(mesh, fmt::format("{} triangles on {} distinct vertices ({} as read)", grouped(report.input_triangles),
                           grouped(distinct), grouped(report.input_vertices)));
    if (report.degenerate_triangles > 0)
        note(mesh, fmt::format("{} triangles have no area", grouped(report.degenerate_triangles)));
    if (report.non_manifold_edges > 0)
        note(mesh, fmt::format("{} edges belong to three or more triangles", grouped(report.non_manifold_edges)));
    if (!report.closed)
        note(mesh, fmt::format("{} open edges: no inside can be promised, baked in surface mode",
                               grouped(report.open_edges)));
}

int run(const BakeArguments& a) {
    namespace fs = std::filesystem;
    int code = kDone;
    const auto options = options_of(a, code);
    if (!options) return code;
    std::error_code none;
    for (const std::string& output : {a.output, a.report})
        if (!output.empty() && fs::equivalent(output, a.mesh, none))
            return complain(kUsage, output, "is the input itself", "name another output");
    if (!a.report.empty() && a.report == a.output)
        return complain(kUsage, a.report, "is named for the tree and for the report", "name two files");

    // A bake can take long: know first that there is a place for its result.
    if (code = check_output(a.output); code != kDone) return code;
    if (!a.report.empty())
        if (code = check_output(a.report); code != kDone) return code;
    const auto mesh = read_mesh(a.mesh, code);
    if (!mesh) return code;
    const auto built = [&] {
        ProgressLine line;
        return build(mesh->view(), *options,
                     [&line](const BuildProgress& p) { return line.show(p.stage, p.fraction, p.nodes); });
    }();
    if (!built) return complain(a.mesh, built.error());
    if (interrupted()) return complain(a.mesh, Error{ErrorCode::cancelled});
    diagnose(a.mesh, built->mesh);
    if (!built->goal_reached)
        note(a.mesh, "the asked number or tolerance was not reached at this resolution; try --quality best");

    if (code = write_output(a.output, built->tree.bytes()); code != kDone) return code;
    const std::string report = report_of(a, *options, *built).dump(2) + '\n';
    const std::string shown = a.json ? report : table_of(*built);
    if (is_standard_output(a.output))
        fmt::print(stderr, "{}", shown);
    else
        print(shown);
    return a.report.empty() ? static_cast<int>(kDone) : write_output(a.report, report);
}

} // namespace

void add_bake(CLI::App& app, Work& chosen) {
    auto a = std::make_shared<BakeArguments>();
    CLI::App* command = app.add_subcommand("bake", "Make an ellipsoid tree from a mesh, and prove that it covers it");
    command->add_option("mesh", a->mesh, "the mesh: OBJ, PLY, STL, OFF, glTF, GLB, 3DS or DAE")->required();
    command->add_option("-o,--output", a->output, "the .etree file to write, or - for standard output")->required();
    command->add_option("--degree", a->options.degree, "children of a node, 2 ... 64")->capture_default_str();
    command->add_option("--levels", a->levels, "levels below the root, 1 ... 31");
    command->add_option("--ellipsoids", a->ellipsoids, "number of leaves, 1 ... 65536");
    command->add_option("--tolerance", a->tolerance, "outside volume of the leaves / volume of the solid, above 0");
    command->add_option("--method", a->method, "how outside volumes are found: voxel")->capture_default_str();
    command->add_option("--primitive", a->primitive, "what the nodes are: ellipsoid")->capture_default_str();
    command->add_option("--alpha", a->options.alpha, "weight of the surface error")->capture_default_str();
    command->add_option("--beta", a->options.beta, "weight of the outside volume")->capture_default_str();
    command->add_option("--quality", a->quality, "fast, normal or best")->capture_default_str();
    command->add_flag("--exact", a->exact, "not in this version");
    command->add_option("--threads", a->options.threads, "0 = all cores; the result does not depend on it")
        ->capture_default_str();
    command->add_option("--seed", a->options.seed, "of the surface sampling")->capture_default_str();
    command->add_option("--report", a->report, "also write all figures to this JSON file");
    command->add_flag("--json", a->json, "print the figures as JSON");
    command->footer(kFooter);
    command->callback([&chosen, a] { chosen = [a] { return run(*a); }; });
}

} // namespace prolate::cli
