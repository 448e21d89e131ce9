// The story of a bake: clean, voxelise, grow, quantise, measure, prove.
#include <prolate/build.hpp>
#include <prolate/verify.hpp>

#include "builder/cover.hpp"
#include "builder/grow.hpp"

#include "src/format.hpp"

#include <tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <limits>
#include <mutex>
#include <new>

namespace prolate {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) {
    return std::chrono::duration<double>(Clock::now() - start).count();
}

struct Effort {
    uint32_t resolution;        // cells along the longest side, at least
    int sweeps, trials, starts; // see SplitOptions
};

Effort effort_of(Quality quality) {
    switch (quality) {
    case Quality::fast:
        return {64, 4, 12, 1};
    case Quality::normal:
        return {96, 10, 32, 4};
    case Quality::best:
        return {128, 20, 80, 8};
    }
    return {96, 10, 32, 4};
}

constexpr uint32_t kMaxResolution = 320;
constexpr double kCellsPerLeaf = 40;     // fewer, and leaves follow the grid instead of the shape
constexpr uint32_t kSamplesPerCell = 2;  // surface samples, on average over all cells
constexpr int kMeasureColumns = 512;     // of the reported figures
constexpr double kSmallestRadius = 1e-5; // of the diagonal

// A solid of less than this share of its diagonal's cube has no inside worth the name.
constexpr double kNoInside = 1e-12;

// One build, start to end. Members are in the order in which they come to life.
class Bake {
public:
    Bake(const BuildOptions& options, const ProgressCallback& progress)
        : options_(options), effort_(effort_of(options.quality)), progress_(progress) {}

    Result<Build> run(MeshView input) {
        const auto start = Clock::now();
        auto cleaned = clean(input);
        if (!cleaned) return cleaned.error();
        mesh_ = cleaned->mesh.view();
        closed_ = cleaned->report.closed;
        if (!report("voxelise", 0, 0)) return stopped();

        const Winding winding(mesh_);
        const Voxels voxels = voxelise(winding);
        measure_solid(winding);
        if (options_.tolerance > 0 && solid_volume_ == 0)
            return Error{ErrorCode::bad_mesh,
                         "the mesh encloses no volume, so no outside ratio can be met; "
                         "give levels or a count instead of a tolerance",
                         0};
        if (!report("split", 0.05, 1)) return stopped();

        const Grown grown = grow_tree(voxels, winding);
        if (cancelled_) return stopped();

        std::vector<format::PackedLevel> levels;
        if (auto packed = pack(grown, voxels, levels); !packed) return packed.error();
        if (!report("measure", 0.8, static_cast<uint32_t>(grown.nodes.size()))) return stopped();
        const BakeInfo info = describe();
        // Measured on decoded nodes, so that the figures are the file's; they are then written into its levels table.
        std::vector<LevelReport> figures;
        {
            auto draft = Tree::open(format::encode(info, options_.degree, lattice_, levels));
            if (!draft) return draft.error();
            figures = measure(draft->view(), grown, winding, levels);
        }
        auto tree = Tree::open(format::encode(info, options_.degree, lattice_, levels));
        if (!tree) return tree.error();

        if (auto proved = prove(tree->view(), figures); !proved) return proved.error();
        Build build{std::move(*tree), cleaned->report, std::move(figures), solid_volume_,       box_.size().norm(),
                    resolution_,      !closed_,        grown.goal_reached, seconds_since(start)};
        return build;
    }

private:
    bool report(const char* stage, double fraction, uint32_t nodes) {
        if (!progress_) return true;
        const std::lock_guard lock(reporting_);
        fraction_ = std::max(fraction_, fraction);
        if (!progress_({stage, fraction_, nodes})) cancelled_ = true;
        return !cancelled_;
    }
    static Error stopped() { return {ErrorCode::cancelled, "cancelled", 0}; }

    // Leaves to expect, for the choice of the resolution.
    double expected_leaves() const {
        if (options_.ellipsoids) return options_.ellipsoids;
        if (options_.tolerance > 0) return 1000;
        return std::min(std::pow(double(options_.degree), options_.levels ? options_.levels : 3u), 65536.0);
    }

    void measure_solid(const Winding& winding) {
        const Vec step = box_.size() / kMeasureColumns;
        const Columns columns(mesh_, closed_, winding,
                              {box_.low.x() + 0.41421356 * step.x(), box_.low.y() + 0.73205081 * step.y(), step.x(),
                               step.y(), kMeasureColumns, kMeasureColumns});
        const double volume = columns.volume();
        solid_volume_ = volume > kNoInside * std::pow(box_.size().norm(), 3) ? volume : 0;
    }

    Voxels voxelise(const Winding& winding) {
        for (const Vec3& v : mesh_.vertices) box_.add(to_vec(v));
        resolution_ = effort_.resolution;
        for (;;) {
            Voxels voxels(mesh_, closed_, winding, resolution_);
            const double wanted = kCellsPerLeaf * expected_leaves();
            const double cells = voxels.cell_count();
            if (cells >= wanted || resolution_ == kMaxResolution) {
                const auto samples = static_cast<uint32_t>(std::min(cells * kSamplesPerCell, 4e6));
                voxels.sample_surface(mesh_, samples, options_.seed);
                return voxels;
            }
            // Cells grow with the square (surface) to the cube (volume) of the resolution.
            const double grow = std::clamp(std::sqrt(wanted / cells), 1.05, 2.0);
            resolution_ = std::min(kMaxResolution, static_cast<uint32_t>(std::ceil(resolution_ * grow)));
        }
    }

    Grown grow_tree(const Voxels& voxels, const Winding& winding) {
        GrowOptions options;
        options.build = options_;
        options.split = {{options_.alpha, options_.beta},
                         kSmallestRadius * box_.size().norm(),
                         effort_.sweeps,
                         effort_.trials,
                         effort_.starts,
                         options_.seed,
                         &cancelled_};
        options.outside_ratio = [&](const std::vector<Fit>& fits) {
            std::vector<Ellipsoid> ellipsoids;
            for (const Fit& fit : fits) {
                const auto l = fit.factor.cast<float>();
                const Eigen::Vector3f c = fit.center.cast<float>();
                ellipsoids.push_back({{c.x(), c.y(), c.z()}, l(0, 0), l(1, 0), l(1, 1), l(2, 0), l(2, 1), l(2, 2)});
            }
            return measure_cover(mesh_, closed_, winding, ellipsoids, kMeasureColumns / 2).outside / solid_volume_;
        };
        options.progress = [&](double done, uint32_t nodes) { return report("split", 0.05 + 0.75 * done, nodes); };
        return grow(voxels, options);
    }

    // Quantised nodes, breadth-first, each enlarged until its decoded ellipsoid covers.
    Result<void> pack(const Grown& grown, const Voxels& voxels, std::vector<format::PackedLevel>& levels) {
        Box centers;
        for (const GrownNode& node : grown.nodes) centers.add(node.cluster.fit.center);
        lattice_ = format::lattice_for(centers.low.data(), centers.high.data());
        std::vector<uint32_t> current{0};
        while (!current.empty()) {
            std::vector<uint32_t> next;
            format::PackedLevel& level = levels.emplace_back();
            for (const uint32_t index : current) {
                const GrownNode& node = grown.nodes[index];
                auto packed = covering_node(node.cluster.fit, voxels, node.cluster.cells, lattice_);
                if (!packed)
                    return Error{ErrorCode::bad_mesh,
                                 "the mesh is too large or too small for the file format; "
                                 "scale it to metres",
                                 index};
                packed->child_count = static_cast<uint8_t>(node.child_count);
                level.nodes.push_back(*packed);
                for (uint32_t c = 0; c < node.child_count; ++c) next.push_back(node.first_child + c);
            }
            current.swap(next);
        }
        return {};
    }

    BakeInfo describe() const {
        BakeInfo info;
        info.source_hash = hash(mesh_);
        info.options_hash = hash(options_);
        info.surface_mode = !closed_;
        info.solid_volume = solid_volume_;
        info.method = options_.method;
        info.primitive = options_.primitive;
        info.quality = options_.quality;
        info.alpha = options_.alpha;
        info.beta = options_.beta;
        info.tolerance = options_.tolerance;
        info.levels = options_.levels || options_.ellipsoids || options_.tolerance > 0 ? options_.levels : 3;
        info.ellipsoids = options_.ellipsoids;
        info.seed = options_.seed;
        info.resolution = resolution_;
        return info;
    }

    std::vector<LevelReport> measure(const TreeView& tree, const Grown& grown, const Winding& winding,
                                     std::vector<format::PackedLevel>& levels) {
        constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
        std::vector<LevelReport> figures;
        for (uint32_t l = 0; l < tree.level_count(); ++l) {
            const auto start = Clock::now();
            std::vector<Ellipsoid> cut;
            tree.for_each_in_cut(l, [&](uint32_t node) { cut.push_back(tree.ellipsoid(node)); });
            const CoverVolume volume = measure_cover(mesh_, closed_, winding, cut, kMeasureColumns);
            LevelReport figure;
            double outside = 0;
            for (const GrownNode& node : grown.nodes)
                if (node.level == l || (node.level < l && node.child_count == 0)) {
                    outside += node.outside;
                    figure.surface_error = std::max(figure.surface_error, node.surface_error);
                }
            figure.nodes = static_cast<uint32_t>(cut.size());
            figure.bytes = tree.level(l).end_byte;
            figure.union_volume = volume.whole;
            figure.outside_ratio = solid_volume_ > 0 ? volume.outside / solid_volume_ : kUnknown;
            figure.sum_outside_ratio = solid_volume_ > 0 ? outside / solid_volume_ : kUnknown;
            figure.seconds = seconds_since(start) + (l < grown.seconds.size() ? grown.seconds[l] : 0);
            levels[l].outside_ratio = static_cast<float>(figure.outside_ratio);
            levels[l].surface_error = static_cast<float>(figure.surface_error);
            figures.push_back(figure);
        }
        return figures;
    }

    Result<void> prove(const TreeView& tree, std::vector<LevelReport>& figures) {
        VerifyOptions options;
        options.threads = options_.threads;
        if (progress_)
            options.progress = [&](double done) { return report("prove", 0.85 + 0.15 * done, tree.node_count()); };
        const auto start = Clock::now();
        const auto proof = verify(tree, mesh_, options);
        if (!proof) return proof.error();
        uint64_t pieces = 0;
        for (const LevelProof& level : proof->levels) pieces += level.pieces;
        for (size_t l = 0; l < figures.size(); ++l) {
            figures[l].covered = proof->levels[l].covered;
            figures[l].seconds += seconds_since(start) * static_cast<double>(proof->levels[l].pieces) /
                                  static_cast<double>(std::max<uint64_t>(pieces, 1));
            if (!figures[l].covered)
                return Error{ErrorCode::internal, "the cover of a level could not be proved; please report this mesh",
                             l};
        }
        return {};
    }

    const BuildOptions& options_;
    const Effort effort_;
    const ProgressCallback& progress_;
    std::mutex reporting_;
    std::atomic<bool> cancelled_ = false;
    double fraction_ = 0;

    MeshView mesh_;
    bool closed_ = false;
    Box box_;
    uint32_t resolution_ = 0;
    double solid_volume_ = 0; // 0 where there is no inside
    format::Lattice lattice_;
};

} // namespace

Result<Build> build(MeshView mesh, const BuildOptions& options, const ProgressCallback& progress) {
    if (const auto valid = validate(options); !valid) return valid.error();
    try {
        tbb::task_arena arena(options.threads ? static_cast<int>(options.threads) : tbb::task_arena::automatic);
        return arena.execute([&] { return Bake(options, progress).run(mesh); });
    } catch (const std::bad_alloc&) {
        return Error{ErrorCode::bad_mesh, "not enough memory; lower the quality, the count or the mesh's size", 0};
    }
}

} // namespace prolate
