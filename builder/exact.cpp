// Exact trees: a binary tree over the triangles (binary_tree.hpp), then the best wide one that can be cut out of it.
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
// times the time); nor does moving subtrees within the binary tree (3 %). Blocks tested grow by 2 to 5 % if the binary
// tree takes the four body diagonals in the place of the six face diagonals, and by 7 to 20 % if it tries only the
// principal axes (bench_exact).
//
// Each node gets a minimum-volume ellipsoid around the corners of its triangles: fitted to their farthest points in the
// sketch directions (merged from the children's), then refitted with what sticks out.
//
// Complexity: O(n log n) time, O(n) memory for a fixed degree.
#include "builder/exact.hpp"

#include "builder/binary_tree.hpp"
#include "builder/corners_by_use.hpp"
#include "builder/cover.hpp"
#include "builder/fit.hpp"
#include "builder/job.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <numeric>
#include <span>

namespace prolate {
namespace {

// Of a query at a leaf, and for each of its triangles; in tests of a block of children. Pairs of triangles are tested
// eight at a time, so that a leaf of several costs little more than one of a single triangle.
constexpr double kLeafCost = 0.7, kTriangleCost = 0.3;
constexpr int kRefits = 6; // of refitting a node
constexpr uint32_t kNone = std::numeric_limits<uint32_t>::max();
constexpr double kLeafTolerance = 1e-2; // of the ellipsoids' radii: there are many leaves, and little lies below them

// What becomes of a binary node.
struct Opening {
    // As an inner node, the lanes that its children take, and how many of them stem from the left child. No lanes: it
    // becomes a leaf.
    uint8_t lanes = 0, left_lanes = 0;
    size_t choices = 0; // first of its Choices
};

// The best way to make siblings of a binary node's triangles, in at most as many lanes as the choice's place, from 1.
struct Choice {
    double cost = HUGE_VAL;
    uint8_t left_lanes = 0; // for what is left of the cut; 0: best in one lane less
};

struct Node {
    uint32_t binary = 0; // its node of the binary tree
    std::vector<Node> children;
    format::PackedNode packed;
};

// Triangles share corners, and a sketch names some of its points many times; fitting takes time for each.
std::vector<Vec> without_repeats(std::span<const Vec> points) {
    std::vector<Vec> out(points.begin(), points.end());
    const auto less = [](const Vec& p, const Vec& q) {
        return std::lexicographical_compare(p.begin(), p.end(), q.begin(), q.end());
    };
    std::sort(out.begin(), out.end(), less);
    out.erase(std::unique(out.begin(), out.end()), out.end());
    return out;
}

class ExactTreeBuilder {
public:
    ExactTreeBuilder(MeshView mesh, const ExactOptions& options)
        : mesh_(mesh), options_(options), binary_(mesh, options.effort.axes, [this] { report(1); }),
          corners_(in_order(), mesh.vertices), openings_(binary_.nodes().size()) {
        Box box;
        for (const Vec3& v : mesh.vertices) box.add(to_vec(v));
        lattice_ = format::lattice_for(box.low.data(), box.high.data());
    }

    Result<ExactTree> run() {
        choose();
        Node root;
        Sketch sketch;
        grow(root, sketch);
        if (too_large_)
            return Error{ErrorCode::bad_mesh,
                         "the mesh is too large or too small for the file format; scale it to metres"};
        return assemble(root);
    }

private:
    // ---- from the binary tree to the wide one ----

    std::vector<Triangle> in_order() const {
        std::vector<Triangle> out;
        for (const uint32_t t : binary_.triangles(0)) out.push_back(mesh_.triangles[t]);
        return out;
    }
    uint32_t size_of(uint32_t index) const { return binary_.nodes()[index].part.size(); }
    uint32_t most_lanes(uint32_t index) const { return std::min(options_.degree, size_of(index)); }

    // Finds out for each binary node what would become of it, children first.
    void choose() {
        size_t total = 0;
        for (uint32_t i = 0; i < openings_.size(); ++i) {
            openings_[i].choices = total;
            total += most_lanes(i);
        }
        choices_.resize(total);
        for (auto i = static_cast<uint32_t>(openings_.size()); i-- > 0;) choose(i);
    }
    void choose(uint32_t index) {
        const double squared_width = binary_.nodes()[index].squared_width;
        Opening& opening = openings_[index];
        Choice* const choices = &choices_[opening.choices];
        const uint32_t size = size_of(index);
        if (size <= options_.leaf_triangles) choices[0].cost = (kLeafCost + kTriangleCost * size) * squared_width;
        if (size == 1) return;

        const uint32_t left = BinaryTree::left_of(index), right = binary_.right_of(index);
        const uint32_t lanes = most_lanes(index), left_most = most_lanes(left), right_most = most_lanes(right);
        const Choice* const of_left = &choices_[openings_[left].choices];
        const Choice* const of_right = &choices_[openings_[right].choices];
        Choice best;
        for (uint32_t l = 1; l <= left_most; ++l)
            for (uint32_t r = 1; r <= right_most && l + r <= lanes; ++r) {
                const Choice both{of_left[l - 1].cost + of_right[r - 1].cost, static_cast<uint8_t>(l)};
                if (both.cost < choices[l + r - 1].cost) choices[l + r - 1] = both;
                if (both.cost < best.cost) best = both, opening.lanes = static_cast<uint8_t>(l + r);
            }
        opening.left_lanes = best.left_lanes;
        if (const double open = squared_width + best.cost; open < choices[0].cost)
            choices[0].cost = open;
        else
            opening.lanes = 0;
        for (uint32_t n = 1; n < lanes; ++n)
            if (!(choices[n].cost < choices[n - 1].cost)) choices[n] = {choices[n - 1].cost, 0};
    }
    // Adds the siblings that stand for a binary node in at most `lanes` lanes.
    void add_siblings(std::vector<Node>& siblings, uint32_t index, uint32_t lanes) const {
        const Choice* const choices = &choices_[openings_[index].choices];
        while (lanes > 1 && choices[lanes - 1].left_lanes == 0) --lanes;
        if (lanes == 1) {
            siblings.emplace_back().binary = index;
            return;
        }
        const uint32_t left = choices[lanes - 1].left_lanes;
        add_siblings(siblings, BinaryTree::left_of(index), left);
        add_siblings(siblings, binary_.right_of(index), lanes - left);
    }

    // ---- nodes ----

    // Makes all below `node`, and `sketch` that of its corners, if they are many.
    void grow(Node& node, Sketch& sketch) {
        checkpoint();
        const Opening& opening = openings_[node.binary];
        const uint32_t size = size_of(node.binary);
        std::vector<Sketch> sketches; // of the children
        if (opening.lanes == 0) {
            node.packed.triangle_count = static_cast<uint8_t>(size);
            report(size);
        } else {
            node.children.reserve(opening.lanes);
            add_siblings(node.children, BinaryTree::left_of(node.binary), opening.left_lanes);
            add_siblings(node.children, binary_.right_of(node.binary), uint32_t{opening.lanes} - opening.left_lanes);
            node.packed.child_count = static_cast<uint8_t>(node.children.size());
            sketches.resize(node.children.size());
            const auto grow_child = [&](size_t c) { grow(node.children[c], sketches[c]); };
            if (size > kParallelAbove)
                parallel_for(size_t{0}, sketches.size(), grow_child);
            else
                for (size_t c = 0; c < sketches.size(); ++c) grow_child(c);
        }
        const std::vector<Vec> corners = corners_of(node);
        if (corners.size() >= sketch_directions().size()) {
            for (size_t c = 0; c < sketches.size(); ++c)
                sketches[c].empty() ? sketch.add(corners_of(node.children[c])) : sketch.add(sketches[c]);
            if (sketches.empty()) sketch.add(corners);
        }
        cover(node, corners, sketch);
    }

    std::vector<Vec> corners_of(const Node& node) const {
        const BinaryTree::Part part = binary_.nodes()[node.binary].part;
        return corners_.of(part.begin, part.end);
    }

    // The node's ellipsoid and box. Of many corners, the sketch is the core of a fit.
    void cover(Node& node, std::span<const Vec> corners, const Sketch& sketch) {
        std::vector<Vec> core =
            sketch.empty() ? std::vector(corners.begin(), corners.end()) : without_repeats(sketch.points());
        const double tolerance = node.packed.child_count == 0 ? kLeafTolerance : options_.effort.tolerance;
        const double outside = 1 + 2 * tolerance; // squared radial coordinate from which a point calls for a refit
        Fit fit;
        for (int round = 0; round < kRefits; ++round) {
            fit = enclosing_ellipsoid(core, options_.min_radius, tolerance);
            // In each octant of the unit ball, the point that sticks out most joins the core.
            std::array<Vec, 8> worst;
            std::array<double, 8> reach;
            reach.fill(outside);
            for (const Vec& p : corners) {
                const Vec y = fit.radial(p);
                const double r = y.squaredNorm();
                if (!(r > outside)) continue;
                const size_t octant = (y.x() > 0) | (y.y() > 0) << 1 | (y.z() > 0) << 2;
                if (r > reach[octant]) reach[octant] = r, worst[octant] = p;
            }
            const size_t before = core.size();
            for (size_t i = 0; i < worst.size(); ++i)
                if (reach[i] > outside) core.push_back(worst[i]);
            if (core.size() == before) break;
        }
        const auto reach = [&](const Fit& decoded) {
            return decoded.reach(corners) + radial_margin(decoded, options_.margin);
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
        for (const Vec& p : corners) box.add(p);
        for (int i = 0; i < 3; ++i) node.packed.box_low[i] = box.low[i], node.packed.box_high[i] = box.high[i];
    }

    // Each triangle is reported twice: when the binary tree has come down to it, and when its leaf is made.
    void report(uint32_t triangles) {
        const uint64_t count = mesh_.triangles.size(), before = done_.fetch_add(triangles), step = count / 64 + 1;
        if (!options_.progress || before / step == (before + triangles) / step) return;
        options_.progress(static_cast<double>(before + triangles) / (2.0 * static_cast<double>(count)));
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
                if (!node->children.empty()) continue;
                for (const uint32_t t : binary_.triangles(node->binary)) out.triangles.push_back(mesh_.triangles[t]);
            }
            level.swap(next);
        }
        number_vertices(out);
        return out;
    }

    // Renumbers the vertices: the first of each connected component in front, the others as they are first used.
    void number_vertices(ExactTree& out) const {
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
    std::atomic<bool> too_large_ = false;
    std::atomic<uint64_t> done_ = 0;
    const BinaryTree binary_;
    const CornersByUse corners_;    // in its order
    std::vector<Opening> openings_; // of its nodes
    std::vector<Choice> choices_;   // of its nodes, most_lanes() for each
    format::Lattice lattice_;
};

} // namespace

Result<ExactTree> grow_exact(MeshView mesh, const ExactOptions& options) {
    return ExactTreeBuilder(mesh, options).run();
}

} // namespace prolate
