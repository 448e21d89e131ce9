// A dynamic tree of axis-aligned boxes: the broadphase's index.
//
// Sources: E. Catto, "Dynamic Bounding Volume Hierarchies", GDC 2019, and b2DynamicTree of Box2D v3: insertion beside
// the sibling that makes the surface area of all inner boxes grow least (surface area heuristic; J. Goldsmith and J.
// Salmon 1987), found by one greedy descent with a bound on what lies below; then, on the way up, tree rotations that
// shrink a box (A. Kensler 2008, "Tree Rotations for Improving Bounding Volume Hierarchies"). Trees are walked without
// a stack, along parent links, so that no depth is too deep and no walk allocates.
//
// Invariants: a node's box is exactly what holds its two children's; a leaf's is as it was inserted. n leaves have
// n - 1 inner nodes; their numbers are reused, so that a tree of at most n leaves never grows beyond 2 n - 1.
//
// Complexity: insert and remove O(depth), which is some 1.5 log2 n for bodies spread about, n at worst. The shape
// depends on the order of the calls, never on addresses or chance.
//
// Boxes must be finite (areas of infinite ones cannot be compared). A box whose lower exceeds its upper is harmless.
#pragma once

#include <prolate/bounds.hpp>

#include <algorithm>
#include <cstdint>
#include <memory_resource>
#include <utility>
#include <vector>

namespace prolate::query {

/// The smallest box that holds both.
inline Bounds join(const Bounds& a, const Bounds& b) noexcept {
    return {{std::min(a.lower.x, b.lower.x), std::min(a.lower.y, b.lower.y), std::min(a.lower.z, b.lower.z)},
            {std::max(a.upper.x, b.upper.x), std::max(a.upper.y, b.upper.y), std::max(a.upper.z, b.upper.z)}};
}

/// Is `inner` within `outer`?
inline bool contains(const Bounds& outer, const Bounds& inner) noexcept {
    return outer.lower.x <= inner.lower.x && outer.lower.y <= inner.lower.y && outer.lower.z <= inner.lower.z &&
           outer.upper.x >= inner.upper.x && outer.upper.y >= inner.upper.y && outer.upper.z >= inner.upper.z;
}

class BoundsTree {
public:
    static constexpr uint32_t kNone = UINT32_MAX;

    explicit BoundsTree(std::pmr::memory_resource* memory) : nodes_(memory) {}

    /// Room for so many leaves. Throws what the memory resource throws; nothing else here allocates, unless insert()
    /// exceeds what was reserved.
    void reserve(uint32_t leaves) { nodes_.reserve(2 * size_t{leaves}); }

    /// Returns the leaf's node, which stays its own until it is removed.
    uint32_t insert(const Bounds& box, uint32_t item);
    void remove(uint32_t leaf) noexcept;
    void move(uint32_t leaf, const Bounds& box) noexcept;

    const Bounds& box(uint32_t node) const noexcept { return nodes_[node].box; }
    bool is_leaf(uint32_t node) const noexcept { return nodes_[node].child[0] == kNone; }
    uint32_t item(uint32_t leaf) const noexcept { return nodes_[leaf].child[1]; }
    uint32_t child(uint32_t node, uint32_t i) const noexcept { return nodes_[node].child[i]; }
    uint32_t parent(uint32_t node) const noexcept { return nodes_[node].parent; }
    uint32_t root() const noexcept { return root_; } // kNone if empty
    uint32_t node_count() const noexcept { return static_cast<uint32_t>(nodes_.size()) - free_count_; }

    /// Where a walk has come to: it goes on from one leaf to the next when it is asked to.
    class Walk {
    public:
        explicit Walk(const BoundsTree& tree) : node_(tree.root_) {}
        /// The item of the next leaf that enters(box) holds for, as walk() has them; kNone at the end. enters() may
        /// hold for fewer boxes than before. The tree must be the same.
        template <class Enters, class SecondFirst>
        uint32_t next(const BoundsTree& tree, Enters&& enters, SecondFirst&& second_first);

    private:
        uint32_t node_;      // kNone at the end
        bool begun_ = false; // then node_ has been seen
    };

    /// Calls leaf(item) for the leaves that enters(box) holds for, as it must for all boxes above them; ends when
    /// leaf() returns false. second_first(box, box of its sibling) tells, for the first child of a node, whether its
    /// sibling comes first; the answer must be the same during a walk.
    template <class Enters, class SecondFirst, class Leaf>
    void walk(Enters&& enters, SecondFirst&& second_first, Leaf&& leaf) const;
    template <class Enters, class Leaf> void walk(Enters&& enters, Leaf&& leaf) const {
        walk(
            enters, [](const Bounds&, const Bounds&) { return false; }, leaf);
    }

private:
    struct Node {
        Bounds box;
        uint32_t parent;
        uint32_t child[2]; // of a leaf: kNone and its item; of a free node: kNone and the next free one
    };

    uint32_t make_node(const Node& node);
    void free_node(uint32_t node) noexcept;
    uint32_t& link_to(uint32_t node) noexcept; // the place that says where it is
    Bounds joined_children(uint32_t node) const noexcept;
    uint32_t best_sibling(const Bounds& box) const noexcept;
    void link(uint32_t leaf);
    void unlink(uint32_t leaf) noexcept;
    void refit(uint32_t node) noexcept;
    void rotate(uint32_t node) noexcept;

    std::pmr::vector<Node> nodes_;
    uint32_t root_ = kNone;
    uint32_t free_ = kNone;
    uint32_t free_count_ = 0;
};

template <class Enters, class SecondFirst>
uint32_t BoundsTree::Walk::next(const BoundsTree& tree, Enters&& enters, SecondFirst&& second_first) {
    const auto& nodes = tree.nodes_;
    const auto first = [&](const Node& parent) {
        return second_first(nodes[parent.child[0]].box, nodes[parent.child[1]].box) ? 1 : 0;
    };
    bool leave = std::exchange(begun_, true);
    while (node_ != kNone) {
        if (!leave && enters(nodes[node_].box)) {
            if (tree.is_leaf(node_)) return tree.item(node_);
            node_ = nodes[node_].child[first(nodes[node_])];
            continue;
        }
        leave = false;
        for (;;) { // to the sibling of the nearest ancestor that has not been left yet
            const uint32_t parent = nodes[node_].parent;
            if (parent == kNone) return node_ = kNone;
            const int way = first(nodes[parent]);
            if (node_ == nodes[parent].child[way]) {
                node_ = nodes[parent].child[1 - way];
                break;
            }
            node_ = parent;
        }
    }
    return kNone;
}

template <class Enters, class SecondFirst, class Leaf>
void BoundsTree::walk(Enters&& enters, SecondFirst&& second_first, Leaf&& leaf) const {
    Walk walk(*this);
    for (uint32_t item; (item = walk.next(*this, enters, second_first)) != kNone;)
        if (!leaf(item)) return;
}

} // namespace prolate::query
