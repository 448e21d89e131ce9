// distance() of a body and a half-space: the traversal (search.cpp) finds what is lowest; corners and ellipsoids are
// placed in double precision (lowest.hpp).
#include <prolate/half_space.hpp>

#include "query/distance/rounded.hpp"
#include "query/half_space/lowest.hpp"
#include "query/node/scratch.hpp"

#include <algorithm>
#include <cmath>

namespace prolate {
namespace {

DistanceResult of_core(const TreeView& tree, const Pose& pose, const HalfSpace& half_space, Scratch context,
                       const DistanceOptions& options) {
    DistanceResult out;
    const query::RelativePose to_world = query::world_pose(pose);
    const query::PlacedHalfSpace shape = query::place(half_space, to_world, 0);
    if (!query::is_finite(shape)) return out;
    query::HeightSearch search(tree, shape, context, {.max_pair_tests = options.max_pair_tests});
    search.limit = query::sound_length(options.max_distance);
    query::Lowest lowest(search);
    query::traverse(search);
    out.stats = search.stats;
    out.stats.deepest_level = search.side.deepest_level();
    const double cut = std::min(lowest.lower, query::sound_length(options.max_distance));
    out.lower = std::max(0.0, std::min(cut, search.open));
    if (lowest.height < HUGE_VAL)
        out.upper = std::max(0.0, lowest.meets ? lowest.height : lowest.height + lowest.slack);
    if (lowest.meets)
        out.verdict = Verdict::overlapping, out.lower = 0;
    else if (out.lower > 0)
        out.verdict = Verdict::separated;
    const auto world = [&](const glm::dvec3& p) {
        return query::to_float(to_world.rotation * p + to_world.translation);
    };
    out.pair = lowest.pair;
    out.point_a = world(lowest.point);
    out.point_b = world(lowest.point - std::max(0.0, lowest.height) * shape.normal);
    if (out.upper > 0) out.normal = query::to_float(to_world.rotation * -shape.normal);
    return out;
}

} // namespace

DistanceResult distance(const TreeView& tree, const Pose& pose, const HalfSpace& half_space, Scratch context,
                        const DistanceOptions& options) noexcept {
    if (!query::suffices(context, tree)) return {};
    const double radius = tree.radius();
    if (!(radius > 0)) return of_core(tree, pose, half_space, context, options);
    DistanceOptions limits = options;
    limits.max_distance = query::sound_length(options.max_distance) + radius;
    DistanceResult out = of_core(tree, pose, half_space, context, limits);
    query::round_distance(out, tree.radius(), 0, options,
                          [&](const QueryOptions& o) { return overlap(tree, pose, half_space, context, o); });
    return out;
}

} // namespace prolate
