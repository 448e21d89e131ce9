// Queries about trees at many poses: collide, distance, sweep, raycast.
#include "python/src/answers.hpp"
#include "python/src/batch.hpp"
#include "python/src/bodies.hpp"
#include "python/src/rays.hpp"

#include <prolate/collide.hpp>
#include <prolate/distance.hpp>
#include <prolate/raycast.hpp>
#include <prolate/sweep.hpp>

#include <cmath>
#include <limits>

namespace prolate::python {
namespace {

nb::object collide_trees(nb::handle a, nb::handle poses_a, nb::handle b, nb::handle poses_b, nb::handle margin,
                         nb::handle max_level, nb::handle budget, nb::handle threads, nb::handle out,
                         nb::handle order) {
    const Bodies bodies(a, poses_a, b, poses_b, order);
    const Limits limits(margin, max_level, budget);
    const auto verdict_of = [&](size_t i, QueryContext& context) {
        if (limits.budget > 0 && bodies.far_apart(i, limits.margin)) return static_cast<uint8_t>(Verdict::separated);
        const PlacedBodies at = bodies.placed(i);
        return static_cast<uint8_t>(
            collide(bodies.a(), at.a, bodies.b(), at.b, context, limits.options(at.slack)).verdict);
    };
    if (bodies.single() && out.is_none()) {
        uint8_t verdict = 0;
        {
            const nb::gil_scoped_release released;
            verdict = verdict_of(0, thread_context());
        }
        return nb::int_(verdict);
    }
    const OutBytes results = out_bytes(out, bodies.count());
    for_all(bodies.count(), thread_count(threads),
            [&](size_t i, QueryContext& context) { results.data[i] = verdict_of(i, context); });
    return results.array;
}

nb::tuple distance_trees(nb::handle a, nb::handle poses_a, nb::handle b, nb::handle poses_b, nb::handle tolerance,
                         nb::handle max_distance, nb::handle max_level, nb::handle budget, nb::handle threads,
                         nb::handle order) {
    const Bodies bodies(a, poses_a, b, poses_b, order);
    const DistanceOptions options = distance_options(tolerance, max_distance, max_level, budget);
    PairArrays out(bodies.count());
    for_all(bodies.count(), thread_count(threads), [&](size_t i, QueryContext& context) {
        const PlacedBodies at = bodies.placed(i);
        DistanceOptions here = options;
        here.max_distance += at.slack;
        const DistanceResult r = distance(bodies.a(), at.a, bodies.b(), at.b, context, here);
        out.store(i, r, at);
    });
    return nb::make_tuple(out.take(), bodies.single());
}

// ---- sweep ----

nb::tuple sweep_trees(nb::handle a, nb::handle start_a, nb::handle end_a, nb::handle b, nb::handle start_b,
                      nb::handle end_b, nb::handle margin, nb::handle tolerance, nb::handle max_level,
                      nb::handle budget, nb::handle threads, nb::handle order) {
    const HeldTree &tree_a = tree_of(a, "a"), &tree_b = tree_of(b, "b");
    const Poses from_a(start_a, "start_a", order), to_a(end_a, "end_a", order), from_b(start_b, "start_b", order),
        to_b(end_b, "end_b", order);
    const size_t count =
        std::max({broadcast(from_a, "start_a", to_a, "end_a"), broadcast(from_a, "start_a", from_b, "start_b"),
                  broadcast(to_a, "end_a", to_b, "end_b"), broadcast(from_b, "start_b", to_b, "end_b")});
    const Limits limits(margin, max_level, budget);
    const double near = number_from_0(tolerance, "tolerance");
    PairArrays out(count); // lower and upper are times
    auto gap = new_array<double>(count);
    for_all(count, thread_count(threads), [&](size_t i, QueryContext& context) {
        PlacedBodies at;
        at.in_frame = true;
        at.frame = from_a.at(i);
        const Frame frame(at.frame);
        const RoundedMotion motion_a = motion_in(frame, from_a.at(i), to_a.at(i), tree_a.reach);
        const RoundedMotion motion_b = motion_in(frame, from_b.at(i), to_b.at(i), tree_b.reach);
        const QueryOptions shared = limits.options(motion_a.slack + motion_b.slack);
        const SweepResult r = sweep(tree_a.view, motion_a.motion, tree_b.view, motion_b.motion, context,
                                    {.tolerance = near,
                                     .max_level = shared.max_level,
                                     .max_pair_tests = shared.max_pair_tests,
                                     .margin = shared.margin});
        out.lower[i] = r.time_lower;
        out.upper[i] = r.time_upper;
        gap[i] = std::isfinite(r.time_upper) ? r.distance : std::numeric_limits<double>::quiet_NaN();
        out.verdict[i] = static_cast<uint8_t>(r.verdict);
        out.store_points(i, r, std::isfinite(r.time_upper) && !r.enclosed, at);
    });
    const bool single = from_a.single() && to_a.single() && from_b.single() && to_b.single();
    return nb::make_tuple(out.take(), to_numpy(std::move(gap), {count}), single);
}

nb::tuple raycast_tree(nb::handle tree, nb::handle pose, nb::handle origins, nb::handle directions, nb::handle radius,
                       nb::handle max_t, nb::handle max_level, nb::handle budget, nb::handle threads,
                       nb::handle order) {
    const HeldTree& held = tree_of(tree, "tree");
    const Rays rays(pose, origins, directions, max_t, order);
    const Limits limits(radius, max_level, budget, "radius");
    return rays.cast(thread_count(threads), [&](size_t, const Pose& at, const Ray& ray, QueryContext& context) {
        return raycast(held.view, at, ray, context, limits.options(0));
    });
}

} // namespace

void bind_queries(nb::module_& m) {
    m.def("collide", &collide_trees, nb::arg("a").none(), nb::arg("poses_a").none(), nb::arg("b").none(),
          nb::arg("poses_b").none(), nb::arg("margin").none(), nb::arg("max_level").none(), nb::arg("budget").none(),
          nb::arg("threads").none(), nb::arg("out").none(), nb::arg("order").none());
    m.def("distance", &distance_trees, nb::arg("a").none(), nb::arg("poses_a").none(), nb::arg("b").none(),
          nb::arg("poses_b").none(), nb::arg("tolerance").none(), nb::arg("max_distance").none(),
          nb::arg("max_level").none(), nb::arg("budget").none(), nb::arg("threads").none(), nb::arg("order").none());
    m.def("sweep", &sweep_trees, nb::arg("a").none(), nb::arg("start_a").none(), nb::arg("end_a").none(),
          nb::arg("b").none(), nb::arg("start_b").none(), nb::arg("end_b").none(), nb::arg("margin").none(),
          nb::arg("tolerance").none(), nb::arg("max_level").none(), nb::arg("budget").none(), nb::arg("threads").none(),
          nb::arg("order").none());
    m.def("raycast", &raycast_tree, nb::arg("tree").none(), nb::arg("pose").none(), nb::arg("origins").none(),
          nb::arg("directions").none(), nb::arg("radius").none(), nb::arg("max_t").none(), nb::arg("max_level").none(),
          nb::arg("budget").none(), nb::arg("threads").none(), nb::arg("order").none());
}

} // namespace prolate::python
