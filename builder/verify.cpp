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
#include <prolate/build.hpp>
#include <prolate/verify.hpp>

#include "builder/fill.hpp"
#include "builder/job.hpp"
#include "builder/passages.hpp"
#include "builder/prover.hpp"
#include "builder/verify_bounding.hpp"
#include "builder/verify_exact.hpp"
#include "builder/verify_inner.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <numeric>
#include <optional>

namespace prolate {
namespace {

constexpr double kTolerance = 1e-12; // of the largest coordinate: corners must be inside by this much
constexpr int kTaskLevels = 3;       // 8^3 boxes to share between threads

std::vector<CoverNode> shapes_of(const TreeView& tree, double rounding) {
    std::vector<CoverNode> shapes(tree.slot_count());
    tree.for_each_node([&](uint32_t node) {
        CoverNode& shape = shapes[node];
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
std::vector<ProofCell> cut_space(MeshView mesh, const Box& box) {
    std::vector<ProofCell> cells(1);
    cells[0].box = box;
    for (const Triangle& t : mesh.triangles)
        cells[0].polygons.push_back(
            {to_vec(mesh.vertices[t[0]]), to_vec(mesh.vertices[t[1]]), to_vec(mesh.vertices[t[2]])});
    for (int level = 0; level < kTaskLevels; ++level) {
        std::vector<ProofCell> parts(8 * cells.size());
        parallel_for(size_t{0}, cells.size(), [&](size_t i) {
            std::array<ProofCell, 8> cut = Prover::cut(cells[i]);
            std::move(cut.begin(), cut.end(), parts.begin() + static_cast<std::ptrdiff_t>(8 * i));
            cells[i] = {};
        });
        cells.swap(parts);
    }
    return cells;
}

LevelProof prove_level(const std::vector<CoverNode>& shapes, const std::vector<ProofCell>& cells,
                       const ClosedSolid* solid, double size, const std::function<void(double)>& progress) {
    std::vector<uint32_t> everyone(shapes.size());
    std::iota(everyone.begin(), everyone.end(), 0u);
    std::vector<LevelProof> proofs(cells.size());
    std::atomic<size_t> done = 0;
    parallel_for(size_t{0}, cells.size(), [&](size_t i) {
        Prover prover(shapes, solid, size);
        prover.proof.covered = true;
        ProofCell cell = cells[i];
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

// Can the balls that the tree speaks of be told of this mesh?
bool suits(const BakeInfo& info, MeshView mesh) {
    Box box;
    for (const Vec3& v : mesh.vertices) box.add(to_vec(v));
    const BallRange range = ball_range(box.size().maxCoeff());
    for (const float radius : {info.fill, info.keep_holes})
        if (radius > 0 && !(double{radius} >= range.least && double{radius} <= range.most)) return false;
    return true;
}

// Does the ball of keep_holes pass the leaves?
void prove_holes(const TreeView& tree, MeshView surface, VerifyReport& report) {
    std::vector<Ellipsoid> leaves;
    tree.for_each_in_cut(tree.level_count() - 1, [&](uint32_t node) { leaves.push_back(tree.ellipsoid(node)); });
    const Passages passages(surface, double{tree.bake_info().keep_holes});
    const Passages::Nearest nearest = passages.nearest(leaves);
    report.holes_kept = nearest.distance >= passages.needed();
    std::copy_n(nearest.place.data(), 3, report.blocked);
    report.covered = report.covered && report.holes_kept;
}

Result<VerifyReport> prove_all(const TreeView& tree, MeshView mesh, const std::function<void(double)>& progress) {
    auto cleaned = clean(mesh, tree.bake_info().weld);
    if (!cleaned) return cleaned.error();
    MeshView surface = cleaned->mesh.view();
    const BakeInfo info = tree.bake_info();
    if (!suits(info, surface))
        return Error{ErrorCode::bad_mesh,
                     "the ball of the tree's fill or keep_holes is too small or too large for this mesh; "
                     "name the mesh that the tree was baked from",
                     0};
    Mesh filled;
    if (info.fill > 0) {
        filled = fill(surface, double{info.fill});
        surface = filled.view();
    }

    VerifyReport report;
    report.surface_mode = !cleaned->report.closed && info.fill == 0;
    if (const auto inner = tree.inner()) verify_inner(*inner, surface, cleaned->report.weld_distance, report);
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

    const std::vector<ProofCell> cells = cut_space(surface, box);
    std::vector<CoverNode> all = shapes_of(tree, rounding);
    const std::optional<uint32_t> unbounded = find_unbounded(tree);
    report.bounded = !unbounded, report.unbounded_node = unbounded.value_or(0);
    report.covered = report.bounded;
    for (uint32_t l = 0; l < tree.level_count(); ++l) {
        std::vector<CoverNode> shapes;
        tree.for_each_in_cut(l, [&](uint32_t node) { shapes.push_back(all[node]); });
        const LevelProof proof = prove_level(shapes, cells, solid ? &*solid : nullptr, size,
                                             [&](double part) { progress((l + part) / tree.level_count()); });
        report.covered = report.covered && proof.covered;
        report.levels.push_back(proof);
        if (l == 0 && proof.covered) // the root holds everything: no need to ask it again
            for (CoverNode& shape : all)
                if (shape.parent == &all[0]) shape.parent = nullptr;
    }
    if (info.keep_holes > 0 && !tree.is_prefix()) prove_holes(tree, surface, report);
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
            auto report = prove_all(tree, mesh, [&](double fraction) {
                done = fraction;
                job.ask();
            });
            if (report) report->covered = report->covered && report->inner_inside;
            return report;
        });
    } catch (const Cancelled&) {
        return Error{ErrorCode::cancelled, "cancelled", 0};
    }
}

} // namespace prolate
