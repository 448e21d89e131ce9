// A body and simple shapes: overlap, and distance and contacts of the ground. And the boxes around bodies.
#include "python/src/answers.hpp"
#include "python/src/batch.hpp"
#include "python/src/poses.hpp"
#include "python/src/tree.hpp"

#include <prolate/bounds.hpp>
#include <prolate/half_space.hpp>
#include <prolate/shapes.hpp>

#include <cmath>
#include <limits>

namespace prolate::python {
namespace {

// The shapes of python/prolate/_shapes.py, as their numbers in the world. Each is taken into the body's frame.
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
            const RoundedPose box = in_frame(Frame(body), {{n_[0], n_[1], n_[2]}, {n_[3], n_[4], n_[5], n_[6]}},
                                             std::hypot(n_[7], n_[8], n_[9]));
            slack = box.slack;
            return ask(Box{box.pose, {rounded_up(n_[7]), rounded_up(n_[8]), rounded_up(n_[9])}});
        }
        return ask(half_space_in_frame(held.reach, body, n_, slack));
    }

private:
    char kind_;
    std::span<const double> n_;
};

nb::object overlap_shape(nb::handle tree, nb::handle poses_, const char* kind_, nb::handle numbers, nb::handle margin,
                         nb::handle max_level, nb::handle budget, nb::handle threads, nb::handle out,
                         nb::handle order) {
    const HeldTree& held = tree_of(tree, "tree");
    const Poses poses(poses_, "poses", order);
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
nb::tuple bounds_of(nb::handle tree, nb::handle poses_, nb::handle margin, nb::handle order) {
    const HeldTree& held = tree_of(tree, "tree");
    const Poses poses(poses_, "poses", order);
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
            lower[3 * i + k] = std::nextafter(low[k] + pose.t[k], -std::numeric_limits<double>::infinity());
            upper[3 * i + k] = std::nextafter(high[k] + pose.t[k], std::numeric_limits<double>::infinity());
        }
    }
    return nb::make_tuple(to_numpy(std::move(lower), {n, 3}), to_numpy(std::move(upper), {n, 3}), poses.single());
}

// A body at N poses, and the ground.
struct OverGround {
    const HeldTree& held;
    Poses poses;
    Rows<double> plane;

    OverGround(nb::handle tree, nb::handle at, nb::handle numbers, nb::handle order)
        : held(tree_of(tree, "a")), poses(at, "poses_a", order),
          plane(rows_of_doubles(numbers, "half_space", 4, true)) {}

    /// The ground in the frame of pose `i`.
    HalfSpace at(size_t i, PlacedBodies& placed) const noexcept {
        placed.in_frame = true;
        placed.frame = poses.at(i);
        return half_space_in_frame(held.reach, placed.frame, plane.values, placed.slack);
    }
};

nb::tuple ground_distance(nb::handle tree, nb::handle poses, nb::handle numbers, nb::handle tolerance,
                          nb::handle max_distance, nb::handle budget, nb::handle threads, nb::handle order) {
    const OverGround ground(tree, poses, numbers, order);
    DistanceOptions options;
    options.tolerance_relative = number_from_0(tolerance, "tolerance");
    options.max_pair_tests = whole_or(budget, "budget", 0, UINT64_MAX, UINT64_MAX);
    if (!max_distance.is_none()) options.max_distance = number_from_0(max_distance, "max_distance");
    PairArrays out(ground.poses.count());
    for_all(out.count, thread_count(threads), [&](size_t i, QueryContext& context) {
        PlacedBodies at;
        const HalfSpace half_space = ground.at(i, at);
        DistanceOptions here = options;
        here.max_distance += at.slack;
        out.store(i, distance(ground.held.view, {}, half_space, context, here), at);
    });
    return nb::make_tuple(out.take(), ground.poses.single());
}

nb::tuple ground_contacts(nb::handle tree, nb::handle poses, nb::handle numbers, nb::handle margin,
                          nb::handle max_level, nb::handle budget, nb::handle threads, nb::handle order) {
    const OverGround ground(tree, poses, numbers, order);
    const Limits limits(margin, max_level, budget);
    std::vector<std::vector<Contact>> found(ground.poses.count());
    auto verdict = new_array<uint8_t>(found.size());
    for_all(found.size(), thread_count(threads), [&](size_t i, QueryContext& context) {
        PlacedBodies at;
        const HalfSpace half_space = ground.at(i, at);
        ContactManifolds manifolds;
        verdict[i] = static_cast<uint8_t>(
            contacts(ground.held.view, {}, half_space, manifolds, context, limits.options(at.slack)).verdict);
        collect(manifolds, at, found[i]);
    });
    return nb::make_tuple(contact_arrays(found), to_numpy(std::move(verdict), {found.size()}));
}

} // namespace

void bind_shapes(nb::module_& m) {
    m.def("overlap", &overlap_shape, nb::arg("tree").none(), nb::arg("poses").none(), nb::arg("kind"),
          nb::arg("numbers").none(), nb::arg("margin").none(), nb::arg("max_level").none(), nb::arg("budget").none(),
          nb::arg("threads").none(), nb::arg("out").none(), nb::arg("order").none());
    m.def("bounds", &bounds_of, nb::arg("tree").none(), nb::arg("poses").none(), nb::arg("margin").none(),
          nb::arg("order").none());
    m.def("ground_distance", &ground_distance, nb::arg("a").none(), nb::arg("poses_a").none(),
          nb::arg("half_space").none(), nb::arg("tolerance").none(), nb::arg("max_distance").none(),
          nb::arg("budget").none(), nb::arg("threads").none(), nb::arg("order").none());
    m.def("ground_contacts", &ground_contacts, nb::arg("a").none(), nb::arg("poses_a").none(),
          nb::arg("half_space").none(), nb::arg("margin").none(), nb::arg("max_level").none(), nb::arg("budget").none(),
          nb::arg("threads").none(), nb::arg("order").none());
}

} // namespace prolate::python
