// Covers as proxies for shadows (paper, section 6 and figure 6): the figure, and what the paper does not give, numbers.
//
//   bench_shadows horse.obj bunny.obj --up z,y --out out/shadows
//
// The numbers are of six lamps around the model. Shadows are projected onto the ground (shadow.hpp): the intersection
// over union is that of the shadows from the lamp's center; the difference is between the soft shadows of the whole
// lamp, 5 x 5 points of it. POV-Ray draws the pictures alone.
#include "bench/covers/covers.hpp"
#include "bench/covers/plot.hpp"
#include "bench/shadows/pictures.hpp"
#include "bench/shadows/shadow.hpp"
#include "bench/shadows/stage.hpp"
#include "cli/grouped.hpp"

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <fmt/os.h>

#include <algorithm>
#include <filesystem>
#include <iterator>

namespace prolate::bench {
namespace {

constexpr int kLamps = 6, kLampPoints = 5, kAcross = 400; // pixels along the diameter of the model
constexpr uint32_t kEllipsoids = 32, kSpheres = 64;       // of the figure

struct Arguments {
    std::vector<std::string> meshes, up;
    std::vector<double> azimuth;
    std::vector<uint32_t> counts{8, 16, 32, 64, 128, 256, 512};
    std::string quality = "normal", kept = "build/covers", out = "out/shadows", povray;
};

// A cover that takes part.
struct Entry {
    std::string made_of; // "ellipsoids", "spheres", "ellipsoids, analytic"
    uint32_t count = 0;
    Tree tree;
    std::vector<Ellipsoid> leaves;
    double iou = 0, least_iou = 1, difference = 0; // means over the lamps, and the worst lamp's
};

struct Competition {
    Model model;
    std::vector<Entry> entries;

    const Entry* find(const std::string& made_of, uint32_t count) const {
        for (const Entry& e : entries)
            if (e.made_of == made_of && e.count == count) return &e;
        return nullptr;
    }
};

void add_covers(Competition& c, const Arguments& a) {
    const auto add = [&](const std::string& made_of, uint32_t count, Primitive primitive, Method method) {
        BuildOptions options;
        options.ellipsoids = count, options.primitive = primitive, options.method = method;
        options.quality = kQualities.at(a.quality);
        if (auto tree = cover_of(c.model, options, a.kept)) {
            auto leaves = leaves_of(tree->view());
            c.entries.push_back({made_of, count, std::move(*tree), std::move(leaves)});
        }
    };
    for (const uint32_t count : a.counts) add("ellipsoids", count, Primitive::ellipsoid, Method::voxel);
    for (const uint32_t count : a.counts) add("spheres", count, Primitive::sphere, Method::voxel);
    if (c.model.closed)
        add("ellipsoids, analytic", kEllipsoids, Primitive::ellipsoid, Method::analytic);
    else
        fmt::print("{}: the mesh is open, and the analytic method needs a closed one: left out\n", c.model.name);
}

// What the shadow reaches from any point of the lamp.
template <class Caster> Extent reach_of(const Caster& caster, const Lamp& lamp, const Ground& ground) {
    Extent out;
    for (const int i : {0, kLampPoints - 1})
        for (const int j : {0, kLampPoints - 1}) out.add(shadow_extent(caster, lamp.point(i, j, kLampPoints), ground));
    return out;
}

void measure(Competition& c, const Stage& stage) {
    const MeshView mesh = c.model.mesh.view();
    const Ground ground = stage.ground(2 * stage.radius() / kAcross);
    for (int k = 0; k < kLamps; ++k) {
        const Lamp lamp = stage.lamp(360.0 * k / kLamps);
        Extent extent = reach_of(mesh, lamp, ground);
        for (const Entry& e : c.entries) extent.add(reach_of(e.leaves, lamp, ground));
        const Ground window = Stage::window(ground, extent, 1);
        const Shadow truth = shadow_of(mesh, lamp, window, kLampPoints);
        for (Entry& e : c.entries) {
            const Likeness l =
                likeness(shadow_of(std::span<const Ellipsoid>(e.leaves), lamp, window, kLampPoints), truth);
            e.iou += l.iou / kLamps, e.difference += l.difference / kLamps, e.least_iou = std::min(e.least_iou, l.iou);
        }
    }
}

ExhibitRow exhibit(const Competition& c, const Stage& stage) {
    ExhibitRow row{stage, {}, {}};
    const MeshView mesh = c.model.mesh.view();
    const Ground ground = stage.ground(stage.radius());
    const Lamp lamp = stage.lamp(0);
    row.shown = reach_of(mesh, lamp, ground);
    row.exhibits.push_back(
        {pov_mesh(mesh), fmt::format("{}: mesh, {} triangles", c.model.name, cli::grouped(mesh.triangles.size()))});
    for (const auto& [made_of, count] :
         {std::pair{"ellipsoids, analytic", kEllipsoids}, {"ellipsoids", kEllipsoids}, {"spheres", kSpheres}}) {
        const Entry* const e = c.find(made_of, count);
        if (!e) {
            row.exhibits.push_back({"#declare Cover = union { }\n", fmt::format("{} {}: none", count, made_of)});
            continue;
        }
        row.shown.add(reach_of(e->leaves, lamp, ground));
        const std::string method = std::string(made_of) == "ellipsoids" ? ", voxel" : "";
        const auto pieces = cli::pieces_of(e->tree.view(), e->tree.view().level_count() - 1);
        row.exhibits.push_back(
            {cli::as_pov(pieces, cli::View{}), fmt::format("n = {} {}{}, IoU {:.3f}", count, made_of, method, e->iou)});
    }
    return row;
}

std::string rows_of(const Competition& c, const std::string& quality) {
    std::string out;
    for (const Entry& e : c.entries) {
        const bool analytic = e.made_of == "ellipsoids, analytic";
        out += fmt::format("{},{},{},{},{},{},{:.5f},{:.5f},{:.5f}\n", c.model.name,
                           e.made_of == "spheres" ? "sphere" : "ellipsoid", analytic ? "analytic" : "voxel", quality,
                           e.count, e.leaves.size(), e.iou, e.least_iou, e.difference);
    }
    return out;
}

void print_table(const Competition& c) {
    fmt::print("\n{}: {} triangles\n{:<24}{:>6}{:>9}{:>9}{:>13}\n", c.model.name, c.model.mesh.triangles.size(), "",
               "n", "IoU", "worst", "difference");
    for (const Entry& e : c.entries)
        fmt::print("{:<24}{:>6}{:>9.4f}{:>9.4f}{:>13.4f}\n", e.made_of, e.leaves.size(), e.iou, e.least_iou,
                   e.difference);
}

// The paper's claim, by eye there. Returns whether it holds.
bool print_claim(const Competition& c) {
    const Entry *few = c.find("ellipsoids", kEllipsoids), *many = c.find("spheres", kSpheres);
    if (!few || !many) return true;
    const bool holds = few->iou > many->iou;
    fmt::print("{} ellipsoids, IoU {:.4f}, have {} shadow than {} spheres, {:.4f}\n", kEllipsoids, few->iou,
               holds ? "a better" : "NO better", kSpheres, many->iou);
    return holds;
}

std::string plot(const std::vector<Competition>& all) {
    std::vector<Panel> panels;
    for (const bool iou : {true, false})
        for (const Competition& c : all) {
            Panel panel{
                iou ? c.model.name : "", iou ? "1 - intersection over union" : "mean difference of darkness", {}};
            for (const char* made_of : {"ellipsoids", "spheres", "ellipsoids, analytic"}) {
                Series s{made_of, {}};
                for (const Entry& e : c.entries)
                    if (e.made_of == made_of)
                        s.points.emplace_back(static_cast<double>(e.leaves.size()), iou ? 1 - e.iou : e.difference);
                panel.series.push_back(std::move(s));
            }
            panels.push_back(std::move(panel));
        }
    return log_log_plot("Shadows of covers against the mesh's (lower is better)", "primitives", panels,
                        {.columns = all.size()});
}

// How the pictures show the i-th mesh.
cli::View view_of(const Arguments& a, size_t i) {
    const std::string name = i < a.up.size() ? a.up[i] : "y";
    const auto axis = std::find(std::begin(cli::kUpAxes), std::end(cli::kUpAxes), name) - std::begin(cli::kUpAxes);
    return {i < a.azimuth.size() ? a.azimuth[i] : 30, 25, static_cast<cli::UpAxis>(axis)};
}

int run(const Arguments& a) {
    std::filesystem::create_directories(a.out);
    std::vector<Competition> all;
    std::vector<ExhibitRow> rows;
    std::string csv = "model,primitive,method,quality,asked,count,iou,worst_iou,difference\n";
    bool holds = true;
    for (size_t i = 0; i < a.meshes.size(); ++i) {
        auto model = load_model(a.meshes[i]);
        if (!model) return 1;
        Competition& c = all.emplace_back(Competition{std::move(*model), {}});
        const Stage stage(c.model.mesh.view(), view_of(a, i));
        add_covers(c, a);
        measure(c, stage);
        print_table(c);
        holds &= print_claim(c);
        std::fflush(stdout);
        csv += rows_of(c, a.quality);
        rows.push_back(exhibit(c, stage));
    }
    fmt::output_file(a.out + "/shadows.csv").print("{}", csv);
    fmt::output_file(a.out + "/shadows.svg").print("{}", plot(all));
    fmt::print("\nwrote {0}/shadows.csv, {0}/shadows.svg\n", a.out);
    if (a.povray.empty()) return holds ? 0 : 1;
    const std::string sheet = a.out + "/shadows.png";
    if (!write_shadow_sheet(rows, a.povray, a.kept, sheet)) return 1;
    fmt::print("wrote {}\n", sheet);
    return holds ? 0 : 1;
}

} // namespace
} // namespace prolate::bench

int main(int argc, char** argv) {
    using namespace prolate;
    using namespace prolate::bench;
    Arguments a;
    CLI::App app{"Shadows of covers against the mesh's, pictured and measured; docs/covers.md explains the columns"};
    app.add_option("meshes", a.meshes, "mesh files")->required()->check(CLI::ExistingFile);
    app.add_option("--up", a.up, "the axis of each mesh that points up (default: y)")
        ->delimiter(',')
        ->check(CLI::IsMember(std::vector<std::string>(std::begin(cli::kUpAxes), std::end(cli::kUpAxes))));
    app.add_option("--azimuth", a.azimuth, "where the pictures' viewer of each mesh stands, degrees (default: 30)")
        ->delimiter(',');
    app.add_option("--counts", a.counts, "primitives of the covers")->delimiter(',')->capture_default_str();
    app.add_option("--quality", a.quality)->capture_default_str()->check(CLI::IsMember(kQualities));
    app.add_option("--kept", a.kept, "folder for baked trees, which later runs read, and for single pictures")
        ->capture_default_str();
    app.add_option("--out", a.out, "folder for the table, the plot and the picture")->capture_default_str();
    app.add_option("--povray", a.povray, "draw the picture with this program");
    CLI11_PARSE(app, argc, argv);
    return run(a);
}
