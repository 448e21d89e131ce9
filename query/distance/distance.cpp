// distance(): the query around the traversal (search.cpp). Bodies are taken in their canonical order, and a
// DistanceCache names the leaves to be looked at first.
#include "query/distance/rounded.hpp"
#include "query/distance/state.hpp"

#include <algorithm>
#include <cmath>

namespace prolate {
namespace {

using query::to_float;

// The whole query with the bodies in their fixed order.
DistanceResult run(query::DistanceSearch& search, const Pose& pose_a, const MeetingPair* first) {
    DistanceResult out;
    if (!std::isfinite(search.b_to_a.distance)) return out;
    // If the budget does not hold even what an earlier query found, it is spent: another way to go on would end
    // elsewhere.
    if (first != nullptr && !search.try_first(*first)) return out;
    if (!search.overlapping) query::traverse(search);
    out.pair = search.witness, out.upper = search.upper;
    if (search.overlapping || search.enclosure == Verdict::overlapping) {
        out.verdict = Verdict::overlapping, out.enclosed = !search.overlapping;
    } else if (search.enclosure == Verdict::separated) {
        out.lower = search.lower();
        if (out.lower > 0) out.verdict = Verdict::separated;
    }
    search.stats.deepest_level = std::max(search.a.deepest_level(), search.b.deepest_level());
    out.stats = search.stats;
    const query::RelativePose to_world = query::relative_pose(Pose{}, pose_a);
    out.point_a = to_float(to_world.rotation * search.on_a + to_world.translation);
    out.point_b = to_float(to_world.rotation * search.on_b + to_world.translation);
    out.normal = to_float(to_world.rotation * search.normal);
    return out;
}

DistanceResult of_cores(const TreeView& a, const Pose& pose_a, const TreeView& b, const Pose& pose_b, Scratch context,
                        const DistanceOptions& options, DistanceCache* cache) {
    const auto bodies = query::in_canonical_order(a, pose_a, b, pose_b);
    MeetingPair first;
    const bool has_first = cache != nullptr && cache->valid;
    if (has_first) first = bodies.exchanged ? query::exchanged(cache->pair) : cache->pair;
    query::DistanceSearch search(bodies, context, options);
    DistanceResult out = run(search, bodies.place_a, has_first ? &first : nullptr);
    if (bodies.exchanged) query::exchange_bodies(out);
    if (cache != nullptr && out.upper < query::DistanceSearch::kInfinity && !out.enclosed)
        *cache = {.valid = true, .pair = out.pair};
    return out;
}

// Of bodies that are all within a radius of their cores: what is known of these, less both radii. Where that says
// nothing, collide() knows whether they meet.
DistanceResult of_rounded(const TreeView& a, const Pose& pose_a, const TreeView& b, const Pose& pose_b, Scratch context,
                          const DistanceOptions& options, DistanceCache* cache) {
    const double radii = double{a.radius()} + b.radius();
    DistanceOptions limits = options;
    limits.max_distance = query::sound_length(options.max_distance) + radii;
    DistanceResult out = of_cores(a, pose_a, b, pose_b, context, limits, cache);
    query::round_distance(out, a.radius(), b.radius(), options,
                          [&](const QueryOptions& o) { return collide(a, pose_a, b, pose_b, context, o); });
    return out;
}

} // namespace

DistanceResult distance(const TreeView& a, const Pose& pose_a, const TreeView& b, const Pose& pose_b, Scratch context,
                        const DistanceOptions& options, DistanceCache* cache) noexcept {
    if (!query::suffices(context, a, b)) return {};
    const bool rounded = a.radius() > 0 || b.radius() > 0;
    return (rounded ? of_rounded : of_cores)(a, pose_a, b, pose_b, context, options, cache);
}

} // namespace prolate
