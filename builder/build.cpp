// The story of a bake: clean, voxelise, grow, quantise, measure, prove.
#include <prolate/build.hpp>
#include <prolate/verify.hpp>

#include "builder/cover.hpp"
#include "builder/effort.hpp"
#include "builder/exact.hpp"
#include "builder/grow.hpp"
#include "builder/hausdorff.hpp"
#include "builder/hulls.hpp"
#include "builder/job.hpp"

#include "src/format.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <mutex>
#include <new>

namespace prolate {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) {
    return std::chrono::duration<double>(Clock::now() - start).count();
}

constexpr uint32_t kMaxResolution = 320;
constexpr uint32_t kMaxFieldResolution = 256;
constexpr double kFieldResolution = 1.25; // of the distance field, against the voxels'
constexpr double kPiecesPerLeaf = 40;     // fewer, and leaves follow the grid instead of the shape
constexpr double kCellsPerLeaf = 24;      // of the coarser grid that the optimisation starts from
constexpr uint32_t kLeastCells = 48;      // of that grid, along the longest side
constexpr int kMeterColumns = 192;        // to compare covers while baking
constexpr int kMeasureColumns = 512;      // of the reported figures

// A solid of less than this share of its diagonal's cube has no inside worth the name.
constexpr double kNoInside = 1e-12;
// Volume that may lie in several overlapping parts of a mesh, for the analytic method: share of the solid.
constexpr double kMostOverlap = 1e-3;

// One build, start to end. Members are in the order in which they come to life.
class Bake {
public:
    Bake(const BuildOptions& options, const ProgressCallback& progress)
        : options_(options), effort_(effort_of(options.quality)), progress_(progress),
          job_(options.threads, progress ? [this] { return go_on(); } : std::function<bool()>()) {}

    Result<Build> operator()(MeshView mesh) {
        return job_.run([&] { return run(mesh); });
    }

private:
    Result<Build> run(MeshView input) {
        const auto start = Clock::now();
        auto cleaned = clean(input, options_.weld);
        if (!cleaned) return cleaned.error();
        mesh_ = cleaned->mesh.view();
        closed_ = cleaned->report.closed;
        margin_ = cleaned->report.weld_distance;
        for (const Vec3& v : mesh_.vertices) box_.add(to_vec(v));
        if (options_.exact) return run_exact(cleaned->report, start);
        report("voxelise", 0, 0);

        const Winding winding(mesh_);
        Pieces pieces = cut_pieces(winding);
        report("voxelise", 0.04, 0);
        const Columns columns = measure_solid(winding);
        if (options_.tolerance > 0 && solid_.value == 0)
            return Error{ErrorCode::bad_mesh,
                         "the mesh encloses no volume, so no outside ratio can be met; "
                         "give levels or a count instead of a tolerance",
                         0};
        if (options_.method == Method::analytic) {
            const WindingDefect& defect = columns.winding_defect();
            winding_sign_ = defect.inward < defect.outward ? -1 : 1;
            if (!closed_ || std::min(defect.inward, defect.outward) > kMostOverlap * solid_.value)
                return Error{ErrorCode::bad_mesh,
                             "the analytic method needs a closed mesh whose parts do not overlap; use the voxel method",
                             0};
        }
        report("fit", 0.05, 1);

        const Grown grown = grow_tree(pieces, winding);

        std::vector<format::PackedLevel> levels;
        if (auto packed = pack(grown, pieces, levels); !packed) return packed.error();
        const BakeInfo info = describe(grown.goal_reached);
        // Measured on decoded nodes, so that the figures are the file's; they are then written into its levels table.
        std::vector<LevelReport> figures;
        {
            auto draft = Tree::open(format::encode(info, options_.degree, lattice_, levels));
            if (!draft) return draft.error();
            figures = measure(draft->view(), grown, columns, winding, levels);
        }
        auto tree = Tree::open(format::encode(info, options_.degree, lattice_, levels));
        if (!tree) return tree.error();

        if (auto proved = prove(tree->view(), figures); !proved) return proved.error();
        return Build{std::move(*tree),   cleaned->report, std::move(figures), solid_.value,       solid_.error,
                     box_.size().norm(), resolution_,     !closed_,           grown.goal_reached, seconds_since(start)};
    }

    Result<Build> run_exact(const MeshReport& mesh_report, Clock::time_point start) {
        report("measure", 0, 0);
        if (closed_) measure_solid(Winding(mesh_)); // of an open one it takes very long, and nobody needs it
        report("split", 0.1, 1);
        ExactOptions options{options_.degree, options_.leaf_triangles, min_radius(), margin_, {}};
        options.progress = [this](double done) { report("split", 0.1 + 0.75 * done, 0); };
        const auto grown = grow_exact(mesh_, options);
        if (!grown) return grown.error();
        std::vector<std::byte> bytes =
            format::encode(describe(true), options_.degree, grown->lattice, grown->levels, grown->packed());
        report("hulls", 0.85, 0);
        const auto without_hulls = TreeView::open(bytes, {.check_hash = false}); // Tree::open() checks the whole
        if (!without_hulls) return without_hulls.error();
        format::store_hulls(bytes, hulls_of(*without_hulls));
        auto tree = Tree::open(std::move(bytes));
        if (!tree) return tree.error();

        std::vector<LevelReport> figures(tree->view().level_count()); // of a cover of the surface alone: none
        for (uint32_t l = 0; l < figures.size(); ++l) {
            figures[l].bytes = tree->view().level(l).end_byte;
            tree->view().for_each_in_cut(l, [&](uint32_t) { ++figures[l].nodes; });
        }
        if (auto proved = prove(tree->view(), figures); !proved) return proved.error();
        return Build{std::move(*tree),   mesh_report, std::move(figures), solid_.value, solid_.error,
                     box_.size().norm(), 0,           !closed_,           true,         seconds_since(start)};
    }

    // Sets the solid's volume, unless it is too small to be one.
    Columns measure_solid(const Winding& winding) {
        Columns columns = measuring_columns(mesh_, closed_, winding, kMeasureColumns);
        const Quadrature solid = columns.volume();
        if (solid.value > kNoInside * std::pow(box_.size().norm(), 3)) solid_ = solid;
        return columns;
    }

    // Tells the caller, and asks whether to go on; throws Cancelled if not.
    void report(const char* stage, double fraction, uint32_t nodes) {
        {
            const std::lock_guard lock(reporting_);
            reached_ = {stage, std::max(reached_.fraction, fraction), nodes};
        }
        job_.ask();
    }
    bool go_on() {
        BuildProgress reached;
        {
            const std::lock_guard lock(reporting_);
            reached = reached_;
        }
        return progress_(reached);
    }

    double surface_area() const {
        double area = 0;
        for (const Triangle& t : mesh_.triangles) {
            const Vec a = to_vec(mesh_.vertices[t[0]]);
            area += 0.5 * (to_vec(mesh_.vertices[t[1]]) - a).cross(to_vec(mesh_.vertices[t[2]]) - a).norm();
        }
        return area;
    }
    double distance_tolerance() const { return effort_.distance_tolerance * box_.size().norm(); }
    double min_radius() const {
        const double farthest = std::max(box_.low.cwiseAbs().maxCoeff(), box_.high.cwiseAbs().maxCoeff());
        return std::max(kThinnestNodeOfMesh * box_.size().norm(), kThinnestNodeOfPlace * farthest);
    }
    // A volume as a share of the solid's.
    double relative(double volume) const { return solid_.value > 0 ? volume / solid_.value : 0; }

    // Leaves to expect, for the choice of the resolution.
    double expected_leaves() const {
        if (options_.ellipsoids) return options_.ellipsoids;
        if (options_.tolerance > 0 || options_.distance > 0) return 1000;
        return std::min(std::pow(double(options_.degree), options_.levels ? options_.levels : 3u), 65536.0);
    }

    // Fine enough for the leaves to come.
    Pieces cut_pieces(const Winding& winding) {
        resolution_ = effort_.resolution;
        for (;;) {
            report("voxelise", 0.01, 0);
            Pieces pieces(mesh_, closed_, winding, resolution_);
            if (pieces.size() >= kPiecesPerLeaf * expected_leaves() || resolution_ == kMaxResolution) return pieces;
            resolution_ = finer(resolution_, kPiecesPerLeaf * expected_leaves() / pieces.size());
        }
    }
    Voxels start_cells(const Winding& winding) const {
        for (uint32_t resolution = std::min(kLeastCells, resolution_);;) {
            Voxels cells(mesh_, closed_, winding, resolution);
            if (cells.cell_count() >= kCellsPerLeaf * expected_leaves() || resolution == resolution_) return cells;
            resolution =
                std::min(resolution_, finer(resolution, kCellsPerLeaf * expected_leaves() / cells.cell_count()));
        }
    }
    // A resolution that gives about `times` as many cells: they grow with its square (surface) to its cube (volume).
    static uint32_t finer(uint32_t resolution, double times) {
        const double grown = std::ceil(resolution * std::clamp(std::sqrt(times), 1.05, 2.0));
        return std::min(kMaxResolution, static_cast<uint32_t>(grown));
    }

    Grown grow_tree(Pieces& pieces, const Winding& winding) {
        const auto field_resolution = static_cast<uint32_t>(kFieldResolution * resolution_);
        const DistanceField field(mesh_, closed_, winding, std::min(field_resolution, kMaxFieldResolution));
        const Voxels cells = start_cells(winding);
        const Columns columns = measuring_columns(mesh_, closed_, winding, kMeterColumns);
        const GrowOptions options{options_, effort_, min_radius(), box_.size().norm(),
                                  [&](double done, uint32_t nodes) { report("fit", 0.05 + 0.75 * done, nodes); }};
        const auto exact = [&winding, sign = winding_sign_](const Fit& fit) {
            EllipsoidVolume inside = inside_volume(fit, winding);
            inside.volume *= sign, inside.d_center *= sign, inside.d_shape *= sign;
            return outside_volume(fit, inside);
        };
        const auto distance = [&](std::span<const Ellipsoid> cover) {
            const HausdorffDistance found = hausdorff_distance(cover, winding, closed_, distance_tolerance(), 1);
            return found.max + found.max_error;
        };
        Solid solid{pieces, cells, field, columns, surface_area(), {}, distance};
        if (options_.method == Method::analytic) solid.outside = exact;
        return grow(solid, options);
    }

    // Quantised nodes, breadth-first, each enlarged until its decoded ellipsoid covers.
    Result<void> pack(const Grown& grown, const Pieces& pieces, std::vector<format::PackedLevel>& levels) {
        Box centers;
        double size = 0;
        for (const GrownNode& node : grown.nodes) {
            centers.add(node.fit.center);
            size = std::max(size, node.fit.half_extents().maxCoeff());
        }
        lattice_ = format::lattice_for(centers.low.data(), centers.high.data(), size);
        surface_errors_.resize(grown.nodes.size());
        std::vector<uint32_t> current{0};
        while (!current.empty()) {
            std::vector<uint32_t> next;
            format::PackedLevel& level = levels.emplace_back();
            for (const uint32_t index : current) {
                const GrownNode& node = grown.nodes[index];
                auto packed = covering_node(node.fit, pieces, node.pieces, lattice_, margin_);
                if (!packed)
                    return Error{ErrorCode::bad_mesh,
                                 "the mesh is too large or too small for the file format; "
                                 "scale it to metres",
                                 index};
                packed->child_count = static_cast<uint8_t>(node.child_count);
                surface_errors_[index] = surface_error(Fit(format::decode(*packed, lattice_)), pieces, node.pieces);
                level.nodes.push_back(*packed);
                for (uint32_t c = 0; c < node.child_count; ++c) next.push_back(node.first_child + c);
            }
            current.swap(next);
        }
        return {};
    }

    BakeInfo describe(bool goal_reached) const {
        BakeInfo info;
        info.source_hash = hash(mesh_);
        info.options_hash = hash(options_);
        info.surface_mode = !closed_;
        info.exact = options_.exact;
        info.proved = true; // or there will be no file, see prove()
        info.goal_reached = goal_reached;
        info.solid_volume = solid_.value;
        info.solid_volume_error = static_cast<float>(relative(solid_.error));
        info.diagonal = box_.size().norm();
        info.method = options_.method;
        info.primitive = options_.primitive;
        info.quality = options_.quality;
        info.alpha = options_.alpha;
        info.beta = options_.beta;
        info.tolerance = options_.tolerance;
        info.distance = options_.distance;
        const bool asked =
            options_.levels || options_.ellipsoids || options_.tolerance > 0 || options_.distance > 0 || options_.exact;
        info.levels = asked ? options_.levels : 3;
        info.ellipsoids = options_.ellipsoids;
        info.seed = options_.seed;
        info.placement = mesh_.placement;
        info.weld = options_.weld;
        info.resolution = resolution_;
        return info;
    }

    std::vector<LevelReport> measure(const TreeView& tree, const Grown& grown, const Columns& columns,
                                     const Winding& winding, std::vector<format::PackedLevel>& levels) {
        std::vector<LevelReport> figures;
        for (uint32_t l = 0; l < tree.level_count(); ++l) {
            report("measure", 0.8 + 0.05 * l / tree.level_count(), tree.node_count());
            const auto start = Clock::now();
            std::vector<Ellipsoid> cut;
            tree.for_each_in_cut(l, [&](uint32_t node) { cut.push_back(tree.ellipsoid(node)); });
            const CoverVolume volume = measure_cover(columns, cut);
            LevelReport figure;
            figure.surface_error = 0;
            for (size_t n = 0; n < grown.nodes.size(); ++n)
                if (grown.nodes[n].level == l || (grown.nodes[n].level < l && grown.nodes[n].child_count == 0))
                    figure.surface_error = std::max(figure.surface_error, surface_errors_[n]);
            figure.nodes = static_cast<uint32_t>(cut.size());
            figure.bytes = tree.level(l).end_byte;
            figure.union_volume = volume.whole.value;
            if (solid_.value > 0) {
                figure.outside_ratio = relative(volume.outside.value);
                figure.outside_ratio_error =
                    relative(volume.outside.error) + figure.outside_ratio * relative(solid_.error);
                figure.sum_outside_ratio = relative(volume.sum_outside.value);
            }
            const HausdorffDistance distance =
                hausdorff_distance(cut, winding, closed_, distance_tolerance(), effort_.distance_samples);
            figure.hausdorff_max = distance.max + distance.max_error;
            figure.hausdorff_mean = distance.mean;
            figure.hausdorff_p99 = distance.p99;
            figure.seconds = seconds_since(start) + (l < grown.seconds.size() ? grown.seconds[l] : 0);
            levels[l].figures = figure;
            figures.push_back(figure);
        }
        return figures;
    }

    Result<void> prove(const TreeView& tree, std::vector<LevelReport>& figures) {
        VerifyOptions options;
        options.threads = options_.threads;
        if (progress_)
            options.progress = [&](double done) {
                report("prove", 0.85 + 0.15 * done, tree.node_count());
                return true;
            };
        const auto start = Clock::now();
        const auto proof = verify(tree, mesh_, options);
        if (!proof) return proof.error();
        if (!proof->bounded)
            return Error{ErrorCode::internal, "a bounding volume could not be proved; please report this mesh",
                         proof->unbounded_node};
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
    Job job_;
    std::mutex reporting_;
    BuildProgress reached_{"clean", 0, 0};

    MeshView mesh_;
    bool closed_ = false;
    double margin_ = 0; // by which welding moved points: they are covered as they stood
    Box box_;
    uint32_t resolution_ = 0;
    Quadrature solid_;        // its volume; 0 where there is no inside
    double winding_sign_ = 1; // -1: the mesh is inside out
    format::Lattice lattice_;
    std::vector<double> surface_errors_; // of the grown nodes, as decoded
};

} // namespace

Result<Build> build(MeshView mesh, const BuildOptions& options, const ProgressCallback& progress) {
    if (const auto valid = validate(options); !valid) return valid.error();
    try {
        return Bake(options, progress)(mesh);
    } catch (const Cancelled&) {
        return Error{ErrorCode::cancelled, "cancelled", 0};
    } catch (const std::bad_alloc&) {
        return Error{ErrorCode::out_of_memory, "there is not enough memory"};
    }
}

} // namespace prolate
