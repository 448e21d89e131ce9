// Queries about trees at many poses: collide, distance, sweep, raycast.
#include "python/src/answers.hpp"
#include "python/src/batch.hpp"
#include "python/src/bodies.hpp"

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
    DistanceOptions options;
    options.tolerance_relative = number_from_0(tolerance, "tolerance");
    options.max_level = static_cast<uint32_t>(whole_or(max_level, "max_level", 0, UINT32_MAX, kMaxLevels));
    options.max_pair_tests = whole_or(budget, "budget", 0, UINT64_MAX, UINT64_MAX);
    const double most =
        max_distance.is_none() ? std::numeric_limits<double>::infinity() : number_from_0(max_distance, "max_distance");
    PairArrays out(bodies.count());
    for_all(bodies.count(), thread_count(threads), [&](size_t i, QueryContext& context) {
        const PlacedBodies at = bodies.placed(i);
        DistanceOptions here = options;
        here.max_distance = most + at.slack;
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

// ---- raycast ----

struct PlacedRay {
    Pose pose;
    Ray ray;
    bool in_frame = false;
    double scale = 1; ///< of the direction
};
// As given, if floats hold all of it; else taken into the body's frame in double precision and rounded there.
PlacedRay placed_ray(const Poses& poses, size_t i, const double* origin, const double* direction) noexcept {
    const auto vec = [](const Point& p) {
        return Vec3{static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])};
    };
    const auto exact = [](const double* p) {
        return std::all_of(p, p + 3, [](double x) { return static_cast<double>(static_cast<float>(x)) == x; });
    };
    const Point o = {origin[0], origin[1], origin[2]}, d = {direction[0], direction[1], direction[2]};
    if (poses.floats() && exact(origin) && exact(direction)) return {poses.floats()[poses.index(i)], {vec(o), vec(d)}};
    const DoublePose pose = poses.at(i);
    const double most = std::max({std::abs(d[0]), std::abs(d[1]), std::abs(d[2])});
    const double scale = most > 1e-30 && most < 1e30 ? 1 : 1 / most; // floats hold the direction's length
    const Point local_origin = rotated_back(pose, {o[0] - pose.t[0], o[1] - pose.t[1], o[2] - pose.t[2]});
    const Point local_direction = rotated_back(pose, {d[0] * scale, d[1] * scale, d[2] * scale});
    return {{}, {vec(local_origin), vec(local_direction)}, true, scale};
}

nb::tuple raycast_tree(nb::handle tree, nb::handle pose, nb::handle origins, nb::handle directions, nb::handle radius,
                       nb::handle max_t, nb::handle max_level, nb::handle budget, nb::handle threads,
                       nb::handle order) {
    const HeldTree& held = tree_of(tree, "tree");
    const Poses poses(pose, "pose", order);
    const Rows<double> origin = rows_of_doubles(origins, "origins", 3, true),
                       direction = rows_of_doubles(directions, "directions", 3, true);
    const size_t count = std::max({poses.count(), origin.count, direction.count});
    for (const size_t n : {poses.count(), origin.count, direction.count})
        if (n != count && n != 1) value_error("raycast", "pose, origins and directions must be as many, or one");
    for (size_t i = 0; i < direction.count; ++i)
        if (direction.values[3 * i] == 0 && direction.values[3 * i + 1] == 0 && direction.values[3 * i + 2] == 0)
            value_error("directions[" + std::to_string(i) + "]", "is 0");
    const Limits limits(radius, max_level, budget, "radius");
    const double most_t = max_t.is_none() ? std::numeric_limits<double>::infinity() : number_from_0(max_t, "max_t");
    HitArrays out(count);
    for_all(count, thread_count(threads), [&](size_t i, QueryContext& context) {
        const double* const o = &origin.values[3 * (origin.count == 1 ? 0 : i)];
        const double* const d = &direction.values[3 * (direction.count == 1 ? 0 : i)];
        PlacedRay at = placed_ray(poses, i, o, d);
        at.ray.max_t = rounded_up(most_t / at.scale);
        const RaycastResult r = raycast(held.view, at.pose, at.ray, context, limits.options(0));
        const Point local = {r.normal.x, r.normal.y, r.normal.z};
        out.store(i, r, r.t * at.scale, o, d, at.in_frame ? rotated(poses.at(i), local) : local);
    });
    const bool single = poses.single() && origin.single && direction.single;
    return nb::make_tuple(out.take(), single);
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
