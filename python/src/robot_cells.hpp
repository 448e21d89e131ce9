// Boxes that hold a body, in its frame: what rules out most pairs of bodies before their trees are asked.
//
// The cells of a body are a hierarchy of boxes with edges along its axes; those of a node's children together hold the
// solid in the node's. They come from asking the tree itself which boxes it meets, so they hold what a closed mesh
// encloses, too, and are as certain as its answers. Trees have such hierarchies of their own, but with less to say per
// test: their nodes are ellipsoids around a surface, as few as eight, while these are tight boxes, eight at a time.
#pragma once

#include "python/src/poses.hpp"
#include "python/src/robot_lanes.hpp"

#include <prolate/query.hpp>
#include <prolate/tree.hpp>

#include <array>
#include <span>
#include <vector>

namespace prolate::python {

/// Of the lengths involved: what two boxes must be apart along an axis, see robot_cells.cpp.
inline constexpr float kBoxSlack = 0x1p-18f;

/// Eight boxes. Lanes that hold none have half extents of -infinity.
struct alignas(32) CellBlock {
    Floats3 center, half;
    std::array<uint32_t, kLanes> children; ///< a block; kLeaf: no children
};

/// Eight balls. The radius is negative in lanes that hold none.
struct alignas(32) BallBlock {
    Floats3 center;
    Floats radius;
};

struct Cell {
    std::array<float, 3> center, half;
};

/// A rigid placement in single precision: x -> r x + t. Its entries are off by 8 roundings of their values at most.
struct FloatPlace {
    float r[3][3], t[3];
};
FloatPlace float_place(const Pose& pose) noexcept;
FloatPlace inverse(const FloatPlace& place) noexcept;

struct Cells {
    static constexpr uint32_t kLeaf = UINT32_MAX;

    Cell root{};            ///< holds all
    float radius = 0;       ///< no point of the body is farther from the root's center
    uint32_t first = kLeaf; ///< block of the root's children
    std::vector<CellBlock> blocks;
    std::vector<BallBlock> inner; ///< balls inside the solid

    /// Lanes of the cell `node`, 8 * block + lane, or of the root.
    static constexpr uint32_t kRoot = UINT32_MAX;
    Cell cell(uint32_t node) const noexcept;
    uint32_t children(uint32_t node) const noexcept {
        return node == kRoot ? first : blocks[node / kLanes].children[node % kLanes];
    }
};

/// Of a body in a tree.
Cells cells_of(const TreeView& tree, QueryContext& context);
/// Of a box around the origin, which is its only cell.
Cells cells_of_box(const std::array<double, 3>& half);
/// Of balls of one radius; leaf `node` is the ball ids[node].
Cells cells_of_points(std::span<const Vec3> points, float radius, std::vector<uint32_t>& ids);

/// Two leaves that may meet, and whether to go on looking.
struct LeafVisitor {
    virtual bool meets(uint32_t a, uint32_t b) = 0; ///< true ends the search
protected:
    ~LeafVisitor() = default;
};

/// May the cells of `a` and of `b`, the latter at `b_in_a`, come within `margin` of each other? With a visitor: does it
/// say so of a pair of leaves that may? It may lessen the margin meanwhile.
bool cells_meet(const Cells& a, const Cells& b, const FloatPlace& b_in_a, const float& margin,
                LeafVisitor* visitor = nullptr);

/// Does a ball inside the solid of `a` certainly meet one inside that of `b`, which is at `b_in_a`?
bool inner_meets_inner(const Cells& a, const Cells& b, const FloatPlace& b_in_a);
/// Does a ball inside the solid of `a` certainly meet the box of these half extents at `b_in_a`?
bool inner_meets_box(const Cells& a, const std::array<float, 3>& half, const FloatPlace& b_in_a);

} // namespace prolate::python
