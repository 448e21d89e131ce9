// Queries about trees at many poses: collide, distance, sweep, raycast, overlap.
#include "python/src/batch.hpp"
#include "python/src/poses.hpp"
#include "python/src/tree.hpp"

#include <prolate/bounds.hpp>
#include <prolate/collide.hpp>
#include <prolate/distance.hpp>
#include <prolate/raycast.hpp>
#include <prolate/shapes.hpp>
#include <prolate/sweep.hpp>

#include <cmath>
#include <limits>

namespace prolate::python {
namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();

// margin, max_level and budget of a call.
struct Limits {
    double margin;
    uint32_t max_level;
    uint64_t budget;

    Limits(nb::handle margin_, nb::handle max_level_, nb::handle budget_)
        : margin(number_from_0(margin_, "margin")),
          max_level(static_cast<uint32_t>(whole_or(max_level_, "max_level", 0, UINT32_MAX, kMaxLevels))),
          budget(whole_or(budget_, "budget", 0, UINT64_MAX, UINT64_MAX)) {}

    QueryOptions options(double slack) const noexcept {
        return {.max_level = max_level, .max_pair_tests = budget, .margin = rounded_up(margin + slack)};
    }
};

// Two bodies at N poses.
struct Bodies {
    const HeldTree &a, &b;
    Poses poses_a, poses_b;
    size_t count;

    Bodies(nb::handle tree_a, nb::handle at_a, nb::handle tree_b, nb::handle at_b, bool wxyz)
        : a(tree_of(tree_a, "a")), b(tree_of(tree_b, "b")), poses_a(at_a, "poses_a", wxyz),
          poses_b(at_b, "poses_b", wxyz), count(broadcast(poses_a, "poses_a", poses_b, "poses_b")) {}

    bool single() const noexcept { return poses_a.single() && poses_b.single(); }
    bool far_apart(size_t i, double margin) const noexcept {
        return python::far_apart(poses_a, a.reach, poses_b, b.reach, margin, i);
    }
    PlacedBodies placed(size_t i) const noexcept { return place(poses_a, a.reach, poses_b, b.reach, i); }
};

nb::object collide_trees(nb::handle a, nb::handle poses_a, nb::handle b, nb::handle poses_b, nb::handle margin,
                         nb::handle max_level, nb::handle budget, nb::handle threads, nb::handle out, bool wxyz) {
    const Bodies bodies(a, poses_a, b, poses_b, wxyz);
    const Limits limits(margin, max_level, budget);
    const auto verdict_of = [&](size_t i, QueryContext& context) {
        if (limits.budget > 0 && bodies.far_apart(i, limits.margin)) return static_cast<uint8_t>(Verdict::separated);
        const PlacedBodies at = bodies.placed(i);
        return static_cast<uint8_t>(
            collide(bodies.a.view, at.a, bodies.b.view, at.b, context, limits.options(at.slack)).verdict);
    };
    if (bodies.single() && out.is_none()) {
        uint8_t verdict = 0;
        {
            const nb::gil_scoped_release released;
            verdict = verdict_of(0, thread_context());
        }
        return nb::int_(verdict);
    }
    const OutBytes results = out_bytes(out, bodies.count);
    for_all(bodies.count, thread_count(threads),
            [&](size_t i, QueryContext& context) { results.data[i] = verdict_of(i, context); });
    return results.array;
}

void store(double* at, const Point& p) noexcept {
    std::copy(p.begin(), p.end(), at);
}

// Arrays of what is known of N pairs of points.
struct PairArrays {
    size_t count;
    std::unique_ptr<double[]> lower, upper, point_a, point_b, normal;
    std::unique_ptr<uint8_t[]> verdict;

    explicit PairArrays(size_t n)
        : count(n), lower(new_array<double>(n)), upper(new_array<double>(n)), point_a(new_array<double>(3 * n)),
          point_b(new_array<double>(3 * n)), normal(new_array<double>(3 * n)), verdict(new_array<uint8_t>(n)) {}

    template <class Result> void store_points(size_t i, const Result& r, bool known, const PlacedBodies& at) noexcept {
        const double nan = std::numeric_limits<double>::quiet_NaN();
        const Point unknown = {nan, nan, nan};
        store(&point_a[3 * i], known ? at.to_world(r.point_a) : unknown);
        store(&point_b[3 * i], known ? at.to_world(r.point_b) : unknown);
        store(&normal[3 * i], known ? at.direction_to_world(r.normal) : unknown);
    }
    nb::tuple take() {
        const size_t n = count;
        return nb::make_tuple(to_numpy(std::move(lower), {n}), to_numpy(std::move(upper), {n}),
                              to_numpy(std::move(point_a), {n, 3}), to_numpy(std::move(point_b), {n, 3}),
                              to_numpy(std::move(normal), {n, 3}), to_numpy(std::move(verdict), {n}));
    }
};

nb::tuple distance_trees(nb::handle a, nb::handle poses_a, nb::handle b, nb::handle poses_b, nb::handle tolerance,
                         nb::handle max_distance, nb::handle max_level, nb::handle budget, nb::handle threads,
                         bool wxyz) {
    const Bodies bodies(a, poses_a, b, poses_b, wxyz);
    DistanceOptions options;
    options.tolerance_relative = number_from_0(tolerance, "tolerance");
    options.max_level = static_cast<uint32_t>(whole_or(max_level, "max_level", 0, UINT32_MAX, kMaxLevels));
    options.max_pair_tests = whole_or(budget, "budget", 0, UINT64_MAX, UINT64_MAX);
    const double most = max_distance.is_none() ? kInfinite : number_from_0(max_distance, "max_distance");
    PairArrays out(bodies.count);
    for_all(bodies.count, thread_count(threads), [&](size_t i, QueryContext& context) {
        const PlacedBodies at = bodies.placed(i);
        DistanceOptions here = options;
        here.max_distance = most + at.slack;
        const DistanceResult r = distance(bodies.a.view, at.a, bodies.b.view, at.b, context, here);
        out.lower[i] = std::max(0.0, r.lower - at.slack);
        out.upper[i] = r.upper + at.slack;
        const bool near = r.verdict == Verdict::separated && !(out.lower[i] > 0); // as collide() has it
        out.verdict[i] = static_cast<uint8_t>(near ? Verdict::overlapping : r.verdict);
        out.store_points(i, r, std::isfinite(r.upper) && !r.enclosed, at);
    });
    return nb::make_tuple(out.take(), bodies.single());
}

// ---- sweep ----

// A motion between two poses, rounded in `frame`, and by how much that moves any of its points at most.
struct RoundedMotion {
    Motion motion;
    double slack;
};
RoundedMotion motion_in(const DoublePose& frame, const DoublePose& start, const DoublePose& end,
                        double reach) noexcept {
    const RoundedPose from = in_frame(frame, start, reach), to = in_frame(frame, end, reach);
    // In between, a point is off by no more than at both ends together, the turn of at most pi between them included;
    // motion_between() rounds once more, at most by as much.
    const double rounding =
        0x1p-22 * (reach + std::hypot(from.pose.translation.x, from.pose.translation.y, from.pose.translation.z) +
                   std::hypot(to.pose.translation.x, to.pose.translation.y, to.pose.translation.z));
    return {motion_between(from.pose, to.pose), 4 * (from.slack + to.slack) + rounding};
}

nb::tuple sweep_trees(nb::handle a, nb::handle start_a, nb::handle end_a, nb::handle b, nb::handle start_b,
                      nb::handle end_b, nb::handle margin, nb::handle tolerance, nb::handle max_level,
                      nb::handle budget, nb::handle threads, bool wxyz) {
    const HeldTree &tree_a = tree_of(a, "a"), &tree_b = tree_of(b, "b");
    const Poses from_a(start_a, "start_a", wxyz), to_a(end_a, "end_a", wxyz), from_b(start_b, "start_b", wxyz),
        to_b(end_b, "end_b", wxyz);
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
        const RoundedMotion motion_a = motion_in(at.frame, from_a.at(i), to_a.at(i), tree_a.reach);
        const RoundedMotion motion_b = motion_in(at.frame, from_b.at(i), to_b.at(i), tree_b.reach);
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
    return {{}, {vec(local_origin), vec(local_direction)}, true};
}

nb::tuple raycast_tree(nb::handle tree, nb::handle pose, nb::handle origins, nb::handle directions, nb::handle radius,
                       nb::handle max_t, nb::handle max_level, nb::handle budget, nb::handle threads, bool wxyz) {
    const HeldTree& held = tree_of(tree, "tree");
    const Poses poses(pose, "pose", wxyz);
    const Rows<double> origin = rows_of_doubles(origins, "origins", 3, true),
                       direction = rows_of_doubles(directions, "directions", 3, true);
    const size_t count = std::max({poses.count(), origin.count, direction.count});
    for (const size_t n : {poses.count(), origin.count, direction.count})
        if (n != count && n != 1) value_error("raycast", "pose, origins and directions must be as many, or one");
    for (size_t i = 0; i < direction.count; ++i)
        if (direction.values[3 * i] == 0 && direction.values[3 * i + 1] == 0 && direction.values[3 * i + 2] == 0)
            value_error("directions[" + std::to_string(i) + "]", "is 0");
    const Limits limits(radius, max_level, budget);
    const float most_t =
        max_t.is_none() ? std::numeric_limits<float>::infinity() : rounded_up(number_from_0(max_t, "max_t"));
    auto t = new_array<double>(count), point = new_array<double>(3 * count), normal = new_array<double>(3 * count);
    auto node = new_array<int64_t>(count), triangle = new_array<int64_t>(count);
    auto verdict = new_array<uint8_t>(count);
    for_all(count, thread_count(threads), [&](size_t i, QueryContext& context) {
        const double* const o = &origin.values[3 * (origin.count == 1 ? 0 : i)];
        const double* const d = &direction.values[3 * (direction.count == 1 ? 0 : i)];
        PlacedRay at = placed_ray(poses, i, o, d);
        at.ray.max_t = most_t;
        const RaycastResult r = raycast(held.view, at.pose, at.ray, context, limits.options(0));
        const bool hit = std::isfinite(r.t);
        t[i] = r.t;
        verdict[i] = static_cast<uint8_t>(r.verdict);
        node[i] = hit ? int64_t{r.node} : -1;
        triangle[i] = hit && r.triangle != kNoTriangle ? int64_t{r.triangle} : -1;
        const Point local = {r.normal.x, r.normal.y, r.normal.z};
        const Point n = at.in_frame ? rotated(poses.at(i), local) : local;
        for (size_t k = 0; k < 3; ++k) {
            point[3 * i + k] = hit ? o[k] + r.t * d[k] : std::numeric_limits<double>::quiet_NaN();
            normal[3 * i + k] = hit ? n[k] : std::numeric_limits<double>::quiet_NaN();
        }
    });
    const bool single = poses.single() && origin.single && direction.single;
    return nb::make_tuple(nb::make_tuple(to_numpy(std::move(t), {count}), to_numpy(std::move(point), {count, 3}),
                                         to_numpy(std::move(normal), {count, 3}), to_numpy(std::move(node), {count}),
                                         to_numpy(std::move(triangle), {count}), to_numpy(std::move(verdict), {count})),
                          single);
}

// ---- overlap ----

Vec3 rounded(const Point& p, double& slack) noexcept {
    const Vec3 out{static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])};
    slack += std::hypot(p[0] - out.x, p[1] - out.y, p[2] - out.z);
    return out;
}

// The shapes of python/prolate/_queries.py, as their numbers in the world. Each is taken into the body's frame.
class Shape {
public:
    Shape(char kind, std::span<const double> numbers) : kind_(kind), n_(numbers) {}

    Verdict overlap_with(const HeldTree& held, const DoublePose& body, const Limits& limits,
                         QueryContext& context) const noexcept {
        double slack = 0;
        const auto local = [&](size_t i) {
            const Point d = {n_[i] - body.t[0], n_[i + 1] - body.t[1], n_[i + 2] - body.t[2]};
            slack += 0x1p-46 * std::hypot(d[0], d[1], d[2]);
            return rounded(rotated_back(body, d), slack);
        };
        const auto ask = [&](const auto& shape) {
            return overlap(held.view, {}, shape, context, limits.options(slack)).verdict;
        };
        if (kind_ == 's') {
            const Vec3 center = local(0);
            return ask(Sphere{center, rounded_up(n_[3])});
        }
        if (kind_ == 'c') {
            const Vec3 a = local(0), b = local(3);
            return ask(Capsule{a, b, rounded_up(n_[6])});
        }
        if (kind_ == 'b') {
            const RoundedPose box =
                in_frame(body, {{n_[0], n_[1], n_[2]}, {n_[3], n_[4], n_[5], n_[6]}}, std::hypot(n_[7], n_[8], n_[9]));
            slack = box.slack;
            return ask(Box{box.pose, {rounded_up(n_[7]), rounded_up(n_[8]), rounded_up(n_[9])}});
        }
        const double length = std::hypot(n_[0], n_[1], n_[2]);
        const Point normal = {n_[0] / length, n_[1] / length, n_[2] / length};
        const double below = n_[3] / length - (normal[0] * body.t[0] + normal[1] * body.t[1] + normal[2] * body.t[2]);
        double bent = 0;
        const Vec3 local_normal = rounded(rotated_back(body, normal), bent);
        // Near the body, the rounded plane deviates by what its normal is off, times the distance from the origin.
        slack = 4 * (bent + 0x1p-46) * (held.reach + std::abs(below));
        return ask(HalfSpace{local_normal, rounded_up(below)});
    }

private:
    char kind_;
    std::span<const double> n_;
};

nb::object overlap_shape(nb::handle tree, nb::handle poses_, const char* kind_, nb::handle numbers, nb::handle margin,
                         nb::handle max_level, nb::handle budget, nb::handle threads, nb::handle out, bool wxyz) {
    const HeldTree& held = tree_of(tree, "tree");
    const Poses poses(poses_, "poses", wxyz);
    const char kind = *kind_;
    const size_t columns = kind == 's' || kind == 'h' ? 4 : kind == 'c' ? 7 : 10;
    const Rows<double> row = rows_of_doubles(numbers, "shape", columns, true);
    const Shape shape(kind, row.values);
    const Limits limits(margin, max_level, budget);
    const OutBytes results = out_bytes(out, poses.count());
    for_all(poses.count(), thread_count(threads), [&](size_t i, QueryContext& context) {
        results.data[i] = static_cast<uint8_t>(shape.overlap_with(held, poses.at(i), limits, context));
    });
    if (poses.single() && out.is_none()) return nb::int_(results.data[0]);
    return results.array;
}

// (lower (N, 3), upper (N, 3))
nb::tuple bounds_of(nb::handle tree, nb::handle poses_, nb::handle margin, bool wxyz) {
    const HeldTree& held = tree_of(tree, "tree");
    const Poses poses(poses_, "poses", wxyz);
    const double wide = number_from_0(margin, "margin");
    const size_t n = poses.count();
    auto lower = new_array<double>(3 * n), upper = new_array<double>(3 * n);
    for (size_t i = 0; i < n; ++i) {
        // The body is only turned; the box is moved in double precision, outward.
        const DoublePose pose = poses.at(i), turn{{0, 0, 0}, {pose.q[0], pose.q[1], pose.q[2], pose.q[3]}};
        const RoundedPose at = in_frame({}, turn, held.reach);
        const Bounds box = bounds(held.view, at.pose, rounded_up(wide + at.slack));
        const double low[3] = {box.lower.x, box.lower.y, box.lower.z},
                     high[3] = {box.upper.x, box.upper.y, box.upper.z};
        for (size_t k = 0; k < 3; ++k) {
            lower[3 * i + k] = std::nextafter(low[k] + pose.t[k], -kInfinite);
            upper[3 * i + k] = std::nextafter(high[k] + pose.t[k], kInfinite);
        }
    }
    return nb::make_tuple(to_numpy(std::move(lower), {n, 3}), to_numpy(std::move(upper), {n, 3}), poses.single());
}

} // namespace

void bind_queries(nb::module_& m) {
    m.def("collide", &collide_trees, nb::arg("a").none(), nb::arg("poses_a").none(), nb::arg("b").none(),
          nb::arg("poses_b").none(), nb::arg("margin").none(), nb::arg("max_level").none(), nb::arg("budget").none(),
          nb::arg("threads").none(), nb::arg("out").none(), nb::arg("wxyz"));
    m.def("distance", &distance_trees, nb::arg("a").none(), nb::arg("poses_a").none(), nb::arg("b").none(),
          nb::arg("poses_b").none(), nb::arg("tolerance").none(), nb::arg("max_distance").none(),
          nb::arg("max_level").none(), nb::arg("budget").none(), nb::arg("threads").none(), nb::arg("wxyz"));
    m.def("sweep", &sweep_trees, nb::arg("a").none(), nb::arg("start_a").none(), nb::arg("end_a").none(),
          nb::arg("b").none(), nb::arg("start_b").none(), nb::arg("end_b").none(), nb::arg("margin").none(),
          nb::arg("tolerance").none(), nb::arg("max_level").none(), nb::arg("budget").none(), nb::arg("threads").none(),
          nb::arg("wxyz"));
    m.def("raycast", &raycast_tree, nb::arg("tree").none(), nb::arg("pose").none(), nb::arg("origins").none(),
          nb::arg("directions").none(), nb::arg("radius").none(), nb::arg("max_t").none(), nb::arg("max_level").none(),
          nb::arg("budget").none(), nb::arg("threads").none(), nb::arg("wxyz"));
    m.def("overlap", &overlap_shape, nb::arg("tree").none(), nb::arg("poses").none(), nb::arg("kind"),
          nb::arg("numbers").none(), nb::arg("margin").none(), nb::arg("max_level").none(), nb::arg("budget").none(),
          nb::arg("threads").none(), nb::arg("out").none(), nb::arg("wxyz"));
    m.def("bounds", &bounds_of, nb::arg("tree").none(), nb::arg("poses").none(), nb::arg("margin").none(),
          nb::arg("wxyz"));
}

} // namespace prolate::python
