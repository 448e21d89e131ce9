// Slabs of exact trees' nodes (src/slab.hpp), placed: how far apart is what lies below two nodes, if a normal of theirs
// says so? The last word on faces that are flat and parallel, of which float bounds of quantised volumes are never as
// great as the distance. In double precision.
//
// Let n, of length 1, be such a normal m, or its opposite, from A to B. Along it A's triangles reach no farther than
// m.o + high. Those of another node with a slab reach, along any d = (d.m) m + e, no farther than
//     (d.m) (m.o + (high or low)) + e.c + |L^T e|,
// its slab for the one part and its ellipsoid for the rest; of planes that are parallel, e is nothing but rounding. A
// node without a slab reaches as far as its ellipsoid, a leaf as far as its triangles.
//
// Rounding: the terms are those of support.hpp, some more products and sums of lengths that S holds, and the ones of
// kSlabRounding. kSeparationMargin is 256 u: it pays for the lot.
#pragma once

#include "query/ellipsoid/placed.hpp"

#include <prolate/tree.hpp>

#include <cstddef>
#include <cstdint>

namespace prolate::query {

/// Block tests that most queries do not need: slabs cost more than they save before.
inline constexpr uint64_t kPatience = 32;

/// A node of either tree.
struct NodeWithHull {
    const TreeView& tree;
    uint32_t node;
    const std::byte* hull; ///< null of a leaf, and of a tree without triangles
};

NodeWithHull with_hull(const TreeView& tree, uint32_t node) noexcept;
/// Does it have a slab?
bool is_flat(const NodeWithHull& at) noexcept;

/// Is a slab of theirs about perpendicular to n, which is of length 1 and in A's frame, or are they parallel to each
/// other? Else they will not tell anything that is not known.
bool may_tell(const NodeWithHull& a, const NodeWithHull& b, const RelativePose& b_to_a, const glm::dvec3& n) noexcept;

/// How far the second node's triangles lie beyond the first's along n, of length 1 and in A's frame; not more, and
/// little less, if a slab of theirs is perpendicular to n, but for rounding.
double gap_along(const glm::dvec3& n, const NodeWithHull& a, const NodeWithHull& b,
                 const RelativePose& b_to_a) noexcept;

/// A lower bound on the distance of what lies below the nodes, from their slabs; without any, or if they do not
/// separate, not positive or NaN. `reach` is S: triangle_reach() of both trees, and b_to_a.distance.
double gap_of_slabs(const NodeWithHull& a, const NodeWithHull& b, const RelativePose& b_to_a, double reach) noexcept;

/// The same of two whole trees if both have slabs, which face each other, and may well be farther apart than `least`;
/// else -infinity. Quick where they do not: it looks at rounded normals first.
double gap_of_roots(const TreeView& a, const TreeView& b, const RelativePose& b_to_a, double least) noexcept;

} // namespace prolate::query
