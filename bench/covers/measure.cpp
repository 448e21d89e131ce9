#include "bench/covers/measure.hpp"

#include "cli/compare/query_time.hpp"

#include <Eigen/Geometry>
#include <fmt/format.h>

#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <string_view>

namespace prolate::bench {
namespace {

constexpr double kHullSpacing = 0.005; // of samples on hulls, parts of the diagonal

double seconds(const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
}

class Stopwatch {
public:
    double wall() const { return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count(); }
    Cost cost() const {
        rusage use{};
        getrusage(RUSAGE_SELF, &use);
        return {wall(), seconds(use.ru_utime) + seconds(use.ru_stime) - cpu_,
                static_cast<double>(use.ru_maxrss) / 1024}; // Linux counts it in KiB
    }

private:
    std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
    double cpu_ = [] {
        rusage use{};
        getrusage(RUSAGE_SELF, &use);
        return seconds(use.ru_utime) + seconds(use.ru_stime);
    }();
};

// `lattice`, with as many more rows and columns on each side as it takes to hold `mesh`: those that it has stay.
ColumnLattice grown_around(ColumnLattice lattice, MeshView mesh, int& added) {
    double beyond = 0; // pitches
    for (const Vec3& v : mesh.vertices) {
        const Vec p = lattice.to_frame(to_vec(v));
        const double i = (p.x() - lattice.x0) / lattice.dx, j = (p.y() - lattice.y0) / lattice.dy;
        beyond = std::max({beyond, -i, -j, i - lattice.nx + 1, j - lattice.ny + 1});
    }
    added = static_cast<int>(std::ceil(beyond));
    lattice.x0 -= added * lattice.dx, lattice.y0 -= added * lattice.dy;
    lattice.nx += 2 * added, lattice.ny += 2 * added;
    return lattice;
}

// Sum of the volumes that closed surfaces enclose.
double enclosed_volume(MeshView mesh) {
    double six = 0;
    for (const Triangle& t : mesh.triangles)
        six += to_vec(mesh.vertices[t[0]]).dot(to_vec(mesh.vertices[t[1]]).cross(to_vec(mesh.vertices[t[2]])));
    return six / 6;
}

Baked bake(const std::string& path, const BuildOptions& options, int columns_across, bool all_levels) {
    Baked out;
    const auto fail = [&out](std::string_view what) {
        out.error[std::min(what.copy(out.error.data(), out.error.size() - 1), out.error.size() - 1)] = '\0';
        return out;
    };
    auto model = load_model(path);
    if (!model) return fail("the mesh cannot be read");
    out.triangles = static_cast<uint32_t>(model->mesh.triangles.size());
    out.closed = model->closed;

    const Stopwatch watch;
    double last = 0;
    double* stage = &out.voxelise;
    const auto progress = [&](const BuildProgress& now) {
        const std::string_view name = now.stage;
        const double t = watch.wall();
        *stage += t - last, last = t;
        stage = name == "voxelise"  ? &out.voxelise
                : name == "measure" ? &out.measure
                : name == "prove"   ? &out.prove
                                    : &out.fit;
        return true;
    };
    const auto built = build(model->mesh.view(), options, progress);
    *stage += watch.wall() - last;
    out.cost = watch.cost();
    if (!built) {
        out.unsupported = built.error().code == ErrorCode::unsupported;
        return fail(built.error().what);
    }
    const TreeView tree = built->tree.view();
    out.nodes = tree.node_count(), out.level_count = tree.level_count();
    tree.for_each_node([&](uint32_t n) { out.leaves += tree.is_leaf(n); });
    out.bytes = tree.bytes().size();
    out.outside_ratio = built->levels.back().outside_ratio;
    out.resolution = built->resolution, out.goal_reached = built->goal_reached;
    out.proved = std::ranges::all_of(built->levels, [](const LevelReport& level) { return level.covered; });
    if (columns_across == 0) return out;
    const Judge judge(*model, columns_across);
    for (uint32_t l = all_levels ? 0 : out.level_count - 1; l < out.level_count; ++l) {
        std::vector<Ellipsoid> cut;
        tree.for_each_in_cut(l, [&](uint32_t node) { cut.push_back(tree.ellipsoid(node)); });
        Figures& figures = out.levels[l] = judge.ellipsoids(cut);
        const size_t each = options.primitive == Primitive::sphere ? kSphereBytes : kEllipsoidBytes;
        figures.list_bytes = static_cast<double>(each * cut.size());
        if (!all_levels) figures.nanoseconds = cli::nanoseconds_a_query(tree);
        const LevelReport& own = built->levels[l]; // no lattice takes part in these
        figures.hausdorff_max = 100 * own.hausdorff_max / built->diagonal;
        figures.hausdorff_mean = 100 * own.hausdorff_mean / built->diagonal;
        figures.hausdorff_p99 = 100 * own.hausdorff_p99 / built->diagonal;
    }
    return out;
}

} // namespace

std::optional<Model> load_model(const std::string& path) {
    ImportReport report;
    const auto mesh = load_mesh(path.c_str(), {}, &report);
    if (!mesh) {
        fmt::print(stderr, "{}: {} {}\n", path, mesh.error().what, report.detail);
        return std::nullopt;
    }
    auto cleaned = clean(mesh->view());
    if (!cleaned) {
        fmt::print(stderr, "{}: {}\n", path, cleaned.error().what);
        return std::nullopt;
    }
    return Model{std::filesystem::path(path).stem().string(), std::move(cleaned->mesh), cleaned->report.closed};
}

Judge::Judge(const Model& model, int columns_across)
    : winding_(model.mesh.view()),
      solid_(measuring_columns(model.mesh.view(), model.closed, &winding_, columns_across)),
      volume_(solid_.volume().value), closed_(model.closed) {
    Eigen::AlignedBox3d box;
    for (const Vec3& v : model.mesh.vertices) box.extend(to_vec(v));
    diagonal_ = box.diagonal().norm();
}

Figures Judge::ellipsoids(std::span<const Ellipsoid> cover) const {
    const CoverVolume volume = measure_cover(solid_, cover);
    Figures out;
    out.count = static_cast<uint32_t>(cover.size());
    if (!(volume_ > 0)) return out;
    out.outside_ratio = volume.outside.value / volume_;
    out.outside_error = (volume.outside.error + out.outside_ratio * volume.solid.error) / volume_;
    out.uncovered = std::max(0.0, 1 - (volume.whole.value - volume.outside.value) / volume_);
    double sum = 0;
    for (const Ellipsoid& e : cover) sum += prolate::volume(e);
    out.sum_of_volumes = sum / volume_;
    return out;
}

// The largest distance from evenly spread points of `surface` to the solid. A hull's farthest point is on its surface
// unless it fills a cavity.
double Judge::farthest(MeshView surface) const {
    double far = 0;
    const double spacing = kHullSpacing * diagonal_;
    for (const Triangle& t : surface.triangles) {
        const Vec a = to_vec(surface.vertices[t[0]]), b = to_vec(surface.vertices[t[1]]),
                  c = to_vec(surface.vertices[t[2]]);
        const double longest = std::max({(b - a).norm(), (c - b).norm(), (a - c).norm()});
        const int n = std::max(1, static_cast<int>(std::ceil(longest / spacing)));
        for (int i = 0; i <= n; ++i)
            for (int j = 0; j <= n - i; ++j) {
                const Vec p = a + (b - a) * i / n + (c - a) * j / n;
                const double distance = winding_.tree().distance(p);
                if (distance > far && !(closed_ && std::abs(winding_(p)) > 0.5)) far = distance;
            }
    }
    return far;
}

Figures Judge::hulls(MeshView hulls, uint32_t count) const {
    int added = 0;
    const Columns cover(hulls, true, nullptr, grown_around(solid_.lattice(), hulls, added));
    double common = 0;
    for (int i = 0; i < solid_.lattice().nx; ++i)
        for (int j = 0; j < solid_.lattice().ny; ++j)
            for (const Interval& s : solid_.column(i, j))
                for (const Interval& t : cover.column(i + added, j + added))
                    common += std::max(0.0, std::min(s.high, t.high) - std::max(s.low, t.low));
    common *= solid_.lattice().dx * solid_.lattice().dy;
    Figures out;
    out.count = count;
    out.hausdorff_max = 100 * farthest(hulls) / diagonal_;
    if (!(volume_ > 0)) return out;
    out.outside_ratio = (cover.volume().value - common) / volume_;
    out.uncovered = 1 - common / volume_;
    out.sum_of_volumes = enclosed_volume(hulls) / volume_;
    out.list_bytes = static_cast<double>(kCornerBytes * hulls.vertices.size());
    if (const auto exact = build(hulls, {.exact = true, .threads = 1}))
        out.nanoseconds = cli::nanoseconds_a_query(exact->tree.view());
    return out;
}

Baked bake_apart(const std::string& path, const BuildOptions& options, int columns_across, bool all_levels) {
    const auto baked = in_child([&] { return bake(path, options, columns_across, all_levels); });
    if (baked) return *baked;
    Baked lost;
    std::string_view("the process died, perhaps for want of memory").copy(lost.error.data(), lost.error.size() - 1);
    return lost;
}

} // namespace prolate::bench
