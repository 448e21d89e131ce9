// Exact trees are proved triangle by triangle: an ellipsoid is convex, so one that holds a triangle's corners holds the
// triangle.
//
// Rounding: corners and nodes are floats, taken as exact. Forward substitution of L y = p - c is backward stable, so
// the computed y is wrong by less than 8 * 2^-53 |L| |L^-1| |y| (Higham, Accuracy and Stability, section 8.1);
// kGrowthRounding asks for more than that below 1. A corner lies in a hull, a share of the ellipsoid added, if a convex
// combination of the hull's points is that near (hulls.hpp); its rounding is less than kHullRounding.
#include "builder/verify_exact.hpp"

#include "builder/fit.hpp"
#include "builder/hulls.hpp"
#include "builder/job.hpp"

#include "src/slab.hpp"

#include <tbb/parallel_sort.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <tuple>
#include <vector>

namespace prolate {
namespace {

constexpr double kGrowthRounding = 0x1p-48, kHullRounding = 1e-10;

// Corners of a triangle from the least one on, in the triangle's order: the same for the same oriented triangle.
using Corners = std::array<std::tuple<float, float, float>, 3>;

template <class Position> std::vector<Corners> sorted_corners(uint32_t count, Position&& position) {
    std::vector<Corners> out(count);
    Checkpoints checkpoints;
    for (uint32_t t = 0; t < count; ++t) {
        checkpoints();
        for (size_t i = 0; i < 3; ++i) {
            const Vec3 p = position(t, i);
            out[t][i] = {p.x, p.y, p.z};
        }
        std::rotate(out[t].begin(), std::min_element(out[t].begin(), out[t].end()), out[t].end());
    }
    tbb::parallel_sort(out.begin(), out.end());
    return out;
}

// A point that nobody vouches for, of the surface.
struct Doubt {
    bool any = false;
    double point[3] = {};
    void set(double x, double y, double z) {
        if (!any) point[0] = x, point[1] = y, point[2] = z;
        any = true;
    }
};

// Looks for a triangle that only one of the two has.
Doubt compare(const TreeView& tree, MeshView mesh) {
    const auto ours =
        sorted_corners(tree.triangle_count(), [&](uint32_t t, size_t i) { return tree.vertex(tree.triangle(t)[i]); });
    const auto theirs = sorted_corners(static_cast<uint32_t>(mesh.triangles.size()),
                                       [&](uint32_t t, size_t i) { return mesh.vertices[mesh.triangles[t][i]]; });
    Doubt out;
    const auto [mine, other] = std::mismatch(ours.begin(), ours.end(), theirs.begin(), theirs.end());
    if (mine == ours.end() && other == theirs.end()) return out;
    const bool missing = mine == ours.end() || (other != theirs.end() && *other < *mine);
    const auto [x, y, z] = (missing ? *other : *mine)[0];
    out.set(x, y, z);
    return out;
}

// Both heights are rounded outwards.
bool in_slab(const Slab& slab, const Vec& x) {
    const double height = slab.height(x.data());
    const double rounding = kSlabRounding * (x.lpNorm<1>() + Vec(slab.origin).lpNorm<1>());
    return height - rounding >= slab.low && height + rounding <= slab.high;
}

bool in_hull(Hull& hull, const Vec& w) {
    const double enough = hull.share - kHullRounding;
    return hull.distance(w, enough) <= enough;
}

// For each vertex, the leaves of the triangles that it belongs to.
class LeavesOfVertices {
public:
    explicit LeavesOfVertices(const TreeView& tree) : first_(size_t{tree.vertex_count()} + 2) {
        const auto for_each_corner = [&](auto&& visit) {
            tree.for_each_node([&](uint32_t leaf) {
                checkpoint();
                const TriangleRange range = tree.triangles(leaf);
                for (uint32_t t = range.first; t < range.first + range.count; ++t)
                    for (const uint32_t v : tree.triangle(t)) visit(v, leaf);
            });
        };
        for_each_corner([&](uint32_t v, uint32_t) { ++first_[v + 2]; });
        for (size_t v = 2; v < first_.size(); ++v) first_[v] += first_[v - 1];
        leaves_.resize(first_.back());
        for_each_corner([&](uint32_t v, uint32_t leaf) { leaves_[first_[v + 1]++] = leaf; });
    }
    std::span<const uint32_t> of(uint32_t v) const {
        return std::span(leaves_).subspan(first_[v], first_[v + 1] - first_[v]);
    }

private:
    std::vector<size_t> first_;
    std::vector<uint32_t> leaves_;
};

// What an inner node has beside its ellipsoid.
struct Tighter {
    std::optional<Hull> hull; // none if it says nothing
    std::optional<Slab> slab;
};

// For each node, a corner beneath it that it, its hull or its slab does not hold.
std::vector<Doubt> find_doubts(const TreeView& tree) {
    const uint32_t slots = tree.slot_count();
    std::vector<uint32_t> parent(slots, 0);
    std::vector<Ellipsoid> ellipsoids(slots);
    std::vector<double> largest(slots); // squared radial coordinate within, beyond doubt
    std::vector<Fit> fits(slots);
    std::vector<Doubt> doubts(slots);
    std::vector<uint32_t> tighter_at(slots, UINT32_MAX);
    std::vector<Tighter> tighter;
    tighter.reserve(tree.block_count()); // no two inner nodes share one
    tree.for_each_node([&](uint32_t n) {
        const ChildRange children = tree.children(n);
        for (uint32_t i = 0; i < children.count; ++i) parent[children.first + i] = n;
        ellipsoids[n] = tree.ellipsoid(n);
        fits[n] = Fit(ellipsoids[n]);
        largest[n] = 1 - kGrowthRounding * fits[n].factor.norm() * fits[n].inverse.norm();
        if (children.count == 0) return;
        const std::byte* const record = tree.raw().hull(children.first / kBlockLanes);
        tighter_at[n] = static_cast<uint32_t>(tighter.size());
        auto& [hull, slab] = tighter.emplace_back();
        if (has_slab(record)) slab = slab_of(tree, record);
        hull.emplace(record);
        if (hull->share == 0) hull.reset();
        if (const Vec3 c = ellipsoids[n].center; hull && !in_hull(*hull, Vec::Zero())) doubts[n].set(c.x, c.y, c.z);
    });
    const LeavesOfVertices leaves(tree);
    std::vector<uint32_t> looked_at(slots, UINT32_MAX); // the vertex that a node has last been asked for
    Checkpoints checkpoints;
    for (uint32_t v = 0; v < tree.vertex_count(); ++v) {
        checkpoints();
        const Vec3 at = tree.vertex(v);
        const double p[3] = {at.x, at.y, at.z};
        for (const uint32_t leaf : leaves.of(v))
            for (uint32_t node = leaf; looked_at[node] != v; node = parent[node]) { // the root is its own parent
                looked_at[node] = v;
                bool held = radial_squared(ellipsoids[node], p) <= largest[node];
                if (tighter_at[node] != UINT32_MAX) {
                    auto& [hull, slab] = tighter[tighter_at[node]];
                    held = held && (!hull || in_hull(*hull, fits[node].radial(to_vec(at)))) &&
                           (!slab || in_slab(*slab, to_vec(at)));
                }
                if (!held) doubts[node].set(p[0], p[1], p[2]);
            }
    }
    return doubts;
}

} // namespace

void verify_exact(const TreeView& tree, MeshView mesh, VerifyReport& report) {
    const Doubt other_mesh = compare(tree, mesh);
    const std::vector<Doubt> doubts = find_doubts(tree);
    report.exact = true;
    report.same_mesh = !other_mesh.any;
    report.covered = true;
    for (uint32_t l = 0; l < tree.level_count(); ++l) {
        LevelProof& proof = report.levels.emplace_back();
        proof.pieces = tree.triangle_count();
        Doubt doubt = other_mesh;
        tree.for_each_in_cut(l, [&](uint32_t node) {
            if (const Doubt& d = doubts[node]; d.any) doubt.set(d.point[0], d.point[1], d.point[2]);
        });
        proof.covered = !doubt.any;
        if (proof.covered) continue;
        report.covered = false;
        std::copy_n(doubt.point, 3, proof.point);
        double nearest = HUGE_VAL; // another node may hold the point, though not its triangle
        tree.for_each_in_cut(
            l, [&](uint32_t node) { nearest = std::min(nearest, radial_squared(tree.ellipsoid(node), doubt.point)); });
        proof.has_counterexample = nearest > 1;
        proof.depth = proof.has_counterexample ? std::sqrt(nearest) - 1 : 0;
    }
}

} // namespace prolate
