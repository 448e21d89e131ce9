// Two nodes of two trees that meet, as contacts look at them before they are opened. If one plane separates all that is
// below them, or what is below each is as good as in a plane and the planes are parallel, all pairs of triangles below
// them have one normal, and of their points only those count that are the farthest out in the plane: what cannot reach
// beyond the points that are known need not be looked at. So two coplanar surfaces cost as much as their outline, not
// as all their triangles.
//
// Not certified: it is asked once it is certain that the bodies meet.
#pragma once

#include "query/collide/search.hpp"
#include "query/contacts/manifold.hpp"

#include <glm/vec3.hpp>

#include <cstdint>

namespace prolate::query {

class NodePair {
public:
    NodePair(const CollideSearch& search, uint32_t node_a, uint32_t node_b) noexcept;

    /// If both are flat, and parallel: their normal, of length 1, either of the two, in A's frame. Else 0, as also of
    /// parts of flat nodes that are too small to say so again.
    glm::dvec3 normal() const noexcept;
    /// How far what is below A's node reaches beyond the first of what is below B's along n, of length 1; not less.
    double overlap(const glm::dvec3& n) const noexcept;
    /// Where along d, in A's frame, points of contact may lie.
    Extent extent(const glm::dvec3& d) const noexcept;
    /// Triangles below the two.
    uint64_t triangles() const noexcept;

private:
    const CollideSearch& s_;
    NodeWithHull a_, b_;
};

} // namespace prolate::query
