// Exact trees, top-down over triangles.
//
// A node's triangles are split in two again and again, each time the part of the largest cost, until there are `degree`
// parts or all are small enough for a leaf. A split goes through the order of the boxes' centers along an axis, world
// or principal, where it makes the sum of costs least:
//
//     cost = n w^2,   w = mean width of the part in the 3 directions of the axes and the 6 of their face diagonals
//
// The chance that another body meets a convex one grows with its surface (the surface area heuristic, Goldsmith and
// Salmon 1987), and a nearly round body's surface with its mean width squared; running widths cost nothing. Pair tests
// of near-contact queries, mean of horse-horse / homer-homer / bunny-horse / knight-knight: 356 / 313 / 393 / 197,
// against 387 / 386 / 452 / 290 with w^2 = sqrt(sum of the 2x2 minors of the covariance), 382 / 327 / 420 / 226 with
// the surface of the box; other sets of directions and powers of n were no better.
//
// Each node gets a minimum-volume ellipsoid around the corners of its triangles: fitted to their farthest points in the
// sketch directions (merged from the children's), then refitted with what sticks out.
//
// Complexity: O(n log n) time, O(n) memory. Sorted projections below kSortedBelow triangles, bins above.
#include "builder/exact.hpp"

#include "builder/cover.hpp"
#include "builder/fit.hpp"

#include "src/symmetric3.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <limits>
#include <mutex>
#include <numbers>
#include <numeric>
#include <span>

namespace prolate {
namespace {

constexpr uint32_t kSortedBelow = 2048; // triangles of a part; above, bins find the split
constexpr uint32_t kBins = 256;
constexpr uint32_t kParallelAbove = 512; // triangles of a node whose children are worth tasks of their own
constexpr int kRounds = 6;               // of refitting a node
constexpr double kOutside = 1 + 2e-3;    // squared radial coordinate from which a point calls for a refit

// Extents of points along the axes and face diagonals.
struct Extents {
    static constexpr size_t kDirections = 9;
    std::array<float, kDirections> low, high;

    Extents() { low.fill(HUGE_VALF), high.fill(-HUGE_VALF); }
    void add(const Vec3& p) {
        const float heights[] = {p.x, p.y, p.z, p.x + p.y, p.x - p.y, p.y + p.z, p.y - p.z, p.z + p.x, p.z - p.x};
        for (size_t d = 0; d < kDirections; ++d)
            low[d] = std::min(low[d], heights[d]), high[d] = std::max(high[d], heights[d]);
    }
    void add(const Extents& e) {
        for (size_t d = 0; d < kDirections; ++d)
            low[d] = std::min(low[d], e.low[d]), high[d] = std::max(high[d], e.high[d]);
    }
    Vec center() const { return {0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), 0.5 * (low[2] + high[2])}; }
    double cost(uint32_t triangles) const {
        double straight = 0, diagonal = 0;
        for (size_t d = 0; d < kDirections; ++d) (d < 3 ? straight : diagonal) += double{high[d]} - low[d];
        const double width = straight + std::numbers::sqrt2 / 2 * diagonal;
        return triangles * width * width;
    }
};

struct Part {
    uint32_t begin, end; // of Grower::order_
    double cost;
    uint32_t size() const { return end - begin; }
};

struct Node {
    uint32_t begin = 0, end = 0;
    std::vector<Node> children;
    format::PackedNode packed;
};

// Where to cut a part in the order along an axis.
struct Cut {
    double cost = HUGE_VAL; // of both sides together
    uint32_t left = 0;      // triangles on the lower side; 0: no cut found
};

using Key = std::pair<double, uint32_t>; // height of a triangle and its index: a total order

class Grower {
public:
    Grower(MeshView mesh, const ExactOptions& options)
        : mesh_(mesh), options_(options), count_(static_cast<uint32_t>(mesh.triangles.size())) {
        Box box;
        for (const Vec3& v : mesh.vertices) box.add(to_vec(v));
        lattice_ = format::lattice_for(box.low.data(), box.high.data());
        extents_.resize(count_);
        order_.resize(count_);
        std::iota(order_.begin(), order_.end(), 0u);
        tbb::parallel_for(0u, count_, [&](uint32_t t) {
            for (const uint32_t v : mesh_.triangles[t]) extents_[t].add(mesh_.vertices[v]);
        });
    }

    Result<ExactTree> run() {
        Node root{0, count_, {}, {}};
        Sketch sketch;
        grow(root, kMaxLevels - 1, sketch);
        if (cancelled_) return Error{ErrorCode::cancelled, "cancelled", 0};
        if (too_large_)
            return Error{ErrorCode::bad_mesh,
                         "the mesh is too large or too small for the file format; scale it to metres", 0};
        return assemble(root);
    }

private:
    // ---- splitting ----

    std::vector<Key> keys(const Part& p, const Vec& axis) const {
        std::vector<Key> out(p.size());
        for (uint32_t i = 0; i < p.size(); ++i) {
            const uint32_t triangle = order_[p.begin + i];
            out[i] = {axis.dot(extents_[triangle].center()), triangle};
        }
        return out;
    }
    Part part(uint32_t begin, uint32_t end) const {
        Extents all;
        for (uint32_t i = begin; i < end; ++i) all.add(extents_[order_[i]]);
        return {begin, end, all.cost(end - begin)};
    }

    // The best cut between consecutive groups of triangles.
    struct Group {
        Extents extents;
        uint32_t triangles = 0;
    };
    static Cut best_cut(std::span<const Group> groups) {
        std::vector<double> right(groups.size()); // cost of this group and all later ones
        Group side;
        const auto take = [&side](const Group& group) {
            side.extents.add(group.extents);
            side.triangles += group.triangles;
        };
        for (size_t g = groups.size(); g-- > 0;) {
            take(groups[g]);
            right[g] = side.extents.cost(side.triangles);
        }
        Cut best;
        side = {};
        for (size_t g = 0; g + 1 < groups.size(); ++g) {
            take(groups[g]);
            const double cost = side.extents.cost(side.triangles) + right[g + 1];
            if (cost < best.cost) best = {cost, side.triangles};
        }
        return best;
    }
    Cut cut_sorted(const Part& p, const Vec& axis) const {
        std::vector<Key> sorted = keys(p, axis);
        std::sort(sorted.begin(), sorted.end());
        std::vector<Group> groups(p.size());
        for (uint32_t i = 0; i < p.size(); ++i) groups[i] = {extents_[sorted[i].second], 1};
        return best_cut(groups);
    }
    // The same, but only between bins of equal width.
    Cut cut_binned(const Part& p, const Vec& axis) const {
        const std::vector<Key> all = keys(p, axis);
        const auto [low, high] = std::minmax_element(all.begin(), all.end());
        const double scale = kBins / (high->first - low->first);
        if (!std::isfinite(scale)) return {};
        std::vector<Group> bins(kBins);
        for (const auto& [h, triangle] : all) {
            Group& bin = bins[std::min(static_cast<uint32_t>((h - low->first) * scale), kBins - 1)];
            bin.extents.add(extents_[triangle]);
            ++bin.triangles;
        }
        std::erase_if(bins, [](const Group& bin) { return bin.triangles == 0; });
        return best_cut(bins);
    }

    // The principal axes of the boxes' centers, longest first.
    std::array<Vec, 3> principal_axes(const Part& p) const {
        Vec mean = Vec::Zero();
        for (uint32_t i = p.begin; i < p.end; ++i) mean += extents_[order_[i]].center();
        mean /= p.size();
        Matrix3 covariance{};
        for (uint32_t i = p.begin; i < p.end; ++i) {
            const Vec d = extents_[order_[i]].center() - mean;
            for (int r = 0; r < 3; ++r)
                for (int c = 0; c < 3; ++c) covariance[size_t(r)][size_t(c)] += d[r] * d[c];
        }
        const Matrix3 axes = eigen_symmetric(covariance).vectors; // columns
        return {Vec(axes[0][0], axes[1][0], axes[2][0]), Vec(axes[0][1], axes[1][1], axes[2][1]),
                Vec(axes[0][2], axes[1][2], axes[2][2])};
    }

    // Cuts a part in two where it pays most, or into halves across its longest axis.
    std::pair<Part, Part> cut(const Part& p, bool halves) {
        const auto [first, second, third] = principal_axes(p);
        const std::array<Vec, 6> axes{first, second, third, Vec::UnitX(), Vec::UnitY(), Vec::UnitZ()};
        std::array<Cut, 6> cuts; // the default: none
        const auto try_axis = [&](size_t a) {
            cuts[a] = p.size() > kSortedBelow ? cut_binned(p, axes[a]) : cut_sorted(p, axes[a]);
        };
        if (!halves) {
            if (p.size() > kSortedBelow)
                tbb::parallel_for(size_t{0}, cuts.size(), try_axis);
            else
                for (size_t a = 0; a < cuts.size(); ++a) try_axis(a);
        }
        const auto cheaper = [](const Cut& x, const Cut& y) { return x.cost < y.cost; };
        const auto best = std::min_element(cuts.begin(), cuts.end(), cheaper); // the first of equals
        const Vec axis = axes[static_cast<size_t>(best - cuts.begin())];
        const uint32_t left = best->left > 0 ? best->left : p.size() / 2;

        std::vector<Key> all = keys(p, axis);
        const auto middle = all.begin() + left;
        std::nth_element(all.begin(), middle, all.end());
        const Key first_right = *middle;
        // Both sides keep their order, whatever order nth_element left.
        std::stable_partition(order_.begin() + p.begin, order_.begin() + p.end, [&](uint32_t triangle) {
            return Key(axis.dot(extents_[triangle].center()), triangle) < first_right;
        });
        return {part(p.begin, p.begin + left), part(p.begin + left, p.end)};
    }

    // Triangles that fit below a node with so many levels beneath it, if parts are halved only.
    uint64_t capacity(uint32_t levels) const {
        const uint32_t doublings = levels * static_cast<uint32_t>(std::bit_width(options_.degree) - 1);
        return doublings >= 32 ? UINT64_MAX : uint64_t{options_.leaf_triangles} << doublings;
    }

    std::vector<Part> divide(const Part& whole, uint32_t levels, bool halves) {
        std::vector<Part> parts{whole};
        while (parts.size() < options_.degree) {
            size_t chosen = parts.size();
            for (size_t i = 0; i < parts.size(); ++i) {
                if (parts[i].size() <= options_.leaf_triangles) continue;
                if (chosen == parts.size() ||
                    (halves ? parts[i].size() > parts[chosen].size() : parts[i].cost > parts[chosen].cost))
                    chosen = i;
            }
            if (chosen == parts.size()) break;
            const auto [left, right] = cut(parts[chosen], halves);
            parts[chosen] = left;
            parts.insert(parts.begin() + static_cast<ptrdiff_t>(chosen) + 1, right);
        }
        const auto too_deep = [&](const Part& p) { return p.size() > capacity(levels - 1); };
        if (!halves && std::any_of(parts.begin(), parts.end(), too_deep)) return divide(whole, levels, true);
        return parts;
    }

    // ---- nodes ----

    template <class Visit> void for_each_corner(const Node& node, Visit&& visit) const {
        for (uint32_t i = node.begin; i < node.end; ++i)
            for (const uint32_t v : mesh_.triangles[order_[i]]) visit(to_vec(mesh_.vertices[v]));
    }

    // Makes all below `node`, which may have `levels` levels beneath it, and `sketch` that of its corners.
    void grow(Node& node, uint32_t levels, Sketch& sketch) {
        if (cancelled_) return;
        const uint32_t size = node.end - node.begin;
        if (size <= options_.leaf_triangles) {
            node.packed.triangle_count = static_cast<uint8_t>(size);
            std::vector<Vec> corners;
            for_each_corner(node, [&](const Vec& p) { corners.push_back(p); });
            sketch.add(corners);
            report(size);
        } else {
            for (const Part& p : divide(part(node.begin, node.end), levels, false))
                node.children.push_back({p.begin, p.end, {}, {}});
            node.packed.child_count = static_cast<uint8_t>(node.children.size());
            std::vector<Sketch> sketches(node.children.size());
            const auto grow_child = [&](size_t c) { grow(node.children[c], levels - 1, sketches[c]); };
            if (size > kParallelAbove)
                tbb::parallel_for(size_t{0}, sketches.size(), grow_child);
            else
                for (size_t c = 0; c < sketches.size(); ++c) grow_child(c);
            if (cancelled_) return;
            for (const Sketch& s : sketches) sketch.add(s);
        }
        cover(node, sketch);
    }

    // The node's ellipsoid.
    void cover(Node& node, const Sketch& sketch) {
        std::vector<Vec> core(sketch.points().begin(), sketch.points().end());
        Fit fit;
        for (int round = 0; round < kRounds; ++round) {
            fit = enclosing_ellipsoid(core, options_.min_radius);
            // In each octant of the unit ball, the point that sticks out most joins the core.
            std::array<Vec, 8> worst;
            std::array<double, 8> reach;
            reach.fill(kOutside);
            for_each_corner(node, [&](const Vec& p) {
                const Vec y = fit.inverse * (p - fit.center);
                const size_t octant = (y.x() > 0) | (y.y() > 0) << 1 | (y.z() > 0) << 2;
                if (const double r = y.squaredNorm(); r > reach[octant]) reach[octant] = r, worst[octant] = p;
            });
            const size_t before = core.size();
            for (size_t i = 0; i < worst.size(); ++i)
                if (reach[i] > kOutside) core.push_back(worst[i]);
            if (core.size() == before) break;
        }
        const auto reach = [&](const Fit& decoded) {
            double largest = 0;
            for_each_corner(node, [&](const Vec& p) { largest = std::max(largest, decoded.radial_squared(p)); });
            return std::sqrt(largest);
        };
        const auto packed = covering_node(fit, lattice_, reach);
        if (!packed) {
            too_large_ = true;
            return;
        }
        const auto [children, triangles] = std::pair(node.packed.child_count, node.packed.triangle_count);
        node.packed = *packed;
        node.packed.child_count = children, node.packed.triangle_count = triangles;
        Box box;
        for_each_corner(node, [&](const Vec& p) { box.add(p); });
        for (int i = 0; i < 3; ++i) node.packed.box_low[i] = box.low[i], node.packed.box_high[i] = box.high[i];
    }

    void report(uint32_t triangles) {
        const uint32_t before = done_.fetch_add(triangles), step = count_ / 128 + 1;
        if (!options_.progress || before / step == (before + triangles) / step) return;
        const std::lock_guard lock(reporting_);
        if (!options_.progress(static_cast<double>(before + triangles) / count_)) cancelled_ = true;
    }

    // ---- the file's order ----

    ExactTree assemble(const Node& root) const {
        ExactTree out;
        out.lattice = lattice_;
        for (std::vector<const Node*> level{&root}; !level.empty();) {
            std::vector<const Node*> next;
            out.levels.emplace_back();
            for (const Node* node : level) {
                out.levels.back().nodes.push_back(node->packed);
                for (const Node& child : node->children) next.push_back(&child);
                for (uint32_t i = node->begin; node->children.empty() && i < node->end; ++i)
                    out.triangles.push_back(mesh_.triangles[order_[i]]);
            }
            level.swap(next);
        }
        number_vertices(out);
        return out;
    }

    // Renumbers the vertices: the first of each connected component in front, the others as they are first used.
    void number_vertices(ExactTree& out) const {
        constexpr uint32_t kNone = std::numeric_limits<uint32_t>::max();
        std::vector<uint32_t> parent(mesh_.vertices.size());
        std::iota(parent.begin(), parent.end(), 0u);
        const auto root_of = [&](uint32_t v) {
            while (parent[v] != v) v = parent[v] = parent[parent[v]];
            return v;
        };
        for (const Triangle& t : out.triangles) parent[root_of(t[1])] = parent[root_of(t[2])] = root_of(t[0]);

        std::vector<uint32_t> number(mesh_.vertices.size(), kNone);
        std::vector<bool> seen(mesh_.vertices.size());
        const auto take = [&](uint32_t v) {
            number[v] = static_cast<uint32_t>(out.vertices.size());
            out.vertices.push_back(mesh_.vertices[v]);
        };
        for (const Triangle& t : out.triangles)
            if (const uint32_t component = root_of(t[0]); !seen[component]) seen[component] = true, take(t[0]);
        out.components = static_cast<uint32_t>(out.vertices.size());
        for (Triangle& t : out.triangles)
            for (uint32_t& corner : t) {
                if (number[corner] == kNone) take(corner);
                corner = number[corner];
            }
    }

    const MeshView mesh_;
    const ExactOptions& options_;
    const uint32_t count_;
    format::Lattice lattice_;
    std::vector<Extents> extents_; // of each triangle
    std::vector<uint32_t> order_;  // triangles; a node's are consecutive

    std::atomic<bool> cancelled_ = false, too_large_ = false;
    std::atomic<uint32_t> done_ = 0;
    std::mutex reporting_;
};

} // namespace

Result<ExactTree> grow_exact(MeshView mesh, const ExactOptions& options) {
    return Grower(mesh, options).run();
}

} // namespace prolate
