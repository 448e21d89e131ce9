#include "query/world/bounds_tree.hpp"

namespace prolate::query {
namespace {

// Half the surface. In double, where no box of finite floats overflows.
double area(const Bounds& b) {
    const double x = double{b.upper.x} - b.lower.x, y = double{b.upper.y} - b.lower.y,
                 z = double{b.upper.z} - b.lower.z;
    return x * y + y * z + z * x;
}

} // namespace

uint32_t BoundsTree::make_node(const Node& node) {
    if (free_ == kNone) {
        nodes_.push_back(node);
        return static_cast<uint32_t>(nodes_.size() - 1);
    }
    const uint32_t out = free_;
    free_ = nodes_[out].child[1], --free_count_;
    nodes_[out] = node;
    return out;
}

void BoundsTree::free_node(uint32_t node) noexcept {
    nodes_[node] = {{}, kNone, {kNone, free_}};
    free_ = node, ++free_count_;
}

uint32_t& BoundsTree::link_to(uint32_t node) noexcept {
    const uint32_t parent = nodes_[node].parent;
    if (parent == kNone) return root_;
    return nodes_[parent].child[nodes_[parent].child[0] == node ? 0 : 1];
}

Bounds BoundsTree::joined_children(uint32_t node) const noexcept {
    return join(nodes_[nodes_[node].child[0]].box, nodes_[nodes_[node].child[1]].box);
}

uint32_t BoundsTree::insert(const Bounds& box, uint32_t item) {
    const uint32_t leaf = make_node({box, kNone, {kNone, item}});
    link(leaf);
    return leaf;
}

void BoundsTree::remove(uint32_t leaf) noexcept {
    unlink(leaf);
    free_node(leaf);
}

void BoundsTree::move(uint32_t leaf, const Bounds& box) noexcept {
    unlink(leaf);
    nodes_[leaf].box = box;
    link(leaf); // takes the inner node that unlink() has just set free
}

// What a place costs: the area of the new node there, plus what the boxes above it grow. On the way down `inherited` is
// that growth. Below a child nothing costs less than inherited + area(child with box) + min(0, area(box) -
// area(child)): what grows and what is new, if the box itself is all that the new node has to hold.
uint32_t BoundsTree::best_sibling(const Bounds& box) const noexcept {
    const double box_area = area(box);
    uint32_t node = root_, best = root_;
    double direct = area(join(nodes_[node].box, box)), inherited = 0, best_cost = direct;
    for (;;) {
        if (direct + inherited < best_cost) best_cost = direct + inherited, best = node;
        if (is_leaf(node)) return best;
        inherited += direct - area(nodes_[node].box);
        double direct_of[2], bound[2];
        for (int i = 0; i < 2; ++i) {
            const uint32_t child = nodes_[node].child[i];
            direct_of[i] = area(join(nodes_[child].box, box));
            const double below = is_leaf(child) ? 0 : std::min(box_area - area(nodes_[child].box), 0.0);
            bound[i] = inherited + direct_of[i] + below;
        }
        const int next = bound[1] < bound[0] ? 1 : 0;
        if (!(bound[next] < best_cost)) return best;
        node = nodes_[node].child[next], direct = direct_of[next];
    }
}

void BoundsTree::link(uint32_t leaf) {
    if (root_ == kNone) {
        root_ = leaf, nodes_[leaf].parent = kNone;
        return;
    }
    const uint32_t sibling = best_sibling(nodes_[leaf].box);
    const uint32_t parent = make_node({{}, nodes_[sibling].parent, {sibling, leaf}});
    link_to(sibling) = parent;
    nodes_[sibling].parent = nodes_[leaf].parent = parent;
    refit(parent);
}

void BoundsTree::unlink(uint32_t leaf) noexcept {
    const uint32_t parent = nodes_[leaf].parent;
    if (parent == kNone) {
        root_ = kNone;
        return;
    }
    const uint32_t sibling = nodes_[parent].child[nodes_[parent].child[0] == leaf ? 1 : 0];
    link_to(parent) = sibling;
    nodes_[sibling].parent = nodes_[parent].parent;
    free_node(parent);
    // What is above shrinks, up to the first that does not. No rotations: they pay where something was inserted.
    for (uint32_t node = nodes_[sibling].parent; node != kNone; node = nodes_[node].parent) {
        const Bounds box = joined_children(node);
        if (box == nodes_[node].box) return;
        nodes_[node].box = box;
    }
}

// Makes the boxes of `node` and all above it right again, and those below them smaller where a rotation can.
void BoundsTree::refit(uint32_t node) noexcept {
    for (; node != kNone; node = nodes_[node].parent) {
        nodes_[node].box = joined_children(node);
        rotate(node);
    }
}

// Of the four exchanges of a child with a child of the other child, does the one that makes the other's box shrink
// most. The node's own box stays.
void BoundsTree::rotate(uint32_t node) noexcept {
    double best_gain = 0;
    int best_up = -1, best_down = 0;
    for (int up = 0; up < 2; ++up) {
        const Node& other = nodes_[nodes_[node].child[1 - up]];
        if (other.child[0] == kNone) continue;
        const Bounds& box = nodes_[nodes_[node].child[up]].box;
        for (int down = 0; down < 2; ++down) {
            const double gain = area(other.box) - area(join(box, nodes_[other.child[1 - down]].box));
            if (gain > best_gain) best_gain = gain, best_up = up, best_down = down;
        }
    }
    if (best_up < 0) return;
    const uint32_t up = nodes_[node].child[best_up], other = nodes_[node].child[1 - best_up];
    const uint32_t down = nodes_[other].child[best_down];
    nodes_[node].child[best_up] = down, nodes_[other].child[best_down] = up;
    nodes_[down].parent = node, nodes_[up].parent = other;
    nodes_[other].box = joined_children(other);
}

} // namespace prolate::query
