// Points of hulls are corners of the triangles, chosen one by one: the farthest from the hull of the points so far. All
// in the coordinates in which the node's ellipsoid is the unit ball, where no direction is special. Then they are
// rounded, and what is left outside the rounded points' hull is measured: a corner's distance from it is at most that
// from any convex combination of the points, and Gilbert's algorithm finds good ones (E. G. Gilbert 1966, "An iterative
// procedure for computing the minimum of a quadratic form on a convex set").
//
// Complexity: O(n) an inner node of n corners, with a large constant (some thousand products a corner).
#include "builder/hulls.hpp"

#include "builder/fit.hpp"
#include "builder/job.hpp"

#include "src/bytes.hpp"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

namespace prolate {
namespace {

constexpr int kMostSteps = 200;
// More than rounding costs anywhere below, in unit-ball coordinates: in double, some 2^-53 times the axis ratio, which
// is at most 2^14.
constexpr double kRounding = 1e-9;

// An upper bound on the distance of w from the convex hull of the points, close to it if it is above `enough`.
double distance_from_hull(std::span<const Vec> points, const Vec& w, double enough) {
    Vec x = points[0];
    double nearest = (w - x).norm();
    for (int step = 0; step < kMostSteps && nearest > enough; ++step) {
        const Vec to = w - x;
        size_t farthest = 0;
        for (size_t i = 1; i < points.size(); ++i)
            if (to.dot(points[i]) > to.dot(points[farthest])) farthest = i;
        const Vec edge = points[farthest] - x;
        const double along = to.dot(edge);
        if (!(along > 1e-3 * to.squaredNorm())) break; // as near as it gets
        x += std::min(1.0, along / edge.squaredNorm()) * edge;
        nearest = std::min(nearest, (w - x).norm());
    }
    return nearest;
}

// Some of the points, whose hull the others are near.
std::vector<Vec> choose(const std::vector<Vec>& w) {
    std::vector<Vec> out;
    const auto farthest = [&](auto&& distance) {
        size_t best = 0;
        double most = -HUGE_VAL;
        for (size_t i = 0; i < w.size(); ++i)
            if (const double d = distance(i); d > most) most = d, best = i;
        return std::pair(best, most);
    };
    out.push_back(w[farthest([&](size_t i) { return w[i].squaredNorm(); }).first]);
    std::vector<double> distance(w.size(), HUGE_VAL); // from the hull so far, at most
    Checkpoints checkpoints;
    while (out.size() < kHullPoints) {
        double most = 0; // those that were nearer need not be looked at again
        const auto [next, gap] = farthest([&](size_t i) {
            checkpoints();
            if (distance[i] > most)
                distance[i] = distance_from_hull(out, w[i], most), most = std::max(most, distance[i]);
            return distance[i];
        });
        if (!(gap > 0)) break;
        out.push_back(w[next]);
    }
    return out;
}

// The corners below a node, each once.
std::vector<Vec> corners_below(const TreeView& tree, uint32_t node) {
    std::vector<uint32_t> vertices;
    const auto collect = [&](const auto& self, uint32_t at) -> void {
        const TriangleRange range = tree.triangles(at);
        for (uint32_t t = range.first; t < range.first + range.count; ++t)
            for (const uint32_t v : tree.triangle(t)) vertices.push_back(v);
        const ChildRange children = tree.children(at);
        for (uint32_t i = 0; i < children.count; ++i) self(self, children.first + i);
    };
    collect(collect, node);
    std::sort(vertices.begin(), vertices.end());
    vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
    std::vector<Vec> out;
    out.reserve(vertices.size());
    for (const uint32_t v : vertices) out.push_back(to_vec(tree.vertex(v)));
    return out;
}

void describe(const TreeView& tree, uint32_t node, std::byte* record) {
    const Fit fit(tree.ellipsoid(node));
    std::vector<Vec> w = corners_below(tree, node);
    for (Vec& x : w) x = fit.radial(x);
    const std::vector<Vec> chosen = choose(w);
    for (size_t i = 0; i < kHullPoints; ++i) // the last again where there are fewer
        for (size_t k = 0; k < 3; ++k) {
            const double x = chosen[std::min(i, chosen.size() - 1)][static_cast<int>(k)];
            const double q = std::clamp(std::round(x * kHullUnit), -kHullUnit, kHullUnit);
            store_le(record + kHullPoint + kHullPoints * k + i, static_cast<int8_t>(q));
        }
    const Hull hull(record);
    double most = hull.distance(Vec::Zero(), 0); // the center, too: FORMAT.md
    for (const Vec& x : w) most = std::max(most, hull.distance(x, most)), checkpoint();
    const double share = std::ceil((most + kRounding) * kHullShares);
    store_le(record + kHullShare, static_cast<uint8_t>(share <= kHullShares ? share : 0));
}

} // namespace

Hull::Hull(const std::byte* record) : share(load_le<uint8_t>(record + kHullShare) / kHullShares) {
    for (size_t i = 0; i < kHullPoints; ++i)
        for (size_t k = 0; k < 3; ++k)
            points[i][static_cast<int>(k)] = load_le<int8_t>(record + kHullPoint + kHullPoints * k + i) / kHullUnit;
}

double Hull::distance(const Vec& w, double enough) const {
    return distance_from_hull(points, w, enough);
}

std::vector<std::byte> hulls_of(const TreeView& tree) {
    std::vector<std::byte> out(size_t{tree.block_count()} * kHullBytes);
    parallel_for(uint32_t{0}, tree.slot_count(), [&](uint32_t node) {
        if (!tree.is_node(node)) return;
        const ChildRange children = tree.children(node);
        if (children.count > 0) describe(tree, node, out.data() + size_t{children.first / kBlockLanes} * kHullBytes);
    });
    return out;
}

} // namespace prolate
