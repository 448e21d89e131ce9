// Two deformed bodies in the frame of A: what collide() and distance() share.
#pragma once

#include "query/deform/body.hpp"

#include <cstdint>

namespace prolate::query {

struct DeformedPair {
    const Deformed &a, &b;
    const RelativePose b_to_a;

    Bound bound_a(uint32_t node) const noexcept { return a.bound(node); }
    Bound bound_b(uint32_t node) const noexcept { return place(b.bound(node), b_to_a); }
    PlacedTriangle triangle_a(uint32_t t) const noexcept { return a.triangle(t); }
    PlacedTriangle triangle_b(uint32_t t) const noexcept { return place(b.triangle(t), b_to_a); }

    bool are_leaves(uint32_t node_a, uint32_t node_b) const noexcept {
        return a.tree().is_leaf(node_a) && b.tree().is_leaf(node_b);
    }
    /// Of two nodes that are not both leaves, is that of A to be opened? The larger one is, whatever max_level is, so
    /// that deeper searches go the same way.
    bool opens_a(uint32_t node_a, const Bound& of_a, uint32_t node_b, const Bound& of_b) const noexcept {
        if (a.tree().is_leaf(node_a) || b.tree().is_leaf(node_b)) return b.tree().is_leaf(node_b);
        return of_a.core.size + of_a.radius >= of_b.core.size + of_b.radius;
    }
};

/// Are two of them certainly farther apart than `margin` >= 0?
bool apart(const Bound& x, const Bound& y, double margin) noexcept;
bool apart(const PlacedTriangle& x, const Bound& y, double margin) noexcept;

} // namespace prolate::query
