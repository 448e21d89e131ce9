// Bodies that deform, at many poses and coordinates: collide_deformed, distance_deformed, raycast_deformed.
#include "python/src/answers.hpp"
#include "python/src/batch.hpp"
#include "python/src/bodies.hpp"
#include "python/src/rays.hpp"

#include <prolate/deform.hpp>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

namespace prolate::python {
namespace {

// Rows of numbers, rounded to float: of each query, or one for all. None of them: nothing deforms.
struct FloatRows {
    std::vector<float> values;
    size_t columns = 0, count = 1;
    bool single = true;

    void take(nb::handle value, size_t wanted, const std::string& name) {
        columns = wanted;
        const Rows<double> rows = rows_of_doubles(value, name.c_str(), columns, true, false);
        count = rows.count, single = rows.single;
        for (const double x : rows.values) values.push_back(static_cast<float>(x));
    }
    std::span<const float> row(size_t i) const noexcept {
        return std::span(values).subspan(count == 1 ? 0 : i * columns, columns);
    }
};

// How a body deforms: coordinates of its modes, and matrices of its bones, of 12 numbers each.
class Coordinates {
public:
    Coordinates(nb::handle q, nb::handle bones, const TreeView& tree, const std::string& of) {
        const auto modes = tree.deformation();
        const auto skin = tree.skin();
        if (!q.is_none() && !modes) value_error("q" + of, "the tree has no modes");
        if (!bones.is_none() && !skin) value_error("bones" + of, "the tree has no bones");
        if (!q.is_none()) q_.take(q, modes->mode_count(), "q" + of);
        if (!bones.is_none()) take_bones(bones, skin->bone_count(), "bones" + of);
        if (q_.count != 1 && bones_.count != 1 && q_.count != bones_.count)
            value_error("bones" + of,
                        "are of " + std::to_string(bones_.count) + " poses, and q of " + std::to_string(q_.count));
    }
    size_t count() const noexcept { return q_.count == 1 ? bones_.count : q_.count; }
    bool single() const noexcept { return q_.single && bones_.single; }
    DeformedBody body(const TreeView& tree, const Pose& pose, size_t i) const noexcept {
        const size_t at = bones_.count == 1 ? 0 : i * matrices_each_;
        return {tree, pose, q_.row(i), std::span(matrices_).subspan(at, matrices_each_)};
    }

private:
    void take_bones(nb::handle value, uint32_t count, const std::string& name) {
        bones_.take(value, size_t{12} * count, name);
        matrices_each_ = count, matrices_.resize(count * bones_.count);
        for (size_t i = 0; i < bones_.values.size(); ++i) matrices_[i / 12].m[i / 4 % 3][i % 4] = bones_.values[i];
    }
    FloatRows q_, bones_;
    std::vector<BoneMatrix> matrices_;
    size_t matrices_each_ = 0;
};

// How far from its origin the body reaches; at coordinates for which no bound holds, 0: then nothing is decided.
double reach_of(const DeformedBody& body) noexcept {
    const Bounds box = bounds(body);
    const auto farther = [](float low, float high) { return std::max(std::abs(double{low}), std::abs(double{high})); };
    const double out = std::hypot(farther(box.lower.x, box.upper.x), farther(box.lower.y, box.upper.y),
                                  farther(box.lower.z, box.upper.z));
    return std::isfinite(out) ? out : 0;
}

// Two bodies at N poses and coordinates: of each, one, or all as many.
class DeformedBodies {
public:
    DeformedBodies(nb::handle a, nb::handle poses_a, nb::handle q_a, nb::handle bones_a, nb::handle b,
                   nb::handle poses_b, nb::handle q_b, nb::handle bones_b, nb::handle order)
        : bodies_(a, poses_a, b, poses_b, order), q_a_(q_a, bones_a, bodies_.a(), "_a"),
          q_b_(q_b, bones_b, bodies_.b(), "_b"), count_(std::max({bodies_.count(), q_a_.count(), q_b_.count()})) {
        if (bodies_.count() == 0 || q_a_.count() == 0 || q_b_.count() == 0) count_ = 0;
        demand(q_a_.count(), "q_a", "rows");
        demand(q_b_.count(), "q_b", "rows");
        demand(bodies_.count(), "poses_a", "poses");
    }
    size_t count() const noexcept { return count_; }
    bool single() const noexcept { return bodies_.single() && q_a_.single() && q_b_.single(); }
    PlacedBodies placed(size_t i) const noexcept {
        return bodies_.placed(bodies_.count() == 1 ? 0 : i, reach_of(q_a_.body(bodies_.a(), {}, i)),
                              reach_of(q_b_.body(bodies_.b(), {}, i)));
    }
    DeformedBody a(size_t i, const PlacedBodies& at) const noexcept { return q_a_.body(bodies_.a(), at.a, i); }
    DeformedBody b(size_t i, const PlacedBodies& at) const noexcept { return q_b_.body(bodies_.b(), at.b, i); }

private:
    void demand(size_t n, const char* name, const char* what) const {
        if (n != 1 && n != count_ && count_ > 0)
            value_error(name, "has " + std::to_string(n) + " " + what + ", not 1 or " + std::to_string(count_));
    }
    Bodies bodies_;
    Coordinates q_a_, q_b_;
    size_t count_;
};

nb::object collide_deformed(nb::handle a, nb::handle poses_a, nb::handle q_a, nb::handle bones_a, nb::handle b,
                            nb::handle poses_b, nb::handle q_b, nb::handle bones_b, nb::handle margin,
                            nb::handle max_level, nb::handle budget, nb::handle threads, nb::handle order) {
    const DeformedBodies bodies(a, poses_a, q_a, bones_a, b, poses_b, q_b, bones_b, order);
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

nb::tuple distance_deformed(nb::handle a, nb::handle poses_a, nb::handle q_a, nb::handle bones_a, nb::handle b,
                            nb::handle poses_b, nb::handle q_b, nb::handle bones_b, nb::handle tolerance,
                            nb::handle max_distance, nb::handle max_level, nb::handle budget, nb::handle threads,
                            nb::handle order) {
    const DeformedBodies bodies(a, poses_a, q_a, bones_a, b, poses_b, q_b, bones_b, order);
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

nb::tuple raycast_deformed(nb::handle tree, nb::handle pose, nb::handle q, nb::handle bones, nb::handle origins,
                           nb::handle directions, nb::handle radius, nb::handle max_t, nb::handle max_level,
                           nb::handle budget, nb::handle threads, nb::handle order) {
    const TreeView& view = tree_of(tree, "tree").view;
    const Coordinates coordinates(q, bones, view, "");
    const Rays rays(pose, origins, directions, max_t, order, coordinates.count(), coordinates.single());
    const Limits limits(radius, max_level, budget, "radius");
    return rays.cast(thread_count(threads), [&](size_t i, const Pose& at, const Ray& ray, QueryContext& context) {
        return raycast(coordinates.body(view, at, i), ray, context, limits.options(0));
    });
}

} // namespace

void bind_deform(nb::module_& m) {
    m.def("collide_deformed", &collide_deformed, nb::arg("a").none(), nb::arg("poses_a").none(), nb::arg("q_a").none(),
          nb::arg("bones_a").none(), nb::arg("b").none(), nb::arg("poses_b").none(), nb::arg("q_b").none(),
          nb::arg("bones_b").none(), nb::arg("margin").none(), nb::arg("max_level").none(), nb::arg("budget").none(),
          nb::arg("threads").none(), nb::arg("order").none());
    m.def("distance_deformed", &distance_deformed, nb::arg("a").none(), nb::arg("poses_a").none(),
          nb::arg("q_a").none(), nb::arg("bones_a").none(), nb::arg("b").none(), nb::arg("poses_b").none(),
          nb::arg("q_b").none(), nb::arg("bones_b").none(), nb::arg("tolerance").none(), nb::arg("max_distance").none(),
          nb::arg("max_level").none(), nb::arg("budget").none(), nb::arg("threads").none(), nb::arg("order").none());
    m.def("raycast_deformed", &raycast_deformed, nb::arg("tree").none(), nb::arg("pose").none(), nb::arg("q").none(),
          nb::arg("bones").none(), nb::arg("origins").none(), nb::arg("directions").none(), nb::arg("radius").none(),
          nb::arg("max_t").none(), nb::arg("max_level").none(), nb::arg("budget").none(), nb::arg("threads").none(),
          nb::arg("order").none());
}

} // namespace prolate::python
