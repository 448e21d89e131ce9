// What the traversal's float bounds leave open is decided here, in double precision.
#include "query/raycast/search.hpp"

#include <optional>

namespace prolate::query {

bool RaycastSearch::meet(uint32_t at) noexcept {
    const auto take = [&](const std::optional<RayHit>& hit, uint32_t t) {
        if (!hit || (found && !(hit->t < best.t))) return false;
        found = true, best = *hit, node = at, triangle = t;
        return true;
    };
    const TriangleRange triangles = side.tree.triangles(at);
    const auto hit_by = [&](const auto& leaf) {
        if (!(options.margin > 0)) return hit(ray, leaf);
        PlacedRay still_open = ray; // what lies behind the best hit takes less time
        if (found) still_open.length = best.t;
        return hit_within(double{options.margin}, still_open, leaf);
    };
    if (triangles.count == 0 || growth)
        return take(hit_by(place(growth ? side.tree.ellipsoid(at) : side.tree.bound(at), side.tree.scale())),
                    kNoTriangle);
    bool taken = false;
    stats.triangle_tests += triangles.count;
    for (uint32_t t = triangles.first; t < triangles.first + triangles.count; ++t)
        taken = take(hit_by(place(side.tree, t)), t) || taken;
    return taken;
}

} // namespace prolate::query
