// A tree as a traversal sees it, and the few things that all traversals do with blocks of siblings.
#pragma once

#include "src/block.hpp"
#include "src/bytes.hpp"

#include <prolate/tree.hpp>

#include <algorithm>
#include <cstddef>
#include <cstdint>

namespace prolate::query {

/// One of the two trees of a query, or the only one.
struct TreeSide {
    const TreeView& tree;
    const LatticeInfo lattice;
    const std::byte *blocks, *bounding_blocks;
    const std::byte* hulls; ///< null without triangles
    bool has_slabs;         ///< some of these records do
    uint32_t leaves_from;   ///< slots from here on are leaves: the last level of the bytes
    uint32_t limit_from;    ///< slots from here on are too deep for QueryOptions::max_level to be opened
    uint32_t deepest = 0;   ///< largest slot that was tested

    uint32_t deepest_level() const noexcept { return tree.level_of(deepest); }
    /// The block that holds a slot, as queries take it: bounding blocks above the last level.
    const std::byte* block(uint32_t slot) const noexcept {
        return (slot < leaves_from ? bounding_blocks : blocks) + size_t{slot / kBlockLanes} * kBlockBytes;
    }
    /// Bit i: lane i of the block that begins at slot `first`, if there is such a node, has no children: it is of the
    /// last level, or its count is 0, or one of triangles.
    uint32_t leaf_lanes(uint32_t first, const std::byte* block) const noexcept {
        if (first >= leaves_from) return 0xff;
        static_assert(kTriangleLeaf == 0x80);
        constexpr uint64_t kTop = 0x8080808080808080;
        const auto counts = load_le<uint64_t>(block + kBlockCount);
        const uint64_t some = (counts & ~kTop) + ~kTop; // top bit of a byte: its lower bits are not all zero
        const uint64_t leaves = (counts | ~some) & kTop;
        return static_cast<uint32_t>((leaves >> 7) * 0x0102040810204080 >> 56); // gathers one bit of each byte
    }
};

TreeSide tree_side(const TreeView& tree, uint32_t max_level) noexcept;

/// The children of the inner node in `lane` of `block`.
inline ChildRange children_in(const std::byte* block, uint32_t lane) noexcept {
    return {first_child(block, lane), load_le<uint8_t>(block + kBlockCount + lane)};
}

/// Calls test(first, count) for the siblings of each block, in order, until one call returns false. Did none?
template <class Test> bool for_each_block(const ChildRange& siblings, Test&& test) {
    for (uint32_t i = 0; i < siblings.count; i += kBlockLanes)
        if (!test(siblings.first + i, std::min(siblings.count - i, kBlockLanes))) return false;
    return true;
}

} // namespace prolate::query
