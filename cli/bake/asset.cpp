#include "cli/bake/asset.hpp"

#include "cli/bake/goals.hpp"
#include "cli/bake/modes_file.hpp"
#include "cli/console.hpp"
#include "cli/inputs.hpp"
#include "cli/length.hpp"
#include "cli/levels.hpp"
#include "cli/progress_line.hpp"
#include "cli/signals.hpp"

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include <chrono>
#include <filesystem>
#include <tuple>
#include <utility>

#include <fcntl.h>
#include <sys/stat.h>

namespace prolate::cli {
namespace {

namespace fs = std::filesystem;

// The tree in the output file, if there is one to be looked at.
std::optional<Tree> old_output(const Asset& a) {
    std::error_code none;
    if (!a.modes.empty() || a.skin) return {}; // of which the options' hash knows nothing
    if (is_standard_output(a.output) || !fs::is_regular_file(a.output, none)) return {};
    auto tree = load(a.output.c_str());
    if (!tree) return {};
    return std::move(*tree);
}

// The tree of the mesh with this hash, if it need not be baked.
std::optional<Baked> reuse(std::optional<Tree>& old, const BakeCache& cache, uint64_t mesh, uint64_t options) {
    if (old && is_bake_of(old->view(), mesh, options)) return Baked{Source::unchanged, std::move(*old), {}, {}};
    if (auto tree = cache.find(mesh, options)) return Baked{Source::cached, std::move(*tree), {}, {}};
    return {};
}

// Reuses or bakes; writes nothing but cache entries.
Outcome<Baked> make(const Asset& a, BakeCache& cache, bool rebake, const std::string& label) {
    const auto options = options_of(a);
    if (!options) return options.error();
    const auto import = import_options(a.mesh_options);
    if (!import) return import.error();
    const uint64_t key = hash(*options);
    std::optional<Tree> old = rebake ? std::nullopt : old_output(a);

    // The file's bytes say which mesh it is, if they have been seen before.
    std::optional<uint64_t> file;
    if (cache) file = hash_mesh_file(a.mesh.c_str(), *import);
    if (file && !rebake)
        if (const auto seen = cache.find_source(*file))
            if (auto baked = reuse(old, cache, *seen, key)) return std::move(*baked);

    const auto mesh = read_mesh(a.mesh, *import);
    if (!mesh) return mesh.error();
    // The mesh itself says it, if there is anything to compare it with.
    if ((old && old->view().bake_info().options_hash == key) || cache) {
        const auto cleaned = clean(mesh->view(), options->weld, not_interrupted);
        if (!cleaned) return failure_of(a.mesh, cleaned.error());
        const uint64_t source = hash(cleaned->mesh.view());
        // Remembered only if the file was the same before and after it was read.
        if (file && *file == hash_mesh_file(a.mesh.c_str(), *import)) cache.keep_source(*file, source);
        if (!rebake)
            if (auto baked = reuse(old, cache, source, key)) {
                baked->diagnosis = cleaned->report;
                return std::move(*baked);
            }
    }
    if (const auto possible = check_lengths(a, *options, mesh->view()); !possible) return possible.error();
    auto built = [&] {
        ProgressLine line(label);
        return build(mesh->view(), *options,
                     [&line](const BuildProgress& p) { return line.show(p.stage, p.fraction, p.nodes); });
    }();
    if (built && interrupted()) built = Error{ErrorCode::cancelled};
    if (!built) return failure_of(a.mesh, built.error());
    describe_mesh(a.mesh, built->mesh, {.exact = options->exact, .filled = options->fill > 0});
    Baked baked{Source::baked, std::move(built->tree), built->mesh, {}, built->hole_radius};
    for (const LevelReport& level : built->levels) baked.level_seconds.push_back(level.seconds);
    return baked;
}

// With the ranges of the command line, if there are any.
Outcome<RiggedMesh> read_rigged(const Asset& a, const ImportOptions& import) {
    auto rigged = read_rigged_mesh(a.mesh, import);
    if (!rigged || a.ranges.empty()) return rigged;
    const size_t modes = rigged->modes.size();
    if (a.ranges.size() != 1 && a.ranges.size() != modes)
        return Failure{kUsage, "--range",
                       fmt::format("has {} values for {} morph targets of {}", a.ranges.size(), modes, a.mesh),
                       "give one for all, or one each"};
    rigged->ranges = a.ranges.size() == 1 ? std::vector<float>(modes, a.ranges[0]) : a.ranges;
    return rigged;
}

// Before a long bake: can the modes and the skin be read?
Outcome<> check_modes(const Asset& a) {
    if (a.skin && !a.modes.empty())
        return Failure{kUsage, "--skin", "takes the file's morph targets for modes", "give it, or --modes"};
    if (a.skin && is_standard_input(a.mesh))
        return Failure{kUsage, "--skin", "needs a mesh that can be read twice", "give the name of a file"};
    if (a.skin) {
        const auto import = import_options(a.mesh_options);
        if (!import) return import.error();
        const auto rigged = read_rigged(a, *import);
        return rigged ? Outcome<>(kSuccess) : Outcome<>(rigged.error());
    }
    if (a.modes.empty() && !a.ranges.empty())
        return Failure{kUsage, "--range", "says how far modes go, and there are none", "give --modes"};
    if (a.modes.empty()) return kSuccess;
    if (is_standard_input(a.mesh))
        return Failure{kUsage, "--modes", "need a mesh that can be read twice", "give the name of a file"};
    const auto modes = read_modes(a.modes, a.ranges, {1, 1, 1});
    return modes ? Outcome<>(kSuccess) : Outcome<>(modes.error());
}

// Gives the tree what its glTF file says of morph targets and bones.
Outcome<> rig(const Asset& a, const RiggedMesh& rigged, Baked& baked) {
    if (!rigged.modes.empty()) {
        auto morphing = add_modes(baked.tree.view(), rigged.mesh.view(), rigged.morphs());
        if (!morphing) return failure_of(a.mesh, morphing.error());
        baked.tree = std::move(*morphing);
    }
    if (!rigged.bones.empty()) {
        auto skinned = add_skin(baked.tree.view(), rigged.mesh.view(), rigged.skin());
        if (!skinned) return failure_of(a.mesh, skinned.error());
        baked.tree = std::move(*skinned);
    }
    return kSuccess;
}

// Gives the tree its modes, if there are any. The cache holds trees without: it knows no modes.
Outcome<> deform(const Asset& a, Baked& baked) {
    if (a.modes.empty() && !a.skin) return kSuccess;
    const auto import = import_options(a.mesh_options);
    if (!import) return import.error();
    if (a.skin) {
        const auto rigged = read_rigged(a, *import);
        return rigged ? rig(a, *rigged, baked) : Outcome<>(rigged.error());
    }
    const auto mesh = read_mesh(a.mesh, *import);
    if (!mesh) return mesh.error();
    const auto modes = read_modes(a.modes, a.ranges, mesh->placement.scale);
    if (!modes) return modes.error();
    auto deforming = add_modes(baked.tree.view(), mesh->view(), modes->view());
    if (!deforming) return failure_of(a.modes, deforming.error());
    baked.tree = std::move(*deforming);
    return kSuccess;
}

} // namespace

void declare_asset_options(CLI::App& app, Asset& a) {
    app.add_option("mesh", a.mesh, "the mesh: OBJ, PLY, STL, OFF, glTF, GLB, 3MF, 3DS or DAE; - for standard input");
    app.add_option("-o,--output", a.output, "the .etree file to write, or - for standard output");
    declare_mesh_options(app, a.mesh_options);
    app.add_option("--weld", a.mesh_options.weld,
                   "join vertices of open edges within this length, if that closes the mesh (default: 8 float steps)");
    app.add_option("--degree", a.options.degree, "children of a node, 2 ... 64")->capture_default_str();
    app.add_option("--levels", a.levels, "levels below the root, 1 ... 31");
    app.add_option("--ellipsoids", a.ellipsoids,
                   "number of leaves, 1 ... 65536: the best set of that many; with a closeness: at most that many");
    app.add_option("--tolerance", a.tolerance, "outside volume of the leaves / volume of the solid, above 0");
    app.add_option("--distance", a.distance,
                   "largest distance of the leaves from the solid, % of the diagonal, above 0");
    app.add_option("--clearance", a.clearance,
                   "largest distance of the leaves from the solid, as a length: 5mm, 0.2in (mm, cm, m, in, ft)");
    app.add_option("--keep-holes", a.keep_holes,
                   "a ball of this radius passes the leaves wherever a somewhat larger one passes the mesh: 8mm");
    app.add_option("--fill", a.fill, "what a ball of this radius cannot reach from outside counts as solid: 20mm");
    app.add_option(
        "--inner", a.options.inner,
        "also an inner cover: at most so many ellipsoids, 1 ... 65536, inside the solid; the mesh must be closed");
    app.add_option("--modes", a.modes,
                   "how the mesh deforms, .npz or .npy of shape (modes, vertices, 3): the nodes hold it as it moves");
    app.add_flag("--skin", a.skin,
                 "of glTF and GLB: bones and morph targets move the body, and the nodes hold it as they do");
    app.add_option("--range", a.ranges,
                   "largest coordinate of all modes, or of each; in the place of the file's \"ranges\"")
        ->delimiter(',')
        ->expected(1, 64);
    app.add_option("--method", a.method, "how outside volumes are found: voxel or analytic")->capture_default_str();
    app.add_option("--primitive", a.primitive, "what the nodes are: ellipsoid or sphere")->capture_default_str();
    app.add_option("--alpha", a.options.alpha, "weight of the surface error")->capture_default_str();
    app.add_option("--beta", a.options.beta, "weight of the outside volume")->capture_default_str();
    app.add_option("--quality", a.quality, "fast, normal or best")->capture_default_str();
    app.add_flag("--exact", a.options.exact, "store the triangles in the leaves: queries answer for them");
    app.add_option("--leaf-triangles", a.options.leaf_triangles, "most triangles in a leaf, 1 ... 127; with --exact")
        ->capture_default_str();
    app.add_option("-j,--threads", a.options.threads, "0 = all cores; the result does not depend on it")
        ->capture_default_str();
    app.add_option("--seed", a.options.seed, "of the random numbers")->capture_default_str();
    app.add_option("--report", a.report, "also write all figures to this JSON file");
}

const char* name_of(Source source) {
    switch (source) {
    case Source::baked:
        return "baked";
    case Source::unchanged:
        return "unchanged";
    case Source::cached:
        return "cached";
    }
    return "";
}

Outcome<BuildOptions> options_of(const Asset& a) {
    BuildOptions options = a.options;
    const auto refuse = [](const char* option, const char* what, const char* advice) {
        return Failure{kUsage, option, what, advice};
    };
    if (a.method == "analytic")
        options.method = Method::analytic;
    else if (a.method != "voxel")
        return refuse("--method", "no such method", "use voxel or analytic");
    if (a.primitive == "sphere")
        options.primitive = Primitive::sphere;
    else if (a.primitive != "ellipsoid")
        return refuse("--primitive", "no such primitive", "use ellipsoid or sphere");
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
    if (a.distance == 0.0f) return refuse("--distance", "must be above 0", "see 'prolate bake --help'");
    if (a.mesh_options.weld && !(*a.mesh_options.weld >= 0))
        return refuse("--weld", "must be a length, or 0", "see 'prolate bake --help'");
    options.weld = a.mesh_options.weld.value_or(kDefaultWeld);
    options.levels = a.levels.value_or(0);
    options.ellipsoids = a.ellipsoids.value_or(0);
    options.tolerance = a.tolerance.value_or(0);
    options.distance = a.distance.value_or(0);
    const std::tuple<const char*, const std::string&, float&> lengths[] = {
        {"--clearance", a.clearance, options.clearance},
        {"--keep-holes", a.keep_holes, options.keep_holes},
        {"--fill", a.fill, options.fill}};
    for (const auto& [option, text, metres] : lengths) {
        if (text.empty()) continue;
        const auto length = read_length(option, text);
        if (!length) return length.error();
        metres = static_cast<float>(length->metres);
    }
    if (const auto valid = validate(options); !valid) return failure_of("bake", valid.error());
    return options;
}

void name_inputs(const Asset& a, Outputs& outputs, const std::string& whose) {
    outputs.reads_mesh(a.mesh, "the mesh" + whose);
    outputs.reads(a.modes, "the modes" + whose);
}

Outcome<> claim_outputs(const Asset& a, Outputs& outputs, const std::string& whose) {
    const auto claimed = outputs.claim(a.output, "the output" + whose, "etree");
    return claimed ? outputs.claim(a.report, "the report" + whose, "json") : claimed;
}

Outcome<Baked> bake_asset(const Asset& a, const Outputs& outputs, BakeCache& cache, bool rebake,
                          const std::string& label) {
    using Clock = std::chrono::steady_clock;
    const auto start = Clock::now();
    if (const auto possible = check_modes(a); !possible) return possible.error();
    auto baked = make(a, cache, rebake, label);
    if (!baked) return baked;
    if (const auto close = check_closeness(a, *baked); !close) return close.error();
    cache.keep(baked->tree.view(), baked->source == Source::baked);
    if (const auto moving = deform(a, *baked); !moving) return moving.error();
    if (!baked->tree.view().bake_info().goal_reached)
        note(a.mesh, "the number asked for was not reached at this resolution; try --quality best");
    if (baked->source == Source::unchanged) {
        // For make and its like, which go by dates. Whose file it is not may not do so, and loses nothing but that.
        ::utimensat(AT_FDCWD, a.output.c_str(), nullptr, 0);
    } else {
        const auto written =
            outputs.write(a.output, baked->tree.bytes(), cache ? Outputs::Effort::small : Outputs::Effort::long_);
        if (!written && cache)
            return advised(written.error(), "the cache has the tree, and the next run takes it from there");
        if (!written) return written.error();
    }
    baked->seconds = std::chrono::duration<double>(Clock::now() - start).count();
    if (const auto written = outputs.write(a.report, text_of(report_of(a, *baked))); !written) return written.error();
    return baked;
}

nlohmann::ordered_json report_of(const Asset& a, const Baked& baked) {
    const TreeView tree = baked.tree.view();
    nlohmann::ordered_json out{{"mesh", a.mesh}, {"tree", a.output}, {"source", name_of(baked.source)}};
    out.update(header_json(tree));
    out["seconds"] = baked.seconds;
    if (baked.diagnosis) {
        const MeshReport& m = *baked.diagnosis;
        out["diagnosis"] = {{"input_vertices", m.input_vertices},
                            {"input_triangles", m.input_triangles},
                            {"merged_vertices", m.merged_vertices},
                            {"unused_vertices", m.unused_vertices},
                            {"welded_vertices", m.welded_vertices},
                            {"weld_distance", m.weld_distance},
                            {"turned_shells", m.turned_shells},
                            {"size", m.size},
                            {"degenerate_triangles", m.degenerate_triangles},
                            {"open_edges", m.open_edges},
                            {"non_manifold_edges", m.non_manifold_edges},
                            {"closed", m.closed}};
    } else {
        out["diagnosis"] = nullptr;
    }
    out["levels"] = nlohmann::ordered_json::array();
    for (uint32_t l = 0; l < tree.level_count(); ++l) {
        nlohmann::ordered_json level{{"nodes", cut_size(tree, l)}, {"bytes", tree.level(l).end_byte}};
        level.update(level_json(tree, l));
        level["seconds"] = nullptr;
        if (l < baked.level_seconds.size()) level["seconds"] = baked.level_seconds[l];
        out["levels"].push_back(std::move(level));
    }
    return out;
}

} // namespace prolate::cli
