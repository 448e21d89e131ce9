// sweep(): the query around the traversal (search.cpp). Bodies are taken in their canonical order.
#include "query/sweep/search.hpp"

#include <algorithm>

namespace prolate {
namespace {

// The whole query with the bodies in their fixed order.
SweepResult run(query::SweepSearch& search, const Motion& motion_a) {
    SweepResult out;
    if (!search.motion.finite()) return out;
    query::traverse(search);
    out.time_lower = search.complete ? search.horizon : std::min(search.open, search.horizon);
    if (search.complete) out.verdict = search.found ? Verdict::overlapping : Verdict::separated;
    if (search.enclosure == Verdict::overlapping)
        out.verdict = Verdict::overlapping, out.enclosed = !search.found, out.time_lower = 0;
    search.stats.deepest_level = std::max(search.a.deepest_level(), search.b.deepest_level());
    out.stats = search.stats;
    if (out.enclosed) {
        out.time_upper = 0;
    } else if (search.found) {
        out.time_upper = search.horizon, out.distance = search.distance, out.pair = search.witness;
        const query::MovingBody& a = search.motion.a();
        const glm::dmat3 rotation = a.rotation(search.horizon);
        const glm::dvec3 center = query::to_double(motion_a.start.translation) + a.center_at(search.horizon);
        out.point_a = query::to_float(rotation * (search.on_a - a.center()) + center);
        out.point_b = query::to_float(rotation * (search.on_b - a.center()) + center);
        out.normal = query::to_float(rotation * search.normal);
    }
    return out;
}

} // namespace

SweepResult sweep(const TreeView& a, const Motion& motion_a, const TreeView& b, const Motion& motion_b, Scratch context,
                  const SweepOptions& options) noexcept {
    if (!query::suffices(context, a, b)) return {};
    const double radii = double{a.radius()} + b.radius();
    SweepOptions of_cores = options;
    if (radii > 0) { // the core of a ball has no size
        of_cores.margin = query::with_radius(query::sound_length(options.margin), radii);
        const auto size = [](const TreeView& tree) {
            return query::place(tree.root(), tree.scale()).size + tree.radius();
        };
        if (!(options.tolerance > 0)) of_cores.tolerance = query::kSweepTolerance * std::min(size(a), size(b));
    }
    const auto bodies = query::in_canonical_order(a, motion_a, b, motion_b);
    query::SweepSearch search(bodies, context, of_cores);
    SweepResult out = run(search, bodies.place_a);
    if (bodies.exchanged) query::exchange_bodies(out);
    if (radii > 0) query::round_sweep(out, a.radius(), b.radius());
    return out;
}

} // namespace prolate
