// What is asked of a world from outside.
#include "python/src/answers.hpp"
#include "python/src/world.hpp"

#include <cmath>

namespace prolate::python {
namespace {

Vec3 rounded(const double* p, double& slack) noexcept {
    const Vec3 out{static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])};
    slack = std::max(slack, std::hypot(p[0] - out.x, p[1] - out.y, p[2] - out.z));
    return out;
}
Vec3 rounded(const double* p) noexcept {
    double unused = 0;
    return rounded(p, unused);
}

// A shape of python/prolate/_shapes.py, as its numbers. `slack` grows to how far rounding moved it.
Probe probe_of(const char* kind, std::span<const double> n, double& slack) {
    if (*kind == 's') return Sphere{rounded(&n[0], slack), rounded_up(n[3])};
    if (*kind == 'c') return Capsule{rounded(&n[0], slack), rounded(&n[3], slack), rounded_up(n[6])};
    if (*kind != 'b') type_error("what", "must be a Tree, Sphere, Capsule or Box, or a list of such shapes");
    const RoundedPose at = in_frame({}, {{n[0], n[1], n[2]}, {n[3], n[4], n[5], n[6]}}, std::hypot(n[7], n[8], n[9]));
    slack = std::max(slack, at.slack);
    return Box{at.pose, {rounded_up(n[7]), rounded_up(n[8]), rounded_up(n[9])}};
}

} // namespace

nb::tuple HeldWorld::raycast(nb::handle origins, nb::handle directions, nb::handle radius, nb::handle max_t,
                             nb::handle mask, nb::handle budget, nb::handle threads) {
    const Rows<double> origin = rows_of_doubles(origins, "origins", 3, true),
                       direction = rows_of_doubles(directions, "directions", 3, true);
    const size_t n = std::max(origin.count, direction.count);
    if ((origin.count != n && origin.count != 1) || (direction.count != n && direction.count != 1))
        value_error("origins, directions", "must be as many, or one");
    const Limits limits(radius, nb::none(), budget, "radius");
    const uint32_t layers = bits_of(mask, "mask");
    const float most =
        max_t.is_none() ? std::numeric_limits<float>::infinity() : rounded_up(number_from_0(max_t, "max_t"));
    const auto row = [](const Rows<double>& rows, size_t i) { return &rows.values[3 * (rows.count == 1 ? 0 : i)]; };
    std::vector<Ray> rays(n);
    for (size_t i = 0; i < n; ++i) {
        const double* const d = row(direction, i);
        rays[i] = {rounded(row(origin, i)), rounded(d), most};
        if (d[0] == 0 && d[1] == 0 && d[2] == 0) value_error("directions[" + std::to_string(i) + "]", "is 0");
    }
    std::vector<RayHit> found(n);
    ask(threads, [&](const Workers& workers) {
        return prolate::raycast(world_, rays, found, workers, limits.options(0), layers);
    });
    HitArrays out(n);
    auto ids = new_array<uint64_t>(n);
    for (size_t i = 0; i < n; ++i) {
        const RaycastResult& r = found[i].result;
        out.store(i, r, r.t, row(origin, i), row(direction, i), {r.normal.x, r.normal.y, r.normal.z});
        ids[i] = r.verdict == Verdict::overlapping ? number_of(found[i].body) : 0;
    }
    return nb::make_tuple(to_numpy(std::move(ids), {n}), out.take(), origin.single && direction.single);
}

nb::tuple HeldWorld::sweep(nb::handle tree, nb::handle start_, nb::handle end_, nb::handle margin, nb::handle tolerance,
                           nb::handle mask, nb::handle budget, nb::handle threads, nb::handle order) {
    const HeldTree& held = tree_of(tree, "tree");
    const Poses start(start_, "start", order), end(end_, "end", order);
    const size_t n = broadcast(start, "start", end, "end");
    const Limits limits(margin, nb::none(), budget);
    const double near = number_from_0(tolerance, "tolerance");
    const uint32_t layers = bits_of(mask, "mask");
    std::vector<MovingTree> moving;
    double slack = 0;
    for (size_t i = 0; i < n; ++i) {
        const RoundedMotion motion = motion_in(Frame(), start.at(i), end.at(i), held.reach);
        moving.push_back({held.view, motion.motion});
        slack = std::max(slack, motion.slack);
    }
    const QueryOptions shared = limits.options(slack);
    const SweepOptions options{.tolerance = near, .max_pair_tests = shared.max_pair_tests, .margin = shared.margin};
    std::vector<SweepHit> found(n);
    ask(threads,
        [&](const Workers& workers) { return prolate::sweep(world_, moving, found, workers, options, layers); });
    PairArrays out(n); // lower and upper are times
    auto ids = new_array<uint64_t>(n);
    auto gap = new_array<double>(n);
    for (size_t i = 0; i < n; ++i) {
        const SweepResult& r = found[i].result;
        const bool hit = std::isfinite(r.time_upper);
        out.lower[i] = r.time_lower;
        out.upper[i] = r.time_upper;
        out.verdict[i] = static_cast<uint8_t>(r.verdict);
        out.store_points(i, r, hit && !r.enclosed, {});
        gap[i] = hit ? r.distance : std::numeric_limits<double>::quiet_NaN();
        ids[i] = r.verdict == Verdict::overlapping ? number_of(found[i].body) : 0;
    }
    return nb::make_tuple(to_numpy(std::move(ids), {n}), out.take(), to_numpy(std::move(gap), {n}),
                          start.single() && end.single());
}

nb::tuple HeldWorld::overlap(const std::vector<Probe>& probes, nb::handle threads, const QueryOptions& options,
                             uint32_t mask) {
    const size_t n = probes.size();
    std::vector<uint32_t> counts(n);
    std::vector<BodyId> found;
    size_t most = 8; // of a probe; asked again if some meet more
    for (bool again = n > 0; again;) {
        found.resize(n * most);
        ask(threads, [&](const Workers& workers) {
            return prolate::overlap(world_, probes, found, counts, workers, options, mask);
        });
        const size_t needed = *std::max_element(counts.begin(), counts.end());
        again = needed > most;
        if (again) most = needed;
    }
    std::vector<int64_t> offsets(1);
    std::vector<uint64_t> ids;
    for (size_t i = 0; i < n; ++i) {
        for (size_t k = 0; k < counts[i]; ++k) ids.push_back(number_of(found[i * most + k]));
        offsets.push_back(static_cast<int64_t>(ids.size()));
    }
    return nb::make_tuple(to_numpy(offsets, {n + 1}), to_numpy(ids, {ids.size()}));
}

nb::tuple HeldWorld::overlap_shapes(nb::handle shapes, nb::handle margin, nb::handle mask, nb::handle budget,
                                    nb::handle threads) {
    std::vector<Probe> probes;
    double slack = 0;
    for (const nb::handle shape : shapes) {
        const nb::object kind = shape[0], numbers = shape[1];
        const Rows<double> row = rows_of_doubles(numbers, "what", nb::len(numbers), true);
        probes.push_back(probe_of(nb::cast<const char*>(kind), row.values, slack));
    }
    return overlap(probes, threads, Limits(margin, nb::none(), budget).options(slack), bits_of(mask, "mask"));
}

nb::tuple HeldWorld::overlap_tree(nb::handle tree, nb::handle poses_, nb::handle margin, nb::handle mask,
                                  nb::handle budget, nb::handle threads, nb::handle order) {
    const HeldTree& held = tree_of(tree, "what");
    const Poses poses(poses_, "poses", order);
    std::vector<Probe> probes;
    double slack = 0;
    for (size_t i = 0; i < poses.count(); ++i) {
        const RoundedPose at =
            poses.floats() ? RoundedPose{poses.floats()[i], 0} : in_frame({}, poses.at(i), held.reach);
        probes.push_back(PlacedTree{held.view, at.pose});
        slack = std::max(slack, at.slack);
    }
    return overlap(probes, threads, Limits(margin, nb::none(), budget).options(slack), bits_of(mask, "mask"));
}

} // namespace prolate::python
