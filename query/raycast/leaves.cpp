// What the traversal's float bounds leave open is decided here, in double precision.
#include "query/raycast/search.hpp"

#include <optional>

namespace prolate::query {

namespace {

template <class Leaf> std::optional<RayHit> hit_by(const RaycastSearch& search, const Leaf& leaf) {
    const double margin = double{search.body.options.margin};
    if (!(margin > 0)) return hit(search.ray, leaf);
    PlacedRay still_open = search.ray; // what lies behind the best hit takes less time
    if (search.found) still_open.length = search.best.t;
    return hit_within(margin, still_open, leaf);
}

void take(RaycastSearch& search, const std::optional<RayHit>& hit, uint32_t leaf, uint32_t triangle) {
    if (!hit || (search.found && !(hit->t < search.best.t))) return;
    search.found = true, search.best = *hit, search.node = leaf, search.triangle = triangle;
}

} // namespace

void RaycastSearch::meet(uint32_t at) noexcept {
    const TreeView& tree = body.side.tree;
    const PlacedEllipsoid e = place(body.growth ? tree.ellipsoid(at) : tree.bound(at), tree.scale());
    take(*this, hit_by(*this, e), at, kNoTriangle);
}

void RaycastSearch::meet_triangle(uint32_t leaf, uint32_t t) noexcept {
    take(*this, hit_by(*this, place(body.side.tree, t)), leaf, t);
}

} // namespace prolate::query
