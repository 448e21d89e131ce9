// How much of a Scratch queries need: they keep nodes, or pairs of nodes, on a stack that never holds more than the
// siblings on the way down to a leaf, or to two; and distance() and sweep() a heap below it.
#pragma once

#include <prolate/query.hpp>

#include <cstddef>
#include <cstdint>
#include <span>

namespace prolate::query {

/// No more nodes wait on a stack while one leaf is looked for depth first.
inline uint32_t siblings_on_the_way(const TreeView& tree) noexcept {
    return tree.degree() * (tree.level_count() - 1);
}

/// Entries that a heap may hold, of a scratch that is large enough: those above it suffice to search any pair depth
/// first, and for the children of another.
inline uint32_t heap_room(const Scratch& scratch, const TreeView& a, const TreeView& b) noexcept {
    return scratch.count() - kMaxDegree - siblings_on_the_way(a) - siblings_on_the_way(b);
}

/// A scratch that is large enough for two trees, as small as it may be, and what is left over.
struct DividedScratch {
    Scratch least;
    std::span<std::byte> rest;
};
DividedScratch divide(const Scratch& scratch, const TreeView& a, const TreeView& b) noexcept;

/// Is it large enough?
bool suffices(const Scratch& scratch, const TreeView& tree) noexcept;
bool suffices(const Scratch& scratch, const TreeView& a, const TreeView& b) noexcept;

} // namespace prolate::query
