// Solids at many poses: collide_solids, distance_solids, depth_solids.
#include "python/src/answers.hpp"
#include "python/src/batch.hpp"
#include "python/src/bodies.hpp"

#include <prolate/solids.hpp>

#include <algorithm>
#include <limits>

namespace prolate::python {
namespace {

// Poses that are rounded on their way are uncertain by `slack`, so that both verdicts hold of the poses as given.
SolidsOptions options_of(const Limits& limits, double slack) {
    return {.max_pair_tests = limits.budget, .margin = rounded_up(limits.margin), .uncertainty = rounded_up(slack)};
}

struct SolidBodies : Bodies {
    const Solid solid_a, solid_b;

    SolidBodies(nb::handle tree_a, nb::handle poses_a, nb::handle tree_b, nb::handle poses_b, nb::handle order,
                const Limits& limits)
        : Bodies(tree_a, poses_a, tree_b, poses_b, order), solid_a(a(), limits.max_level),
          solid_b(b(), limits.max_level) {}

    Verdict verdict_of(const PlacedBodies& at, QueryContext& context, const Limits& limits) const {
        return collide(solid_a, at.a, solid_b, at.b, context, options_of(limits, at.slack)).verdict;
    }
};

nb::object collide_solids_at(nb::handle a, nb::handle poses_a, nb::handle b, nb::handle poses_b, nb::handle margin,
                             nb::handle max_level, nb::handle budget, nb::handle threads, nb::handle order) {
    const Limits limits(margin, max_level, budget);
    const SolidBodies bodies(a, poses_a, b, poses_b, order, limits);
    auto verdicts = new_array<uint8_t>(bodies.count());
    for_all(bodies.count(), thread_count(threads), [&](size_t i, QueryContext& context) {
        verdicts[i] = static_cast<uint8_t>(bodies.verdict_of(bodies.placed(i), context, limits));
    });
    if (bodies.single()) return nb::int_(verdicts[0]);
    return to_numpy(std::move(verdicts), {bodies.count()});
}

// ((lower, upper, verdict), single)
nb::tuple distance_solids_at(nb::handle a, nb::handle poses_a, nb::handle b, nb::handle poses_b, nb::handle tolerance,
                             nb::handle max_distance, nb::handle max_level, nb::handle budget, nb::handle threads,
                             nb::handle order) {
    const Limits limits(nb::int_(0), max_level, budget);
    const SolidBodies bodies(a, poses_a, b, poses_b, order, limits);
    const double relative = number_from_0(tolerance, "tolerance");
    const double most =
        max_distance.is_none() ? std::numeric_limits<double>::infinity() : number_from_0(max_distance, "max_distance");
    const size_t n = bodies.count();
    auto lower = new_array<double>(n), upper = new_array<double>(n);
    auto verdicts = new_array<uint8_t>(n);
    for_all(n, thread_count(threads), [&](size_t i, QueryContext& context) {
        const PlacedBodies at = bodies.placed(i);
        const SolidsDistance r = distance(
            bodies.solid_a, at.a, bodies.solid_b, at.b, context,
            {.tolerance_relative = relative, .max_distance = most + at.slack, .max_pair_tests = limits.budget});
        Verdict verdict = r.verdict;
        if (verdict == Verdict::overlapping && at.slack > 0) verdict = bodies.verdict_of(at, context, limits);
        if (verdict == Verdict::separated && !(r.lower > at.slack)) verdict = Verdict::undecided;
        lower[i] = std::max(0.0, r.lower - at.slack);
        upper[i] = verdict == Verdict::overlapping ? r.upper : r.upper + at.slack;
        verdicts[i] = static_cast<uint8_t>(verdict);
    });
    return nb::make_tuple(nb::make_tuple(to_numpy(std::move(lower), {n}), to_numpy(std::move(upper), {n}),
                                         to_numpy(std::move(verdicts), {n})),
                          bodies.single());
}

// ((lower, upper, way out, verdict), single)
nb::tuple depth_solids_at(nb::handle a, nb::handle poses_a, nb::handle b, nb::handle poses_b, nb::handle max_level,
                          nb::handle budget, nb::handle threads, nb::handle order) {
    const Limits limits(nb::int_(0), max_level, budget);
    const SolidBodies bodies(a, poses_a, b, poses_b, order, limits);
    const size_t n = bodies.count();
    auto lower = new_array<double>(n), upper = new_array<double>(n), way_out = new_array<double>(3 * n);
    auto verdicts = new_array<uint8_t>(n);
    for_all(n, thread_count(threads), [&](size_t i, QueryContext& context) {
        const PlacedBodies at = bodies.placed(i);
        ContactManifolds manifolds;
        const SolidsContacts r =
            contacts(bodies.solid_a, at.a, bodies.solid_b, at.b, manifolds, context, options_of(limits, at.slack));
        lower[i] = r.depth_lower, upper[i] = r.depth_upper;
        store_point(&way_out[3 * i], at.direction_to_world(r.way_out));
        verdicts[i] = static_cast<uint8_t>(r.verdict);
    });
    return nb::make_tuple(nb::make_tuple(to_numpy(std::move(lower), {n}), to_numpy(std::move(upper), {n}),
                                         to_numpy(std::move(way_out), {n, 3}), to_numpy(std::move(verdicts), {n})),
                          bodies.single());
}

} // namespace

void bind_solids(nb::module_& m) {
    m.def("collide_solids", &collide_solids_at, nb::arg("a").none(), nb::arg("poses_a").none(), nb::arg("b").none(),
          nb::arg("poses_b").none(), nb::arg("margin").none(), nb::arg("max_level").none(), nb::arg("budget").none(),
          nb::arg("threads").none(), nb::arg("order").none());
    m.def("distance_solids", &distance_solids_at, nb::arg("a").none(), nb::arg("poses_a").none(), nb::arg("b").none(),
          nb::arg("poses_b").none(), nb::arg("tolerance").none(), nb::arg("max_distance").none(),
          nb::arg("max_level").none(), nb::arg("budget").none(), nb::arg("threads").none(), nb::arg("order").none());
    m.def("depth_solids", &depth_solids_at, nb::arg("a").none(), nb::arg("poses_a").none(), nb::arg("b").none(),
          nb::arg("poses_b").none(), nb::arg("max_level").none(), nb::arg("budget").none(), nb::arg("threads").none(),
          nb::arg("order").none());
}

} // namespace prolate::python
