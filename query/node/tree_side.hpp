// A tree as a traversal sees it.
#pragma once

#include <prolate/tree.hpp>

#include <cstddef>
#include <cstdint>

namespace prolate::query {

/// One of the two trees of a query, or the only one.
struct TreeSide {
    const TreeView& tree;
    const LatticeInfo lattice;
    uint32_t leaves_from; ///< slots from here on are leaves: the last level of the bytes
    uint32_t limit_from;  ///< slots from here on are too deep for QueryOptions::max_level to be opened
    uint32_t deepest = 0; ///< largest slot that was tested

    uint32_t deepest_level() const noexcept { return tree.level_of(deepest); }
    /// The block that holds a slot, as queries take it.
    const std::byte* block(uint32_t slot) const noexcept { return tree.bounding_block(slot / kBlockLanes); }
};

TreeSide tree_side(const TreeView& tree, uint32_t max_level) noexcept;

} // namespace prolate::query
