// Two nodes of two trees that meet, as contacts look at them before they are opened. If one plane separates all that is
// below them, or what is below each is as good as in a plane and the planes are parallel, all pairs of triangles below
// them have one normal, and of their points only those count that are the farthest out in the plane: what cannot reach
// beyond the points that are known need not be looked at. So two coplanar surfaces cost as much as their outline, not
// as all their triangles.
//
// Not certified: it is asked once it is certain that the bodies meet.
#pragma once

#include "query/collide/search.hpp"
#include "query/contacts/bodies.hpp"

#include <glm/vec3.hpp>

#include <cstdint>
#include <optional>

namespace prolate::query {

class NodePair {
public:
    NodePair(const CollideSearch& search, uint32_t node_a, uint32_t node_b) noexcept;

    /// If both are flat, and parallel: their normal, of length 1, either of the two, in A's frame. Else 0, as also of
    /// parts of flat nodes that are too small to say so again.
    glm::dvec3 normal() const noexcept;
    /// How far what is below A's node reaches beyond the first of what is below B's along n, of length 1; not less.
    double overlap(const glm::dvec3& n) const noexcept;
    /// Where along d, in A's frame, points of contact may lie, up to `beside` beside both.
    Extent extent(const glm::dvec3& d, double beside) const noexcept;
    /// Do they only touch along the way, or does it resolve all pairs below them, if they are flat, with their normal?
    /// Keeps normal() once it has asked for it.
    bool resolved_by(const Way& way, double same_point, std::optional<glm::dvec3>& normal) const noexcept;
    /// Triangles below the two.
    uint64_t triangles() const noexcept;

private:
    const CollideSearch& s_;
    NodeWithHull a_, b_;
};

/// Keeps those of up to a block of pairs of nodes that gain(entry) says are above 0, in ascending order. Returns their
/// end.
template <class Gain> Scratch::Entry* keep_gains(Scratch::Entry* begin, Scratch::Entry* end, Gain&& gain) {
    double gains[kBlockLanes];
    uint32_t count = 0;
    for (const Scratch::Entry* from = begin; from < end; ++from) {
        Scratch::Entry e = *from;
        const double of_e = gain(e);
        if (!(of_e > 0)) continue;
        uint32_t at = count++;
        for (; at > 0 && gains[at - 1] > of_e; --at) gains[at] = gains[at - 1], begin[at] = begin[at - 1];
        gains[at] = of_e, begin[at] = e;
    }
    return begin + count;
}

} // namespace prolate::query
