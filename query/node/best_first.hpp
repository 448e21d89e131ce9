// What best-first traversals of two trees share: how an entry says which of its two nodes is to be opened.
#pragma once

#include "query/node/tree_side.hpp"

#include <prolate/query.hpp>

#include <cstdint>

namespace prolate::query {

/// Bits of an entry's flags: B's node is to be opened, not A's; the node of A, of B is a leaf.
inline constexpr uint32_t kOpenB = 1, kLeafA = 2, kLeafB = 4, kLeaves = kLeafA | kLeafB;

/// Are both nodes leaves?
inline bool are_leaves(uint32_t flags) {
    return (flags & kLeaves) == kLeaves;
}
/// Is the node to be opened too deep for QueryOptions::max_level?
inline bool too_deep(const Scratch::Entry& e, const TreeSide& a, const TreeSide& b) {
    return (e.flags & kOpenB) != 0 ? e.node_b >= b.limit_from : e.node_a >= a.limit_from;
}
/// Of the pair of the roots: the larger one is opened, unless it is a leaf.
inline uint32_t root_flags(const TreeView& a, const TreeView& b, bool b_is_larger) {
    const bool leaf_a = a.is_leaf(0), leaf_b = b.is_leaf(0);
    return (!leaf_b && (leaf_a || b_is_larger) ? kOpenB : 0) | (leaf_a ? kLeafA : 0) | (leaf_b ? kLeafB : 0);
}

} // namespace prolate::query
