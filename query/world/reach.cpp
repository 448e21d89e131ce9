#include "query/world/reach.hpp"

#include "query/triangle/placed.hpp"
#include "src/block.hpp"
#include "src/block_box.hpp"
#include "src/bytes.hpp"
#include "src/hull.hpp"
#include "src/lattice.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

namespace prolate::query {
namespace {

using glm::dvec3;

constexpr uint32_t kMostOpened = 12;                           // for a direction
constexpr uint32_t kRoom = kMostOpened * (kMaxDegree - 1) + 1; // more nodes never wait to be opened
constexpr double kInfinite = std::numeric_limits<double>::infinity();

double sum_of_sizes(const dvec3& v) {
    return std::abs(v.x) + std::abs(v.y) + std::abs(v.z);
}

// Does the box of every node, in its bounding block, hold all that lies below it? Not in a prefix of an exact tree.
bool nested_boxes(const TreeView& tree) {
    return tree.has_triangles() || !tree.bake_info().exact;
}

// An ellipsoid as seen along a unit vector r.
struct Along {
    double center; // r.c
    dvec3 factor;  // L^T r
    double size;   // what bounds the rounding
};
Along along(const Ellipsoid& e, double scale, const dvec3& r) {
    const dvec3 c = to_double(e.center) * scale, diagonal = dvec3(e.l11, e.l22, e.l33) * scale,
                off_diagonal = dvec3(e.l21, e.l31, e.l32) * scale;
    return {glm::dot(r, c),
            {r.x * diagonal.x + r.y * off_diagonal.x + r.z * off_diagonal.y, r.y * diagonal.y + r.z * off_diagonal.z,
             r.z * diagonal.z},
            sum_of_sizes(c) + sum_of_sizes(diagonal) + sum_of_sizes(off_diagonal)};
}

// What is known of how far a part of the body reaches.
struct Interval {
    double least, most;
};

// How far the boxes of a block reach along r; what lanes without a node say means nothing.
void box_reaches(const TreeView& tree, uint32_t b, const dvec3& r, double rounding, Interval (&out)[kBlockLanes]) {
    const BlockBoxes boxes(tree.raw().bounding_block(b));
    const LatticeInfo lattice = tree.raw().lattice();
    const double step = step_of(lattice);
    double wide[kBlockLanes] = {}, at[kBlockLanes] = {}, size[kBlockLanes] = {};
    for (size_t k = 0; k < 3; ++k) {
        const double along = r[static_cast<glm::length_t>(k)], across = std::abs(along);
        const double unit = boxes.half_step(k) * step, origin = lattice.origin[k] + boxes.origin(k);
        for (size_t i = 0; i < kBlockLanes; ++i) {
            const int32_t low = boxes.low(k, i), high = boxes.high(k, i);
            const double middle = origin * step + (low + high) * unit, half = (high - low) * unit;
            at[i] += along * middle, wide[i] += across * half, size[i] += std::abs(middle) + half;
        }
    }
    for (size_t i = 0; i < kBlockLanes; ++i) {
        const double reach = wide[i] + rounding * size[i];
        out[i] = {at[i] - reach, at[i] + reach};
    }
}

// What the hull of an inner node says. That its triangles reach as far as the points, but for the share, is what
// builders' files have: it decides when to stop, and nothing else.
Interval hull_reach(const TreeView& tree, uint32_t node, const ChildRange& children, const dvec3& r, double rounding) {
    const std::byte* const record = tree.raw().hull(children.first / kBlockLanes);
    const double share = load_le<uint8_t>(record + kHullShare) / kHullShares;
    if (share == 0) return {-kInfinite, kInfinite};
    const Along e = along(tree.ellipsoid(node), tree.scale(), r);
    const auto w = [record](size_t k, size_t i) {
        return static_cast<double>(load_le<int8_t>(record + kHullPoint + kHullPoints * k + i));
    };
    double most[kHullPoints];
    for (size_t i = 0; i < kHullPoints; ++i)
        most[i] = e.factor.x * w(0, i) + e.factor.y * w(1, i) + e.factor.z * w(2, i);
    for (size_t n = kHullPoints / 2; n > 0; n /= 2)
        for (size_t i = 0; i < n; ++i) most[i] = std::max(most[i], most[i + n]);
    const double reach = e.center + most[0] / kHullUnit, wide = share * glm::length(e.factor) + rounding * e.size;
    return {reach - wide, reach + wide};
}

// At most how far the root reaches.
double root_reach(const TreeView& tree, const dvec3& r, double rounding) {
    Interval boxes[kBlockLanes];
    box_reaches(tree, 0, r, rounding, boxes);
    const ChildRange children = tree.children(0);
    if (!tree.has_triangles() || children.count == 0) return boxes[0].most;
    return std::min(boxes[0].most, hull_reach(tree, 0, children, r, rounding).most);
}

class ReachSearch {
public:
    ReachSearch(const TreeView& tree, const dvec3& direction, double rounding, double tolerance)
        : tree_(tree), r_(direction), rounding_(rounding), tolerance_(tolerance) {}

    // `root`: at most how far the root reaches.
    double run(double root) {
        push({root, 0, true});
        for (uint32_t opened = 0; count_ > 0;) {
            const Node top = waiting_[0];
            if (opened >= kMostOpened || !(top.most > std::max(settled_, reached_ + tolerance_)))
                return std::max(settled_, top.most);
            std::pop_heap(waiting_, waiting_ + count_--, nearer);
            const ChildRange children = tree_.children(top.slot);
            if (children.count == 0) {
                settle(top.slot);
            } else if (!top.looked_at) {
                const Interval hull = hull_reach(tree_, top.slot, children, r_, rounding_);
                reached_ = std::max(reached_, hull.least);
                push({std::min(top.most, hull.most), top.slot, true});
            } else {
                ++opened;
                for (uint32_t i = 0; i < children.count; i += kBlockLanes)
                    look(children.first + i, std::min(kBlockLanes, children.count - i), top.most);
            }
        }
        return settled_;
    }

    // All leaves.
    double exhaust() {
        tree_.for_each_in_cut(tree_.level_count() - 1, [this](uint32_t node) { settle(node); });
        return settled_;
    }

private:
    struct Node {
        double most;
        uint32_t slot;
        bool looked_at; // its hull, if it has one
    };
    static bool nearer(const Node& a, const Node& b) { return a.most < b.most; }

    void push(const Node& node) {
        if (node.most > reached_ + tolerance_) {
            assert(count_ < kRoom);
            waiting_[count_++] = node;
            std::push_heap(waiting_, waiting_ + count_, nearer);
        } else {
            settled_ = std::max(settled_, node.most);
        }
    }

    // At the siblings of a block, whose parent reaches at most `most`.
    void look(uint32_t first, uint32_t count, double most) {
        Interval boxes[kBlockLanes];
        box_reaches(tree_, first / kBlockLanes, r_, rounding_, boxes);
        for (uint32_t i = 0; i < count; ++i) reached_ = std::max(reached_, boxes[i].least);
        for (uint32_t i = 0; i < count; ++i) push({std::min(most, boxes[i].most), first + i, !tree_.has_triangles()});
    }

    void settle(uint32_t leaf) {
        if (!tree_.has_triangles()) {
            const Along e = along(tree_.ellipsoid(leaf), tree_.scale(), r_);
            return settle(e.center + glm::length(e.factor), e.size);
        }
        const TriangleRange range = tree_.triangles(leaf);
        for (uint32_t t = range.first; t < range.first + range.count; ++t)
            for (const uint32_t corner : tree_.triangle(t)) {
                const dvec3 p = position(tree_, corner);
                settle(glm::dot(r_, p), sum_of_sizes(p));
            }
    }
    void settle(double reach, double size) {
        settled_ = std::max(settled_, reach + rounding_ * size);
        reached_ = std::max(reached_, reach - rounding_ * size);
    }

    const TreeView& tree_;
    const dvec3 r_;
    const double rounding_, tolerance_;
    double reached_ = -kInfinite; // the body reaches at least so far,
    double settled_ = -kInfinite; // and where no node is waiting, at most so far
    uint32_t count_ = 0;
    Node waiting_[kRoom]; // a heap
};

} // namespace

Reach reach(const TreeView& tree, const RelativePose& to_world, double tolerance, double rounding) noexcept {
    const bool nested = nested_boxes(tree);
    Reach out;
    for (glm::length_t k = 0; k < 3; ++k) {
        const dvec3 axis(to_world.rotation[0][k], to_world.rotation[1][k], to_world.rotation[2][k]);
        const double root[] = {root_reach(tree, axis, rounding), root_reach(tree, -axis, rounding)};
        for (int way = 0; way < 2; ++way) {
            ReachSearch search(tree, way == 0 ? axis : -axis, rounding, tolerance * (root[0] + root[1]));
            out.at[k + 3 * way] = nested ? search.run(root[way]) : search.exhaust();
        }
    }
    return out;
}

} // namespace prolate::query
