// Exact trees: a binary tree over the triangles, then the best wide one that can be cut out of it.
//
// The binary tree goes down to single triangles. A part is split in two through the order of the boxes' centers along
// an axis, world or principal, where it makes the sum of costs least:
//
//     cost = n w^2,   w = mean width of the part in the 3 directions of the axes and the 6 of their face diagonals
//
// The chance that another body meets a convex one grows with its surface (the surface area heuristic, Goldsmith and
// Salmon 1987), and a nearly round body's surface with its mean width squared; running widths cost nothing.
//
// Which binary nodes become nodes of the tree is then chosen at once for the whole tree, by dynamic programming
// (Ylitie, Karras and Laine 2017, section 3.1): the sum of w^2 over the inner nodes, each of which costs a query one
// test of a block of children, plus (kLeafCost + n kTriangleCost) w^2 over the leaves. So lanes of a block stay empty,
// and leaves hold several triangles, only where that costs less than another block.
//
// Instructions of a query near contact, horse-horse / homer-homer / knight-knight / bunny-bunny: 25.0 / 31.4 / 31.5 /
// 30.1 thousand; with parts opened by largest cost until a node is full or they fit leaves of 4, it was 25.6 / 34.2 /
// 32.7 / 30.9, and the horse's file 7 % larger. Other measures for w^2 made it no better: surface of the box, other
// powers and directions, covariances, and the surface of ellipsoids fitted to each candidate (2 % better for three
// times the time); nor does moving subtrees within the binary tree (3 %).
//
// Each node gets a minimum-volume ellipsoid around the corners of its triangles: fitted to their farthest points in the
// sketch directions (merged from the children's), then refitted with what sticks out.
//
// Complexity: O(n log n) time, O(n) memory for a fixed degree. Sorted projections below kSortedBelow triangles, bins
// above. At most 2^31 triangles: the binary tree has no more levels than the file may have.
#include "builder/exact.hpp"

#include "builder/cover.hpp"
#include "builder/fit.hpp"
#include "builder/job.hpp"

#include "src/symmetric3.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <span>

namespace prolate {
namespace {

constexpr uint32_t kSortedBelow = 2048; // triangles of a part; above, bins find the split
constexpr uint32_t kBins = 256;
constexpr uint32_t kParallelAbove = 512; // triangles of a node whose children are worth tasks of their own
// Of a query at a leaf, and for each of its triangles; in tests of a block of children. Pairs of triangles are tested
// eight at a time, so that a leaf of several costs little more than one of a single triangle.
constexpr double kLeafCost = 0.7, kTriangleCost = 0.3;
constexpr int kRounds = 6;            // of refitting a node
constexpr double kOutside = 1 + 2e-3; // squared radial coordinate from which a point calls for a refit

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
    double squared_width() const {
        double straight = 0, diagonal = 0;
        for (size_t d = 0; d < kDirections; ++d) (d < 3 ? straight : diagonal) += double{high[d]} - low[d];
        const double width = straight + std::numbers::sqrt2 / 2 * diagonal;
        return width * width;
    }
};

struct Part {
    uint32_t begin, end; // of Grower::order_
    uint32_t size() const { return end - begin; }
};

// Of the binary tree, depth first: the left child is the next, the right child comes after the 2 left - 1 nodes below
// and with the left one. So subtrees can be made in parallel, and children come after their parents.
struct Halves {
    Part part;
    uint32_t left = 0;        // triangles in the left child; 0 for a single triangle
    double squared_width = 0; // in terms of Extents
    // If it becomes an inner node, the lanes that its children take, and how many of them stem from the left child.
    // No lanes: it becomes a leaf.
    uint8_t lanes = 0, left_lanes = 0;
    size_t choices = 0; // first of its Choices
};

// The best way to make siblings of a binary node's triangles, in at most as many lanes as the choice's place, from 1.
struct Choice {
    double cost = HUGE_VAL;
    uint8_t left_lanes = 0; // for what is left of the cut; 0: best in one lane less
};

struct Node {
    uint32_t binary = 0; // index of its Halves
    std::vector<Node> children;
    format::PackedNode packed;
};

// Where to cut a part in the order along an axis.
struct Cut {
    double cost = HUGE_VAL; // of both sides together
    uint32_t left = 0;      // triangles on the lower side; 0: no cut found
};

using Key = std::pair<double, uint32_t>; // height of a triangle and its index: a total order

// A sketch of few points names each of them many times, and fitting takes time for each.
std::vector<Vec> without_repeats(std::span<const Vec> points) {
    std::vector<Vec> out(points.begin(), points.end());
    const auto less = [](const Vec& p, const Vec& q) {
        return std::lexicographical_compare(p.begin(), p.end(), q.begin(), q.end());
    };
    std::sort(out.begin(), out.end(), less);
    out.erase(std::unique(out.begin(), out.end()), out.end());
    return out;
}

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
        parallel_for(0u, count_, [&](uint32_t t) {
            for (const uint32_t v : mesh_.triangles[t]) extents_[t].add(mesh_.vertices[v]);
        });
    }

    Result<ExactTree> run() {
        binary_.resize(2 * size_t{count_} - 1);
        split(0, {0, count_}, kMaxLevels - 1);
        Node root;
        Sketch sketch;
        choose();
        grow(root, sketch);
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
            right[g] = side.triangles * side.extents.squared_width();
        }
        Cut best;
        side = {};
        for (size_t g = 0; g + 1 < groups.size(); ++g) {
            take(groups[g]);
            const double cost = side.triangles * side.extents.squared_width() + right[g + 1];
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

    // Cuts a part, of 2 triangles or more, in two where it pays most, but leaves neither side with more than `most`
    // triangles: else in halves across its longest axis. Orders the triangles accordingly; returns how many are left.
    uint32_t cut(const Part& p, uint64_t most) {
        if (p.size() == 2) return 1;
        const auto [first, second, third] = principal_axes(p);
        const std::array<Vec, 6> axes{first, second, third, Vec::UnitX(), Vec::UnitY(), Vec::UnitZ()};
        std::array<Cut, 6> cuts;
        const auto try_axis = [&](size_t a) {
            cuts[a] = p.size() > kSortedBelow ? cut_binned(p, axes[a]) : cut_sorted(p, axes[a]);
        };
        if (p.size() > kSortedBelow)
            parallel_for(size_t{0}, cuts.size(), try_axis);
        else
            for (size_t a = 0; a < cuts.size(); ++a) try_axis(a);
        const auto cheaper = [](const Cut& x, const Cut& y) { return x.cost < y.cost; };
        const auto cheapest = std::min_element(cuts.begin(), cuts.end(), cheaper); // the first of equals
        Vec axis = axes[static_cast<size_t>(cheapest - cuts.begin())];
        uint32_t left = cheapest->left;
        if (left == 0 || std::max(left, p.size() - left) > most) axis = first, left = p.size() / 2;

        std::vector<Key> all = keys(p, axis);
        const auto middle = all.begin() + left;
        std::nth_element(all.begin(), middle, all.end());
        const Key first_right = *middle;
        // Both sides keep their order, whatever order nth_element left.
        std::stable_partition(order_.begin() + p.begin, order_.begin() + p.end, [&](uint32_t triangle) {
            return Key(axis.dot(extents_[triangle].center()), triangle) < first_right;
        });
        return left;
    }

    // Makes binary_[index] of the part and all below it, in at most so many levels; returns the part's extents.
    Extents split(uint32_t index, const Part& p, uint32_t levels) {
        Halves& node = binary_[index];
        node.part = p;
        checkpoint();
        Extents all;
        if (p.size() == 1) {
            all = extents_[order_[p.begin]];
            report(1);
        } else {
            node.left = cut(p, uint64_t{1} << (levels - 1));
            const uint32_t middle = p.begin + node.left;
            Extents right;
            const auto make_left = [&] { all = split(left_of(index), {p.begin, middle}, levels - 1); };
            const auto make_right = [&] { right = split(right_of(index), {middle, p.end}, levels - 1); };
            if (p.size() > kParallelAbove)
                parallel_invoke(make_left, make_right);
            else
                make_left(), make_right();
            all.add(right);
        }
        node.squared_width = all.squared_width();
        return all;
    }
    static uint32_t left_of(uint32_t index) { return index + 1; }
    uint32_t right_of(uint32_t index) const { return index + 2 * binary_[index].left; }

    // ---- from the binary tree to the wide one ----

    uint32_t most_lanes(uint32_t index) const { return std::min(options_.degree, binary_[index].part.size()); }

    // Finds out for each binary node what would become of it, children first.
    void choose() {
        size_t total = 0;
        for (uint32_t i = 0; i < binary_.size(); ++i) {
            binary_[i].choices = total;
            total += most_lanes(i);
        }
        choices_.resize(total);
        for (auto i = static_cast<uint32_t>(binary_.size()); i-- > 0;) {
            Halves& node = binary_[i];
            Choice* const choices = &choices_[node.choices];
            const uint32_t size = node.part.size();
            if (size <= options_.leaf_triangles)
                choices[0].cost = (kLeafCost + kTriangleCost * size) * node.squared_width;
            if (size == 1) continue;

            const uint32_t lanes = most_lanes(i), left_most = most_lanes(left_of(i)),
                           right_most = most_lanes(right_of(i));
            const Choice* const left = &choices_[binary_[left_of(i)].choices];
            const Choice* const right = &choices_[binary_[right_of(i)].choices];
            Choice best;
            for (uint32_t l = 1; l <= left_most; ++l)
                for (uint32_t r = 1; r <= right_most && l + r <= lanes; ++r) {
                    const Choice both{left[l - 1].cost + right[r - 1].cost, static_cast<uint8_t>(l)};
                    if (both.cost < choices[l + r - 1].cost) choices[l + r - 1] = both;
                    if (both.cost < best.cost) best = both, node.lanes = static_cast<uint8_t>(l + r);
                }
            node.left_lanes = best.left_lanes;
            if (const double open = node.squared_width + best.cost; open < choices[0].cost)
                choices[0].cost = open;
            else
                node.lanes = 0;
            for (uint32_t n = 1; n < lanes; ++n)
                if (!(choices[n].cost < choices[n - 1].cost)) choices[n] = {choices[n - 1].cost, 0};
        }
    }
    // Adds the siblings that stand for a binary node in at most `lanes` lanes.
    void add_siblings(std::vector<Node>& siblings, uint32_t index, uint32_t lanes) const {
        const Choice* const choices = &choices_[binary_[index].choices];
        while (lanes > 1 && choices[lanes - 1].left_lanes == 0) --lanes;
        if (lanes == 1) {
            siblings.push_back({index, {}, {}});
            return;
        }
        const uint32_t left = choices[lanes - 1].left_lanes;
        add_siblings(siblings, left_of(index), left);
        add_siblings(siblings, right_of(index), lanes - left);
    }

    // ---- nodes ----

    template <class Visit> void for_each_corner(const Node& node, Visit&& visit) const {
        const Part& part = binary_[node.binary].part;
        for (uint32_t i = part.begin; i < part.end; ++i)
            for (const uint32_t v : mesh_.triangles[order_[i]]) visit(to_vec(mesh_.vertices[v]));
    }

    // Makes all below `node`, and `sketch` that of its corners.
    void grow(Node& node, Sketch& sketch) {
        checkpoint();
        const Halves& halves = binary_[node.binary];
        const uint32_t size = halves.part.size();
        if (halves.lanes == 0) {
            node.packed.triangle_count = static_cast<uint8_t>(size);
            std::vector<Vec> corners;
            for_each_corner(node, [&](const Vec& p) { corners.push_back(p); });
            sketch.add(corners);
            report(size);
        } else {
            add_siblings(node.children, left_of(node.binary), halves.left_lanes);
            add_siblings(node.children, right_of(node.binary), uint32_t{halves.lanes} - halves.left_lanes);
            node.packed.child_count = static_cast<uint8_t>(node.children.size());
            std::vector<Sketch> sketches(node.children.size());
            const auto grow_child = [&](size_t c) { grow(node.children[c], sketches[c]); };
            if (size > kParallelAbove)
                parallel_for(size_t{0}, sketches.size(), grow_child);
            else
                for (size_t c = 0; c < sketches.size(); ++c) grow_child(c);
            for (const Sketch& s : sketches) sketch.add(s);
        }
        cover(node, sketch);
    }

    // The node's ellipsoid.
    void cover(Node& node, const Sketch& sketch) {
        checkpoint();
        std::vector<Vec> core = without_repeats(sketch.points());
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
            return std::sqrt(largest) + radial_margin(decoded, options_.margin);
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

    // Each triangle is reported twice: when the binary tree has come down to it, and when its leaf is made.
    void report(uint32_t triangles) {
        const uint64_t before = done_.fetch_add(triangles), step = count_ / 64 + 1;
        if (!options_.progress || before / step == (before + triangles) / step) return;
        options_.progress(static_cast<double>(before + triangles) / (2.0 * count_));
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
                const Part& part = binary_[node->binary].part;
                for (uint32_t i = part.begin; node->children.empty() && i < part.end; ++i)
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
    std::vector<Halves> binary_;
    std::vector<Choice> choices_; // of the binary nodes, most_lanes() for each

    std::atomic<bool> too_large_ = false;
    std::atomic<uint64_t> done_ = 0;
};

} // namespace

Result<ExactTree> grow_exact(MeshView mesh, const ExactOptions& options) {
    return Grower(mesh, options).run();
}

} // namespace prolate
