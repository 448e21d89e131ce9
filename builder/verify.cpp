// Proof of cover by adaptive subdivision, from the decoded tree and the mesh alone.
//
// For a box B, the polyhedron (solid ∩ B) is the convex combination of its extreme points, and those are corners of the
// triangles clipped to B, or corners of B inside the solid. If all of them lie in one ellipsoid, so does the whole
// piece, because an ellipsoid is convex. The same may hold of its two parts on either side of a plane, and two
// ellipsoids: along the seam of neighbours that overlap little, boxes alone would be as many as the seam's area is
// larger than the overlap's square. Failing that, B is cut into eight. The proof ends because the ellipsoids overlap:
// around each point of the solid there is a box small enough for one of them, unless that point is on the very border
// of all ellipsoids that contain it.
//
// Each level is a cover by itself. That a query reaches its nodes is for the bounding volumes to see to
// (verify_bounding.cpp). A prefix of an exact tree has none, and queries descend by its nodes: there "in a node" means
// in its ellipsoid and in those of all nodes above it, which is convex, too.
//
// Rounding: clipped corners are off by a few 2^-53 of the largest coordinate; kTolerance asks for 1e-12 of it. Corners
// of B are classified by the winding number with a threshold of 0.25: in doubt a corner belongs to the solid.
// Where welding closed the mesh, the distance by which it moved points is added: whatever is within it of a point that
// an ellipsoid holds by that margin, the ellipsoid holds.
//
// Shares no data with the bake: other boxes, other inside test (dipole tree instead of columns).
//
// An exact tree says which triangles each node stands for, and verify_exact.cpp takes it by its word.
#include <prolate/verify.hpp>

#include "builder/clip.hpp"
#include "builder/fit.hpp"
#include "builder/job.hpp"
#include "builder/verify_bounding.hpp"
#include "builder/verify_exact.hpp"
#include "builder/winding.hpp"
#include "src/hash.hpp"

#include <tbb/concurrent_unordered_map.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <numeric>
#include <optional>

namespace prolate {
namespace {

constexpr double kTolerance = 1e-12;           // of the largest coordinate: corners must be inside by this much
constexpr double kSmallestBox = 1e-9;          // of the mesh's size: below, the proof gives up
constexpr uint64_t kPiecesPerTask = 4'000'000; // a bound on the work at hostile trees; real ones need about 10,000
constexpr double kAccuracy = 3;                // of the winding number, see Winding
constexpr int kTaskLevels = 3;                 // 8^3 boxes to share between threads
constexpr size_t kMostCorners = 4'000'000;     // to remember
constexpr size_t kFewCandidates = 6;           // up to so many are tried in pairs

struct Shape { // a node and, by `parent`, those above it that must hold the same
    Fit fit;
    double shrunk;                 // squared radial coordinate up to which a point is inside beyond doubt
    double shortest_inverse;       // bounds |L^-1 v| / |v|
    const Shape* parent = nullptr; // none: it stands for itself

    bool ellipsoid_holds(const Vec& p) const { return fit.radial_squared(p) <= shrunk; }
    bool holds(const Vec& p) const { return ellipsoid_holds(p) && (parent == nullptr || parent->holds(p)); }
    bool barely_holds(const Vec& p) const {
        return fit.radial_squared(p) <= 1 && (parent == nullptr || parent->barely_holds(p));
    }
    // The ellipsoid that `p` is farthest out in.
    const Fit& outermost(const Vec& p) const {
        const Fit* found = &fit;
        double largest = fit.radial_squared(p);
        for (const Shape* s = parent; s != nullptr; s = s->parent)
            if (const double radial = s->fit.radial_squared(p); radial > largest) largest = radial, found = &s->fit;
        return *found;
    }
    double radial_squared(const Vec& p) const { return outermost(p).radial_squared(p); }
};

struct Cell {
    Box box;
    std::vector<Polygon> polygons;    // the surface in the box
    std::vector<uint32_t> candidates; // ellipsoids that may meet the box
    bool solid = false;               // wholly inside: there is no surface, and this is known
};

// The solid of a closed mesh. Thread-safe.
class ClosedSolid {
public:
    explicit ClosedSolid(MeshView mesh) : winding_(mesh) {}

    // The winding number is whole but on the surface, so a value in between tells of the error of the fast evaluation:
    // then the exact sum.
    double winding(const Vec& p) const {
        const double fast = winding_(p, kAccuracy);
        return std::abs(fast - std::round(fast)) < 0.1 ? fast : winding_(p, HUGE_VAL);
    }
    bool holds(const Vec& p) const { return std::abs(winding(p)) > 0.25; }
    // The same for a corner of a box: those of neighbouring boxes, and of all levels, are the same points.
    bool holds_corner(const Vec& p) const {
        const Key key{p.x(), p.y(), p.z()};
        if (const auto found = corners_.find(key); found != corners_.end()) return found->second;
        const bool held = holds(p);
        if (corners_.size() < kMostCorners) corners_.emplace(key, held);
        return held;
    }

private:
    using Key = std::array<double, 3>;
    struct Hash {
        size_t operator()(const Key& key) const { return hash_bytes(std::as_bytes(std::span(key))); }
    };
    Winding winding_;
    mutable tbb::concurrent_unordered_map<Key, bool, Hash> corners_;
};

class Prover {
public:
    Prover(const std::vector<Shape>& shapes, const ClosedSolid* solid, double size)
        : shapes_(shapes), solid_(solid), size_(size) {}

    LevelProof proof; // covered stays true until something speaks against it

    // Done with this cell? If not, it has to be cut.
    bool settled(Cell& cell) {
        ++proof.pieces;
        suspect_.reset();
        drop_far_candidates(cell);
        if (cell.polygons.empty() && !solid_) return true; // surface mode: nothing here to cover
        for (const uint32_t c : cell.candidates)
            if (holds_box(shapes_[c], cell.box)) return true;
        if (cell.polygons.empty() && !cell.solid) { // wholly inside the solid or wholly outside
            if (!solid_->holds_corner(cell.box.corner(0))) return true;
            cell.solid = true;
        }
        std::array<int8_t, 8> corner_inside;
        corner_inside.fill(cell.solid ? 1 : -1); // -1: not asked yet
        if (!cell.solid)
            for (const uint32_t c : cell.candidates)
                if (holds_piece(shapes_[c], cell, corner_inside)) return true;
        if (cell.candidates.size() <= kFewCandidates)
            for (size_t b = 1; b < cell.candidates.size(); ++b)
                for (size_t a = 0; a < b; ++a)
                    if (hold_parts(shapes_[cell.candidates[a]], shapes_[cell.candidates[b]], cell, corner_inside))
                        return true;
        refute(cell);
        return !proof.covered;
    }

    void prove(Cell& cell) {
        checkpoint();
        if (settled(cell)) return;
        if (cell.box.size().maxCoeff() < kSmallestBox * size_ || proof.pieces > kPiecesPerTask) {
            give_up(cell.box.center());
            return;
        }
        std::array<Cell, 8> parts = cut(cell);
        cell = {}; // the memory is not needed on the way down
        for (Cell& part : parts) {
            prove(part);
            if (!proof.covered) return;
        }
    }

    static std::array<Cell, 8> cut(const Cell& cell) {
        std::array<Cell, 8> parts;
        const Vec middle = cell.box.center();
        for (unsigned p = 0; p < 8; ++p) {
            for (int a = 0; a < 3; ++a) {
                const bool upper = p >> a & 1;
                parts[p].box.low[a] = upper ? middle[a] : cell.box.low[a];
                parts[p].box.high[a] = upper ? cell.box.high[a] : middle[a];
            }
            parts[p].candidates = cell.candidates;
            parts[p].solid = cell.solid;
        }
        Polygon x[2], y[2], z[2];
        for (const Polygon& polygon : cell.polygons) {
            split_polygon(polygon, 0, middle[0], x[0], x[1]);
            for (unsigned i = 0; i < 2; ++i) {
                if (x[i].empty()) continue;
                split_polygon(x[i], 1, middle[1], y[0], y[1]);
                for (unsigned j = 0; j < 2; ++j) {
                    if (y[j].empty()) continue;
                    split_polygon(y[j], 2, middle[2], z[0], z[1]);
                    for (unsigned k = 0; k < 2; ++k)
                        if (!z[k].empty()) parts[i | j << 1 | k << 2].polygons.push_back(z[k]);
                }
            }
        }
        return parts;
    }

private:
    static bool holds_box(const Shape& shape, const Box& box) {
        for (unsigned i = 0; i < 8; ++i)
            if (!shape.ellipsoid_holds(box.corner(i))) return false;
        return shape.parent == nullptr || holds_box(*shape.parent, box);
    }

    bool holds_piece(const Shape& shape, const Cell& cell, std::array<int8_t, 8>& corner_inside) const {
        for (const Polygon& polygon : cell.polygons)
            for (const Vec& p : polygon)
                if (!shape.ellipsoid_holds(p)) return false;
        if (!solid_) return shape.parent == nullptr || holds_piece(*shape.parent, cell, corner_inside);
        for (unsigned i = 0; i < 8; ++i) {
            const Vec corner = cell.box.corner(i);
            if (shape.ellipsoid_holds(corner)) continue;
            if (corner_inside[i] < 0) corner_inside[i] = solid_->holds_corner(corner);
            if (corner_inside[i]) return false;
        }
        return shape.parent == nullptr || holds_piece(*shape.parent, cell, corner_inside);
    }

    // Does `a` hold what is below, and `b` what is above the plane that is tangent, near the middle of the cell, to the
    // surface of equal radial coordinates? The parts' corners are those of the cell, and where the plane cuts edges.
    // A corner that they do not hold is suspect: it may be a counterexample.
    bool hold_parts(const Shape& a, const Shape& b, const Cell& cell, std::array<int8_t, 8>& corner_inside) {
        for (const Polygon& polygon : cell.polygons)
            for (const Vec& p : polygon)
                if (!a.holds(p) && !b.holds(p)) return false;
        Vec on_plane = cell.box.center(), normal;
        const Fit &fit_a = a.outermost(on_plane), &fit_b = b.outermost(on_plane);
        for (int newton = 0; newton < 3; ++newton) {
            const Vec from_a = fit_a.inverse * (on_plane - fit_a.center);
            const Vec from_b = fit_b.inverse * (on_plane - fit_b.center);
            normal = 2 * (fit_a.inverse.transpose() * from_a - fit_b.inverse.transpose() * from_b);
            if (normal.squaredNorm() == 0) return false;
            if (newton < 2) on_plane -= (from_a.squaredNorm() - from_b.squaredNorm()) / normal.squaredNorm() * normal;
        }
        const auto height = [&](const Vec& p) { return normal.dot(p - on_plane); };
        const auto holds_own = [&](const Vec& p, double h) { return (h > 0 || a.holds(p)) && (h < 0 || b.holds(p)); };
        const auto cut_of = [](const Vec& p, double h_p, const Vec& q, double h_q) -> Vec {
            return p + h_p / (h_p - h_q) * (q - p);
        };
        for (const Polygon& polygon : cell.polygons) {
            double last = height(polygon.back());
            for (size_t i = 0; i < polygon.size(); ++i) {
                const Vec &p = polygon[i], &before = polygon[i ? i - 1 : polygon.size() - 1];
                const double h = height(p);
                if (!holds_own(p, h)) return false;
                if (h * last < 0)
                    if (const Vec cut = cut_of(p, h, before, last); !holds_own(cut, 0)) {
                        suspect_ = cut;
                        return false;
                    }
                last = h;
            }
        }
        if (!solid_) return true;
        std::array<double, 8> heights;
        for (unsigned i = 0; i < 8; ++i) {
            const Vec corner = cell.box.corner(i);
            heights[i] = height(corner);
            if (holds_own(corner, heights[i])) continue;
            if (corner_inside[i] < 0) corner_inside[i] = solid_->holds_corner(corner);
            if (corner_inside[i]) return false;
        }
        for (unsigned i = 0; i < 8; ++i)
            for (unsigned axis = 1; axis < 8; axis <<= 1) {
                const unsigned j = i ^ axis;
                if (i > j || !(heights[i] * heights[j] < 0)) continue;
                const Vec cut = cut_of(cell.box.corner(i), heights[i], cell.box.corner(j), heights[j]);
                if (!holds_own(cut, 0) && (cell.solid || solid_->holds(cut))) return false;
            }
        return true;
    }

    void drop_far_candidates(Cell& cell) const {
        const Vec center = cell.box.center();
        const double radius = 0.5 * cell.box.size().norm();
        std::erase_if(cell.candidates, [&](uint32_t c) {
            const Shape& shape = shapes_[c];
            if (std::sqrt(shape.fit.radial_squared(center)) <= 1 + radius * shape.shortest_inverse) {
                const Vec gap = (center - shape.fit.center).cwiseAbs() - 0.5 * cell.box.size();
                return (gap.array() > shape.fit.half_extents().array() * (1 + 1e-9)).any();
            }
            return true;
        });
    }

    // A counterexample, if `p` is a point of the solid and no ellipsoid contains it, not even barely.
    template <class InSolid> void refute_at(const Vec& p, const Cell& cell, InSolid&& in_solid) {
        const auto holds_it = [&](uint32_t c) { return shapes_[c].barely_holds(p); };
        if (holds_it(last_holder_)) return; // of points one after the other, most often the same
        for (const uint32_t c : cell.candidates)
            if (holds_it(c)) {
                last_holder_ = c;
                return;
            }
        if (!in_solid()) return;
        double nearest = HUGE_VAL;
        for (const Shape& shape : shapes_) nearest = std::min(nearest, shape.radial_squared(p));
        if (nearest <= 1) return;
        proof.covered = false;
        proof.has_counterexample = true;
        std::copy_n(p.data(), 3, proof.point);
        proof.depth = std::sqrt(nearest) - 1;
    }

    // Looks for a counterexample among the points at hand.
    void refute(const Cell& cell) {
        if (suspect_) refute_at(*suspect_, cell, [] { return true; });
        if (!proof.covered) return;
        for (const Polygon& polygon : cell.polygons)
            for (const Vec& p : polygon) {
                refute_at(p, cell, [] { return true; });
                if (!proof.covered) return;
            }
        if (!solid_) return;
        for (unsigned i = 0; i < 9 && proof.covered; ++i) {
            const Vec p = i < 8 ? cell.box.corner(i) : cell.box.center();
            // A point that close to 1/2 lies on the surface: as good a witness as any, but 3/4 leaves no doubt.
            refute_at(p, cell, [&] {
                if (cell.solid) return true;
                return (i == 8 || solid_->holds_corner(p)) && std::abs(solid_->winding(p)) > 0.75;
            });
        }
    }

    void give_up(const Vec& p) {
        proof.covered = false;
        std::copy_n(p.data(), 3, proof.point);
    }

    const std::vector<Shape>& shapes_;
    const ClosedSolid* solid_; // null in surface mode
    double size_;
    uint32_t last_holder_ = 0;   // a shape
    std::optional<Vec> suspect_; // a point of the surface, in the cell at hand
};

std::vector<Shape> shapes_of(const TreeView& tree, double rounding) {
    std::vector<Shape> shapes(tree.slot_count());
    tree.for_each_node([&](uint32_t node) {
        Shape& shape = shapes[node];
        shape.fit = Fit(tree.ellipsoid(node));
        shape.shortest_inverse = shape.fit.inverse.norm();
        const double margin = std::max(0.0, 1 - rounding * shape.shortest_inverse);
        shape.shrunk = margin > 0 ? margin * margin - 1e-14 : -1;
        if (!tree.bake_info().exact) return;
        const ChildRange children = tree.children(node);
        for (uint32_t c = 0; c < children.count; ++c) shapes[children.first + c].parent = &shape;
    });
    return shapes;
}

// The space around the solid in enough boxes for the threads, with the surface in each.
std::vector<Cell> cut_space(MeshView mesh, const Box& box) {
    std::vector<Cell> cells(1);
    cells[0].box = box;
    for (const Triangle& t : mesh.triangles)
        cells[0].polygons.push_back(
            {to_vec(mesh.vertices[t[0]]), to_vec(mesh.vertices[t[1]]), to_vec(mesh.vertices[t[2]])});
    for (int level = 0; level < kTaskLevels; ++level) {
        std::vector<Cell> parts(8 * cells.size());
        parallel_for(size_t{0}, cells.size(), [&](size_t i) {
            std::array<Cell, 8> cut = Prover::cut(cells[i]);
            std::move(cut.begin(), cut.end(), parts.begin() + static_cast<std::ptrdiff_t>(8 * i));
            cells[i] = {};
        });
        cells.swap(parts);
    }
    return cells;
}

LevelProof prove_level(const std::vector<Shape>& shapes, const std::vector<Cell>& cells, const ClosedSolid* solid,
                       double size, const std::function<void(double)>& progress) {
    std::vector<uint32_t> everyone(shapes.size());
    std::iota(everyone.begin(), everyone.end(), 0u);
    std::vector<LevelProof> proofs(cells.size());
    std::atomic<size_t> done = 0;
    parallel_for(size_t{0}, cells.size(), [&](size_t i) {
        Prover prover(shapes, solid, size);
        prover.proof.covered = true;
        Cell cell = cells[i];
        cell.candidates = everyone;
        prover.prove(cell);
        proofs[i] = prover.proof;
        const size_t finished = ++done;
        if (finished % 8 == 0) progress(static_cast<double>(finished) / static_cast<double>(cells.size()));
    });
    LevelProof total;
    total.covered = true;
    for (const LevelProof& p : proofs) { // the first failure in a fixed order: the same for any number of threads
        total.pieces += p.pieces;
        if (total.covered && !p.covered) {
            const uint64_t pieces = total.pieces;
            total = p;
            total.pieces = pieces;
        }
    }
    return total;
}

Result<VerifyReport> prove_all(const TreeView& tree, MeshView mesh, const std::function<void(double)>& progress) {
    auto cleaned = clean(mesh, tree.bake_info().weld);
    if (!cleaned) return cleaned.error();
    const MeshView surface = cleaned->mesh.view();

    VerifyReport report;
    report.surface_mode = !cleaned->report.closed;
    if (tree.has_triangles()) {
        verify_exact(tree, surface, report);
        return report;
    }
    Box box;
    for (const Vec3& v : surface.vertices) box.add(to_vec(v));
    const double size = box.size().norm();
    const double rounding = kTolerance * std::max(box.low.cwiseAbs().maxCoeff(), box.high.cwiseAbs().maxCoeff()) +
                            cleaned->report.weld_distance;
    // Not the mesh's own box: halving that one would cut symmetric models in their planes of symmetry.
    box.low -= 0.0137 * Vec::Constant(size);
    box.high += 0.0171 * Vec::Constant(size);
    std::optional<ClosedSolid> solid;
    if (!report.surface_mode && !tree.bake_info().exact) solid.emplace(surface);

    const std::vector<Cell> cells = cut_space(surface, box);
    std::vector<Shape> all = shapes_of(tree, rounding);
    const std::optional<uint32_t> unbounded = find_unbounded(tree);
    report.bounded = !unbounded, report.unbounded_node = unbounded.value_or(0);
    report.covered = report.bounded;
    for (uint32_t l = 0; l < tree.level_count(); ++l) {
        std::vector<Shape> shapes;
        tree.for_each_in_cut(l, [&](uint32_t node) { shapes.push_back(all[node]); });
        const LevelProof proof = prove_level(shapes, cells, solid ? &*solid : nullptr, size,
                                             [&](double part) { progress((l + part) / tree.level_count()); });
        report.covered = report.covered && proof.covered;
        report.levels.push_back(proof);
        if (l == 0 && proof.covered) // the root holds everything: no need to ask it again
            for (Shape& shape : all)
                if (shape.parent == &all[0]) shape.parent = nullptr;
    }
    return report;
}

} // namespace

Result<VerifyReport> verify(const TreeView& tree, MeshView mesh, const VerifyOptions& options) {
    std::atomic<double> done = 0;
    std::function<bool()> go_on;
    if (options.progress) go_on = [&] { return options.progress(done); };
    Job job(options.threads, go_on);
    try {
        return job.run([&] {
            return prove_all(tree, mesh, [&](double fraction) {
                done = fraction;
                job.ask();
            });
        });
    } catch (const Cancelled&) {
        return Error{ErrorCode::cancelled, "cancelled", 0};
    }
}

} // namespace prolate
