// The story of a bake: clean, voxelise, grow, quantise, measure, prove.
#include <prolate/build.hpp>
#include <prolate/verify.hpp>

#include "builder/cover.hpp"
#include "builder/effort.hpp"
#include "builder/exact.hpp"
#include "builder/fill.hpp"
#include "builder/grow.hpp"
#include "builder/hausdorff.hpp"
#include "builder/hulls.hpp"
#include "builder/inner.hpp"
#include "builder/job.hpp"
#include "builder/mass.hpp"
#include "builder/mesh.hpp"
#include "builder/options.hpp"
#include "builder/resolution.hpp"

#include "src/format.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <mutex>
#include <new>
#include <optional>
#include <utility>

namespace prolate {
namespace {

using Clock = std::chrono::steady_clock;
constexpr int kAcross = 512; // across, to measure solids by

double seconds_since(Clock::time_point start) {
    return std::chrono::duration<double>(Clock::now() - start).count();
}

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
        auto cleaned = clean(input, options_.weld);
        if (!cleaned) return cleaned.error();
        source_ = std::move(*cleaned);
        report_ = source_.report;
        mesh_ = source_.mesh.view();
        source_hash_ = hash(mesh_);
        for (const Vec3& v : mesh_.vertices) box_.add(to_vec(v));
        if (auto possible = check_asked(options_, box_.size(), closed()); !possible) return possible.error();
        return options_.exact ? bake_exact() : bake_ellipsoids();
    }

    // Voxelise, grow, quantise, measure, prove.
    Result<Build> bake_ellipsoids() {
        report("voxelise", 0, 0);
        if (options_.fill > 0) {
            filled_ = fill(mesh_, double{options_.fill});
            mesh_ = filled_.view();
        }
        if (options_.keep_holes > 0) {
            passages_.emplace(mesh_, double{options_.keep_holes});
            if (!passages_->any())
                return Error{ErrorCode::bad_options,
                             "no such ball passes a hole of the mesh; give a smaller keep_holes", 0};
        }
        const Winding winding(mesh_);
        resolution_ = effort_.resolution;
        Pieces pieces = cut_pieces(mesh_, closed(), winding, expected_leaves(options_), resolution_,
                                   [this] { report("voxelise", 0.01, 0); });
        report("voxelise", 0.04, 0);
        const Columns columns = measure_solid(&winding, kAcross);
        if (auto possible = check(columns); !possible) return possible.error();

        report("fit", 0.05, 1);
        const Grown grown = grow_tree(pieces, winding);
        std::vector<format::PackedLevel> levels;
        if (auto packed = pack(grown, pieces, levels); !packed) return packed.error();
        std::vector<LevelReport> figures = measure(grown, columns, winding, levels);
        const bool reached = grown.goal_reached && (!passages_ || hole_radius_ >= double{options_.keep_holes});
        return finish(format::encode(describe(reached), options_.degree, lattice_, levels), std::move(figures),
                      reached);
    }

    // Split the triangles, bound them, prove.
    Result<Build> bake_exact() {
        report("measure", 0, 0);
        // Of an open one it takes very long, and nobody needs it. Fewer columns tell if parts of a closed one overlap.
        if (closed() && measure_solid(nullptr, kAcross / 2).winding_defect() > 0) measure_solid(nullptr, kAcross);
        report("split", 0.1, 1);
        const auto grown =
            grow_exact(mesh_, {.degree = options_.degree,
                               .leaf_triangles = options_.leaf_triangles,
                               .min_radius = min_radius(),
                               .margin = report_.weld_distance,
                               .effort = exact_effort_of(options_.quality),
                               .progress = [this](double done) { report("split", 0.1 + 0.75 * done, 0); }});
        if (!grown) return grown.error();
        std::vector<std::byte> bytes =
            format::encode(describe(true), options_.degree, grown->lattice, grown->levels, grown->packed());
        report("hulls", 0.85, 0);
        const auto without_hulls = TreeView::open(bytes, {.check_hash = false}); // Tree::open() checks the whole
        if (!without_hulls) return without_hulls.error();
        format::store_hulls(bytes, hulls_of(*without_hulls, exact_effort_of(options_.quality)));
        std::vector<LevelReport> figures(grown->levels.size()); // of a cover of the surface alone: none but these
        for (uint32_t l = 0; l < figures.size(); ++l)
            without_hulls->for_each_in_cut(l, [&](uint32_t) { ++figures[l].nodes; });
        return finish(std::move(bytes), std::move(figures), true);
    }

    // Append what follows the tree, prove.
    Result<Build> finish(std::vector<std::byte> bytes, std::vector<LevelReport> figures, bool goal_reached) {
        const auto progress = [this](double) { report("inner", 0.85, 0); };
        if (options_.inner > 0)
            if (auto added = append_inner_cover(bytes, mesh_, describe(goal_reached),
                                                {options_.inner, options_.degree, report_.weld_distance, progress});
                !added)
                return added.error();
        auto tree = Tree::open(std::move(bytes));
        if (!tree) return tree.error();
        for (uint32_t l = 0; l < figures.size(); ++l) figures[l].bytes = tree->view().level(l).end_byte;
        if (auto proved = prove(tree->view(), figures); !proved) return proved.error();
        return Build{.tree = std::move(*tree),
                     .mesh = report_,
                     .levels = std::move(figures),
                     .solid_volume = solid_.value,
                     .solid_volume_error = solid_.error,
                     .mass = mass_,
                     .diagonal = box_.size().norm(),
                     .resolution = resolution_,
                     .surface_mode = !closed(),
                     .goal_reached = goal_reached,
                     .hole_radius = hole_radius_,
                     .seconds = seconds_since(start_)};
    }

    // Can what is asked be done with this solid?
    Result<void> check(const Columns& columns) const {
        // Volume that may lie in several overlapping parts of a mesh, for the analytic method: share of the solid.
        constexpr double kMostOverlap = 1e-3;
        if (options_.tolerance > 0 && solid_.value == 0)
            return Error{ErrorCode::bad_mesh,
                         "the mesh encloses no volume, so no outside ratio can be met; "
                         "give levels or a count instead of a tolerance",
                         0};
        if (options_.method == Method::analytic &&
            !(closed() && columns.winding_defect() <= kMostOverlap * solid_.value))
            return Error{ErrorCode::bad_mesh,
                         "the analytic method needs a closed mesh whose parts do not overlap; use the voxel method", 0};
        return {};
    }

    // Sets the solid's volume and mass properties, unless it is too small to be one.
    Columns measure_solid(const Winding* winding, int columns_across) {
        constexpr double kNoInside = 1e-12; // of the diagonal's cube: less has no inside worth the name
        Columns columns = measuring_columns(mesh_, closed(), winding, columns_across);
        const Quadrature solid = columns.volume();
        if (!(solid.value > kNoInside * std::pow(box_.size().norm(), 3))) return columns;
        mass_ = mass_of(mesh_, closed(), columns);
        solid_ = options_.exact && mass_.volume > 0 ? Quadrature{mass_.volume, mass_.volume_error} : solid;
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

    double distance_tolerance() const { return effort_.distance_tolerance * box_.size().norm(); }
    double min_radius() const {
        const double farthest = std::max(box_.low.cwiseAbs().maxCoeff(), box_.high.cwiseAbs().maxCoeff());
        return std::max(kThinnestNodeOfMesh * box_.size().norm(), kThinnestNodeOfPlace * farthest);
    }
    bool closed() const { return report_.closed || options_.fill > 0; } // what is filled is closed
    double most_distance() const { return prolate::most_distance(options_, box_.size().norm()); }
    // A volume as a share of the solid's.
    double relative(double volume) const { return solid_.value > 0 ? volume / solid_.value : 0; }

    Grown grow_tree(Pieces& pieces, const Winding& winding) {
        const DistanceField field(mesh_, closed(), winding, field_resolution(resolution_));
        const Voxels cells = start_cells(mesh_, closed(), winding, expected_leaves(options_), resolution_);
        const Columns columns = measuring_columns(mesh_, closed(), &winding, 192); // fewer: only to compare covers by
        const auto exact = [&winding](const Fit& fit) { return outside_volume(fit, inside_volume(fit, winding)); };
        const auto distance = [&](std::span<const Ellipsoid> cover) {
            const HausdorffDistance found = hausdorff_distance(cover, winding, closed(), distance_tolerance(), 1);
            return found.max + found.max_error;
        };
        const Solid solid{.pieces = pieces,
                          .cells = cells,
                          .field = field,
                          .columns = columns,
                          .area = surface_area(mesh_),
                          .outside = options_.method == Method::analytic ? decltype(Solid::outside)(exact) : nullptr,
                          .distance = distance};
        const auto progress = [this](double done, uint32_t nodes) { report("fit", 0.05 + 0.75 * done, nodes); };
        return grow(solid, {.build = options_,
                            .effort = effort_,
                            .min_radius = min_radius(),
                            .most_distance = most_distance(),
                            .passages = passages_ ? &*passages_ : nullptr,
                            .progress = progress});
    }

    // Quantised nodes, by levels, each enlarged until its decoded ellipsoid covers.
    Result<void> pack(const Grown& grown, const Pieces& pieces, std::vector<format::PackedLevel>& levels) {
        Box centers;
        double size = 0;
        for (const GrownNode& node : grown.nodes) {
            centers.add(node.fit.center);
            size = std::max(size, node.fit.half_extents().maxCoeff());
        }
        lattice_ = format::lattice_for(centers.low.data(), centers.high.data(), size);
        for (size_t index = 0; index < grown.nodes.size(); ++index) {
            const GrownNode& node = grown.nodes[index];
            auto packed = covering_node(node.fit, pieces, node.pieces, lattice_, report_.weld_distance);
            if (!packed)
                return Error{ErrorCode::bad_mesh,
                             "the mesh is too large or too small for the file format; "
                             "scale it to metres",
                             index};
            packed->child_count = static_cast<uint8_t>(node.child_count);
            surface_errors_.push_back(surface_error(Fit(format::decode(*packed, lattice_)), pieces, node.pieces));
            levels.resize(node.level + 1);
            levels.back().nodes.push_back(*packed);
        }
        return {};
    }

    BakeInfo describe(bool goal_reached) const {
        BakeInfo info;
        info.source_hash = source_hash_;
        info.options_hash = hash(options_);
        info.surface_mode = !closed();
        info.exact = options_.exact;
        info.proved = true; // or there will be no file, see prove()
        info.goal_reached = goal_reached;
        info.solid_volume = solid_.value;
        info.solid_volume_error = static_cast<float>(relative(solid_.error));
        info.mass = mass_;
        info.diagonal = box_.size().norm();
        info.method = options_.method;
        info.primitive = options_.primitive;
        info.quality = options_.quality;
        info.alpha = options_.alpha;
        info.beta = options_.beta;
        info.tolerance = options_.tolerance;
        const bool has_distance = most_distance() < HUGE_VAL;
        info.distance = has_distance ? static_cast<float>(100 * most_distance() / info.diagonal) : 0;
        const bool asked = options_.levels || options_.ellipsoids || options_.tolerance > 0 || has_distance ||
                           options_.keep_holes > 0 || options_.exact;
        info.levels = asked ? options_.levels : 3;
        info.ellipsoids = options_.ellipsoids;
        info.seed = options_.seed;
        info.placement = mesh_.placement;
        info.weld = options_.weld;
        info.fill = options_.fill;
        info.keep_holes = options_.keep_holes;
        info.resolution = resolution_;
        return info;
    }

    // Of decoded nodes, so that the figures are the file's; they go into its levels table, too.
    std::vector<LevelReport> measure(const Grown& grown, const Columns& columns, const Winding& winding,
                                     std::vector<format::PackedLevel>& levels) {
        std::vector<LevelReport> figures;
        std::vector<Ellipsoid> leaves; // above the level
        double leaf_error = 0;         // their largest surface error
        size_t first = 0;              // of the level's nodes
        for (size_t l = 0; l < levels.size(); ++l) {
            report("measure", 0.8 + 0.05 * static_cast<double>(l) / static_cast<double>(levels.size()),
                   static_cast<uint32_t>(grown.nodes.size()));
            const auto start = Clock::now();
            std::vector<Ellipsoid> cut = leaves;
            double error = leaf_error;
            for (size_t n = 0; n < levels[l].nodes.size(); ++n) {
                const format::PackedNode& node = levels[l].nodes[n];
                cut.push_back(format::decode(node, lattice_));
                error = std::max(error, surface_errors_[first + n]);
                if (node.child_count > 0) continue;
                leaves.push_back(cut.back());
                leaf_error = std::max(leaf_error, surface_errors_[first + n]);
            }
            first += levels[l].nodes.size();
            LevelReport figure = figures_of(cut, columns, winding);
            figure.surface_error = error;
            figure.nodes = static_cast<uint32_t>(cut.size());
            figure.seconds = seconds_since(start) + (l < grown.seconds.size() ? grown.seconds[l] : 0);
            levels[l].figures = figure;
            figures.push_back(figure);
            if (passages_ && l + 1 == levels.size()) {
                const double beyond = passages_->needed() - double{options_.keep_holes};
                hole_radius_ = std::max(0.0, passages_->nearest(cut).distance - beyond);
            }
        }
        return figures;
    }

    LevelReport figures_of(std::span<const Ellipsoid> cut, const Columns& columns, const Winding& winding) const {
        LevelReport out;
        const CoverVolume volume = measure_cover(columns, cut);
        out.union_volume = volume.whole.value;
        if (solid_.value > 0) {
            out.outside_ratio = relative(volume.outside.value);
            out.outside_ratio_error = relative(volume.outside.error) + out.outside_ratio * relative(solid_.error);
            out.sum_outside_ratio = relative(volume.sum_outside.value);
        }
        const HausdorffDistance distance =
            hausdorff_distance(cut, winding, closed(), distance_tolerance(), effort_.distance_samples);
        out.hausdorff_max = distance.max + distance.max_error;
        out.hausdorff_mean = distance.mean;
        out.hausdorff_p99 = distance.p99;
        return out;
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
        const auto proof = verify(tree, source_.mesh.view(), options);
        if (!proof) return proof.error();
        if (!proof->bounded || !proof->inner_inside)
            return Error{ErrorCode::internal,
                         "a bounding volume or an inner ellipsoid could not be proved; please report this mesh",
                         proof->bounded ? proof->protruding_node : proof->unbounded_node};
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
    const Clock::time_point start_ = Clock::now();
    std::mutex reporting_;
    BuildProgress reached_{"clean", 0, 0};

    CleanMesh source_;
    uint64_t source_hash_ = 0;
    Mesh filled_;   // if that is asked for
    MeshView mesh_; // what bounds the solid: either of these
    MeshReport report_;
    std::optional<Passages> passages_;
    double hole_radius_ = 0;
    Box box_;
    uint32_t resolution_ = 0;
    Quadrature solid_; // its volume; 0 where there is no inside
    MassProperties mass_;
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
