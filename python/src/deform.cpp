// Bodies that deform, at many poses and coordinates: collide_deformed, distance_deformed, raycast_deformed.
#include "python/src/answers.hpp"
#include "python/src/batch.hpp"
#include "python/src/bodies.hpp"
#include "python/src/rays.hpp"

#include <prolate/deform.hpp>

#include <algorithm>
#include <cmath>

namespace prolate::python {
namespace {

// Rows of coordinates, rounded to float; none for a body at rest.
class Coordinates {
public:
    Coordinates(nb::handle value, const TreeView& tree, const char* name) {
        if (value.is_none()) return;
        const auto modes = tree.deformation();
        if (!modes) value_error(name, "the tree has no modes");
        columns_ = modes->mode_count();
        const Rows<double> rows = rows_of_doubles(value, name, columns_, true, false);
        count_ = rows.count, single_ = rows.single;
        for (const double x : rows.values) values_.push_back(static_cast<float>(x));
    }
    size_t count() const noexcept { return count_; }
    bool single() const noexcept { return single_; }
    std::span<const float> row(size_t i) const noexcept {
        return std::span(values_).subspan(count_ == 1 ? 0 : i * columns_, columns_);
    }

private:
    std::vector<float> values_;
    size_t columns_ = 0, count_ = 1;
    bool single_ = true;
};

// How far from its origin the body reaches; at coordinates for which no bound holds, 0: then nothing is decided.
double reach_at(const TreeView& tree, std::span<const float> q) noexcept {
    const Bounds box = bounds(DeformedBody{tree, {}, q});
    const auto farther = [](float low, float high) { return std::max(std::abs(double{low}), std::abs(double{high})); };
    const double out = std::hypot(farther(box.lower.x, box.upper.x), farther(box.lower.y, box.upper.y),
                                  farther(box.lower.z, box.upper.z));
    return std::isfinite(out) ? out : 0;
}

// Two bodies at N poses and coordinates: of each, one, or all as many.
class DeformedBodies {
public:
    DeformedBodies(nb::handle a, nb::handle poses_a, nb::handle q_a, nb::handle b, nb::handle poses_b, nb::handle q_b,
                   nb::handle order)
        : bodies_(a, poses_a, b, poses_b, order), q_a_(q_a, bodies_.a(), "q_a"), q_b_(q_b, bodies_.b(), "q_b"),
          count_(std::max({bodies_.count(), q_a_.count(), q_b_.count()})) {
        if (bodies_.count() == 0 || q_a_.count() == 0 || q_b_.count() == 0) count_ = 0;
        demand(q_a_.count(), "q_a", "rows");
        demand(q_b_.count(), "q_b", "rows");
        demand(bodies_.count(), "poses_a", "poses");
    }
    size_t count() const noexcept { return count_; }
    bool single() const noexcept { return bodies_.single() && q_a_.single() && q_b_.single(); }
    PlacedBodies placed(size_t i) const noexcept {
        return bodies_.placed(bodies_.count() == 1 ? 0 : i, reach_at(bodies_.a(), q_a_.row(i)),
                              reach_at(bodies_.b(), q_b_.row(i)));
    }
    DeformedBody a(size_t i, const PlacedBodies& at) const noexcept { return {bodies_.a(), at.a, q_a_.row(i)}; }
    DeformedBody b(size_t i, const PlacedBodies& at) const noexcept { return {bodies_.b(), at.b, q_b_.row(i)}; }

private:
    void demand(size_t n, const char* name, const char* what) const {
        if (n != 1 && n != count_ && count_ > 0)
            value_error(name, "has " + std::to_string(n) + " " + what + ", not 1 or " + std::to_string(count_));
    }
    Bodies bodies_;
    Coordinates q_a_, q_b_;
    size_t count_;
};

nb::object collide_deformed(nb::handle a, nb::handle poses_a, nb::handle q_a, nb::handle b, nb::handle poses_b,
                            nb::handle q_b, nb::handle margin, nb::handle max_level, nb::handle budget,
                            nb::handle threads, nb::handle order) {
    const DeformedBodies bodies(a, poses_a, q_a, b, poses_b, q_b, order);
    const Limits limits(margin, max_level, budget);
    auto verdicts = new_array<uint8_t>(bodies.count());
    for_all(bodies.count(), thread_count(threads), [&](size_t i, QueryContext& context) {
        const PlacedBodies at = bodies.placed(i);
        verdicts[i] =
            static_cast<uint8_t>(collide(bodies.a(i, at), bodies.b(i, at), context, limits.options(at.slack)).verdict);
    });
    if (bodies.single()) return nb::int_(verdicts[0]);
    return to_numpy(std::move(verdicts), {bodies.count()});
}

nb::tuple distance_deformed(nb::handle a, nb::handle poses_a, nb::handle q_a, nb::handle b, nb::handle poses_b,
                            nb::handle q_b, nb::handle tolerance, nb::handle max_distance, nb::handle max_level,
                            nb::handle budget, nb::handle threads, nb::handle order) {
    const DeformedBodies bodies(a, poses_a, q_a, b, poses_b, q_b, order);
    const DistanceOptions options = distance_options(tolerance, max_distance, max_level, budget);
    PairArrays out(bodies.count());
    for_all(bodies.count(), thread_count(threads), [&](size_t i, QueryContext& context) {
        const PlacedBodies at = bodies.placed(i);
        DistanceOptions here = options;
        here.max_distance += at.slack;
        out.store(i, distance(bodies.a(i, at), bodies.b(i, at), context, here), at);
    });
    return nb::make_tuple(out.take(), bodies.single());
}

nb::tuple raycast_deformed(nb::handle tree, nb::handle pose, nb::handle q, nb::handle origins, nb::handle directions,
                           nb::handle radius, nb::handle max_t, nb::handle max_level, nb::handle budget,
                           nb::handle threads, nb::handle order) {
    const TreeView& view = tree_of(tree, "tree").view;
    const Coordinates coordinates(q, view, "q");
    const Rays rays(pose, origins, directions, max_t, order, coordinates.count(), coordinates.single());
    const Limits limits(radius, max_level, budget, "radius");
    return rays.cast(thread_count(threads), [&](size_t i, const Pose& at, const Ray& ray, QueryContext& context) {
        return raycast(DeformedBody{view, at, coordinates.row(i)}, ray, context, limits.options(0));
    });
}

} // namespace

void bind_deform(nb::module_& m) {
    m.def("collide_deformed", &collide_deformed, nb::arg("a").none(), nb::arg("poses_a").none(), nb::arg("q_a").none(),
          nb::arg("b").none(), nb::arg("poses_b").none(), nb::arg("q_b").none(), nb::arg("margin").none(),
          nb::arg("max_level").none(), nb::arg("budget").none(), nb::arg("threads").none(), nb::arg("order").none());
    m.def("distance_deformed", &distance_deformed, nb::arg("a").none(), nb::arg("poses_a").none(),
          nb::arg("q_a").none(), nb::arg("b").none(), nb::arg("poses_b").none(), nb::arg("q_b").none(),
          nb::arg("tolerance").none(), nb::arg("max_distance").none(), nb::arg("max_level").none(),
          nb::arg("budget").none(), nb::arg("threads").none(), nb::arg("order").none());
    m.def("raycast_deformed", &raycast_deformed, nb::arg("tree").none(), nb::arg("pose").none(), nb::arg("q").none(),
          nb::arg("origins").none(), nb::arg("directions").none(), nb::arg("radius").none(), nb::arg("max_t").none(),
          nb::arg("max_level").none(), nb::arg("budget").none(), nb::arg("threads").none(), nb::arg("order").none());
}

} // namespace prolate::python
