// How the error of a cover falls with its size: outside ratio and one-sided Hausdorff distance against the number of
// primitives and against their bytes, ellipsoids beside spheres of the same framework and beside convex hulls.
//
//   bench_curves horse.obj bunny.obj --peers build/peers/bin/python --out out/curves
//
// Known models have published outside ratios of V-HACD's hulls and of AMAA's spheres beside them. What a package of
// V-HACD gives with its defaults is plotted only if asked for (--peers): it may be far from the published. Figures of
// trees are those in their files, measured when they were baked. Hulls are judged on columns of the same solid, and
// their distance is sampled: it may be too small, by no more than the samples' spacing.
#include "bench/covers/covers.hpp"
#include "bench/covers/decompositions.hpp"
#include "bench/covers/plot.hpp"
#include "bench/covers/published.hpp"

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <fmt/os.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

namespace prolate::bench {
namespace {

constexpr const char* kPublishedHulls = "V-HACD hulls (published)";

struct Arguments {
    std::vector<std::string> meshes, peer_names{"V-HACD"};
    std::vector<uint32_t> counts{8, 16, 32, 64, 128, 256, 512}, peer_counts{8, 32, 128};
    std::string quality = "normal", kept = "build/covers", out = "out/curves", peers;
    uint32_t peer_seconds = 600;
    int columns = 800;
};

struct Row {
    std::string model, made_of;
    uint32_t asked = 0, count = 0;
    size_t bytes = 0, file_bytes = 0; // file_bytes: of the tree with them; 0 for what has none
    double outside_ratio = kUnknown, hausdorff = kUnknown, uncovered = 0;
};

void print(const Row& r) {
    const auto known = [](double x, int digits) { return std::isnan(x) ? "-" : fmt::format("{:.{}f}", x, digits); };
    fmt::print("{:<10}{:<25}{:>6}{:>9}{:>10}{:>10}{:>9}{:>10}\n", r.model, r.made_of, r.count,
               r.bytes ? fmt::format("{}", r.bytes) : "-", r.file_bytes ? fmt::format("{}", r.file_bytes) : "-",
               known(r.outside_ratio, 4), known(r.hausdorff, 2), known(r.uncovered, 4));
    std::fflush(stdout);
}

std::string csv_of(const std::vector<Row>& rows, const std::string& quality) {
    std::string out = "model,made_of,quality,asked,count,bytes,file_bytes,outside_ratio,hausdorff_percent,uncovered\n";
    const auto known = [](double x) { return std::isnan(x) ? "" : fmt::format("{:.6f}", x); };
    const auto bytes = [](size_t n) { return n ? fmt::format("{}", n) : ""; };
    for (const Row& r : rows)
        out += fmt::format("{},{},{},{},{},{},{},{},{},{}\n", r.model, r.made_of, r.file_bytes ? quality : "", r.asked,
                           r.count, bytes(r.bytes), bytes(r.file_bytes), known(r.outside_ratio), known(r.hausdorff),
                           known(r.uncovered));
    return out;
}

void add_trees(const Model& model, const Arguments& a, std::vector<Row>& rows) {
    for (const Primitive primitive : {Primitive::ellipsoid, Primitive::sphere})
        for (const uint32_t count : a.counts) {
            BuildOptions options;
            options.ellipsoids = count, options.primitive = primitive, options.quality = kQualities.at(a.quality);
            const auto tree = cover_of(model, options, a.kept);
            if (!tree) continue;
            const TreeView view = tree->view();
            const LevelInfo level = view.level(view.level_count() - 1);
            const bool sphere = primitive == Primitive::sphere;
            Row row{model.name, sphere ? "spheres" : "ellipsoids", count, 0, 0, view.bytes().size()};
            row.count = static_cast<uint32_t>(leaves_of(view).size());
            row.bytes = row.count * (sphere ? kSphereBytes : kEllipsoidBytes);
            row.outside_ratio = level.outside_ratio;
            row.hausdorff = 100 * level.hausdorff_max / view.bake_info().diagonal;
            print(rows.emplace_back(row));
        }
}

// Volumes alone were published.
void add_published(const Model& model, std::vector<Row>& rows) {
    for (const bool hulls : {false, true})
        for (const Published& p : all_published()) {
            const double ratio = hulls ? p.vhacd : p.amaa;
            if (p.model != model.name || p.triangles != model.mesh.triangles.size() || std::isnan(ratio)) continue;
            Row row{model.name, hulls ? kPublishedHulls : "AMAA spheres (published)", p.count, p.count};
            if (!hulls) row.bytes = p.count * kSphereBytes;
            row.outside_ratio = ratio, row.uncovered = kUnknown;
            print(rows.emplace_back(row));
        }
}

void add_peers(const Model& model, const Arguments& a, std::vector<Row>& rows) {
    std::string why;
    const Decomposers decomposers(a.peers);
    const std::vector<std::string> names = decomposers.names(why);
    if (names.empty()) {
        fmt::print("peers: skipped, {}\n", why);
        return;
    }
    std::optional<Judge> judge;
    for (const std::string& name : names) {
        if (std::ranges::find(a.peer_names, name) == a.peer_names.end()) continue;
        for (const uint32_t count : a.peer_counts) {
            const auto made = decomposers.run(name, model.mesh.view(), count, a.peer_seconds);
            if (!made) {
                fmt::print("{} {}: gave nothing within {} s\n", name, count, a.peer_seconds);
                continue;
            }
            if (!judge) judge.emplace(model, a.columns);
            const Figures f = judge->hulls(made->hulls.view(), made->count);
            print(rows.emplace_back(Row{model.name, name + " hulls", count, f.count,
                                        kCornerBytes * made->hulls.vertices.size(), 0, f.outside_ratio, f.hausdorff_max,
                                        f.uncovered}));
        }
    }
}

// What a legend says of one kind: hulls that leave much of the solid out are no cover.
std::string label_of(const std::string& kind, const std::vector<Row>& rows) {
    if (kind == kPublishedHulls) return kind + ": no cover, they leave part of the solid out";
    double most = 0;
    for (const Row& r : rows)
        if (r.made_of == kind) most = std::max(most, r.uncovered);
    return most < 0.001 ? kind : fmt::format("{} (no cover: up to {:.0f} % of the solid left out)", kind, 100 * most);
}

std::string plot(const std::vector<Row>& rows, bool by_bytes) {
    std::vector<std::string> models, kinds;
    for (const Row& r : rows) {
        if (std::ranges::find(models, r.model) == models.end()) models.push_back(r.model);
        if (std::ranges::find(kinds, r.made_of) == kinds.end()) kinds.push_back(r.made_of);
    }
    std::vector<Panel> panels;
    for (const bool volume : {true, false})
        for (const std::string& model : models) {
            Panel panel{volume ? model : "", volume ? "outside ratio" : "Hausdorff distance, % of the diagonal", {}};
            for (const std::string& kind : kinds) {
                Series s{label_of(kind, rows), {}};
                for (const Row& r : rows) {
                    const double x = static_cast<double>(by_bytes ? r.bytes : r.count);
                    const double y = volume ? r.outside_ratio : r.hausdorff;
                    if (r.model == model && r.made_of == kind && x > 0 && y > 0) s.points.emplace_back(x, y);
                }
                if (!s.points.empty()) panel.series.push_back(std::move(s));
            }
            panels.push_back(std::move(panel));
        }
    return log_log_plot("Error of covers against their size (lower is better)",
                        by_bytes ? "bytes of the primitives, as floats" : "primitives", panels,
                        {.columns = models.size()});
}

int run(const Arguments& a) {
    std::filesystem::create_directories(a.out);
    std::vector<Row> rows;
    fmt::print("{:<10}{:<25}{:>6}{:>9}{:>10}{:>10}{:>9}{:>10}\n", "model", "", "n", "bytes", "file", "outside", "H max",
               "uncov.");
    for (const std::string& path : a.meshes) {
        const auto model = load_model(path);
        if (!model) return 1;
        add_trees(*model, a, rows);
        add_published(*model, rows);
        if (!a.peers.empty()) add_peers(*model, a, rows);
        // After each model: a long run that is interrupted has its files.
        fmt::output_file(a.out + "/curves.csv").print("{}", csv_of(rows, a.quality));
        fmt::output_file(a.out + "/curves.svg").print("{}", plot(rows, false));
        fmt::output_file(a.out + "/curves-bytes.svg").print("{}", plot(rows, true));
    }
    fmt::print("wrote {0}/curves.csv, {0}/curves.svg, {0}/curves-bytes.svg\n", a.out);
    return 0;
}

} // namespace
} // namespace prolate::bench

int main(int argc, char** argv) {
    using namespace prolate::bench;
    Arguments a;
    CLI::App app{"Error of covers against their size, plotted; docs/covers.md explains the columns"};
    app.add_option("meshes", a.meshes, "mesh files")->required()->check(CLI::ExistingFile);
    app.add_option("--counts", a.counts, "primitives of the covers")->delimiter(',')->capture_default_str();
    app.add_option("--quality", a.quality)->capture_default_str()->check(CLI::IsMember(kQualities));
    app.add_option("--kept", a.kept, "folder for baked trees, which later runs read")->capture_default_str();
    app.add_option("--out", a.out, "folder for the table and the plots")->capture_default_str();
    app.add_option("--peers", a.peers, "Python that has peers installed, as ./run peers makes it");
    app.add_option("--peer", a.peer_names, "which of them: V-HACD, CoACD, Rapier")
        ->delimiter(',')
        ->capture_default_str();
    app.add_option("--peer-counts", a.peer_counts, "hulls asked for")->delimiter(',')->capture_default_str();
    app.add_option("--peer-seconds", a.peer_seconds, "wall time after which a peer is stopped")->capture_default_str();
    app.add_option("--columns", a.columns, "columns across, to judge hulls with")
        ->capture_default_str()
        ->check(CLI::Range(16, 4096));
    CLI11_PARSE(app, argc, argv);
    return run(a);
}
