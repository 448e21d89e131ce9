// Each node against each ellipsoid below it, by the S-lemma (src/nested.cpp) with its rounding paid for, and by the
// ellipsoid's extents. Those below lie side by side on each level.
#include "builder/verify_bounding.hpp"

#include "src/block.hpp"
#include "src/block_box.hpp"
#include "src/nested.hpp"
#include "src/power_of_two.hpp"

#include <cmath>

namespace prolate {
namespace {

// Does a node's box, as queries take it, hold an ellipsoid? Its sides are exact in double; extents round by 4 u.
bool box_holds(const TreeView& tree, uint32_t node, const Ellipsoid& e) {
    const BlockBoxes boxes(tree.raw().bounding_block(node / kBlockLanes));
    const uint32_t lane = node % kBlockLanes;
    const LatticeInfo lattice = tree.raw().lattice();
    const double step = power_of_two(lattice.step_exponent), center[3] = {e.center.x, e.center.y, e.center.z};
    const double half[3] = {e.l11, std::hypot(e.l21, e.l22), std::hypot(e.l31, e.l32, e.l33)};
    for (size_t i = 0; i < 3; ++i) {
        const double origin = static_cast<double>(lattice.origin[i]) + boxes.origin(i), unit = boxes.step(i);
        const double low = (origin + unit * boxes.low(i, lane)) * step,
                     high = (origin + unit * boxes.high(i, lane)) * step;
        const double reach = half[i] * (1 + 0x1p-50);
        if (!(low <= center[i] - reach && center[i] + reach <= high)) return false;
    }
    return true;
}

bool bounds_all(const TreeView& tree, uint32_t node) {
    if (tree.is_leaf(node)) return box_holds(tree, node, tree.ellipsoid(node));
    const Outer outer(tree.bound(node));
    for (uint32_t first = node, end = node + 1;;) {
        uint32_t next_first = 0, next_end = 0; // of all their children
        for (uint32_t above = first; above < end; ++above) {
            if (!tree.is_node(above)) continue;
            const ChildRange children = tree.children(above);
            if (children.count == 0) continue;
            if (next_end == 0) next_first = children.first;
            next_end = children.first + children.count;
        }
        if (next_end == 0) return true;
        for (uint32_t below = next_first; below < next_end; ++below) {
            if (!tree.is_node(below)) continue;
            const Ellipsoid e = tree.ellipsoid(below);
            if (!(outer.growth_to_hold(e) <= 1) || !box_holds(tree, node, e)) return false;
        }
        first = next_first, end = next_end;
    }
}

} // namespace

std::optional<uint32_t> find_unbounded(const TreeView& tree) {
    std::optional<uint32_t> out;
    if (tree.bake_info().exact) return out;
    tree.for_each_node([&](uint32_t node) {
        if (!out && !bounds_all(tree, node)) out = node;
    });
    return out;
}

} // namespace prolate
