// Single ellipsoids: bodies by radii and poses, pairs by indices.
#include "python/src/batch.hpp"
#include "python/src/poses.hpp"
#include "python/src/tree.hpp"

#include <prolate/pairs.hpp>

#include <cmath>

namespace prolate::python {
namespace {

// Bodies of a batch and the pairs asked about.
struct Batch {
    std::vector<Ellipsoid> shapes;
    std::vector<Pose> poses;
    std::vector<WorldEllipsoid> world;
    std::vector<IndexPair> pairs;
    Point origin{};   ///< poses are relative to it
    double slack = 0; ///< how far rounding moved a point of a body at most, metres

    EllipsoidBodies bodies() const { return {shapes, poses, world}; }
};

std::vector<IndexPair> index_pairs(nb::handle pairs, size_t bodies) {
    const nb::object array = as_numpy(pairs, "pairs", "int64");
    const AnyArray view = import_array(array);
    if (view.ndim() != 2 || view.shape(1) != 2)
        value_error("pairs", "must have shape (M, 2), not " + view.shape_text());
    const auto* from = static_cast<const int64_t*>(view.data());
    std::vector<IndexPair> out(view.shape(0));
    for (size_t i = 0; i < out.size(); ++i) {
        for (size_t k = 0; k < 2; ++k)
            if (from[2 * i + k] < 0 || static_cast<uint64_t>(from[2 * i + k]) >= bodies)
                value_error("pairs[" + std::to_string(i) + "]",
                            "names body " + std::to_string(from[2 * i + k]) + "; there are " + std::to_string(bodies));
        out[i] = {static_cast<uint32_t>(from[2 * i]), static_cast<uint32_t>(from[2 * i + 1])};
    }
    return out;
}

Batch batch_of(nb::handle radii_, nb::handle poses_, nb::handle pairs, nb::handle order) {
    const Rows<double> radii = rows_of_doubles(radii_, "radii", 3, true);
    const Poses poses(poses_, "poses", order);
    const size_t n = poses.count();
    if (radii.count != n && radii.count != 1)
        value_error("radii", "has " + std::to_string(radii.count) + " rows and poses " + std::to_string(n) +
                                 "; give as many, or one");
    Batch out;
    out.pairs = index_pairs(pairs, n);
    // One origin for all bodies: the first one's center, if floats do not hold the poses anyway.
    if (!poses.floats() && n > 0) out.origin = {poses.at(0).t[0], poses.at(0).t[1], poses.at(0).t[2]};
    const Frame frame({{out.origin[0], out.origin[1], out.origin[2]}, {0, 0, 0, 1}});
    for (size_t i = 0; i < n; ++i) {
        const double* const r = &radii.values[3 * (radii.count == 1 ? 0 : i)];
        for (size_t k = 0; k < 3; ++k)
            if (!(r[k] >= 1e-30 && r[k] <= 1e30))
                value_error("radii[" + std::to_string(i) + "]", "must be 1e-30 to 1e30");
        out.shapes.push_back({.center = {}, .l11 = rounded_up(r[0]), .l22 = rounded_up(r[1]), .l33 = rounded_up(r[2])});
        if (poses.floats()) {
            out.poses.push_back(poses.floats()[i]);
        } else {
            const RoundedPose at = in_frame(frame, poses.at(i), std::max({r[0], r[1], r[2]}));
            out.poses.push_back(at.pose);
            out.slack = std::max(out.slack, 2 * at.slack);
        }
    }
    out.world.resize(n);
    place(out.shapes, out.poses, out.world);
    return out;
}

nb::object collide_ellipsoids(nb::handle radii, nb::handle poses, nb::handle pairs, nb::handle margin,
                              nb::handle order) {
    const Batch batch = batch_of(radii, poses, pairs, order);
    const double wide = number_from_0(margin, "margin");
    std::vector<Verdict> verdicts(batch.pairs.size());
    {
        const nb::gil_scoped_release released;
        collide(batch.bodies(), batch.pairs, verdicts, rounded_up(wide + batch.slack));
    }
    auto out = new_array<uint8_t>(verdicts.size());
    for (size_t i = 0; i < verdicts.size(); ++i) out[i] = static_cast<uint8_t>(verdicts[i]);
    return to_numpy(std::move(out), {verdicts.size()});
}

// (lower, upper, point_a, point_b, normal)
nb::tuple distance_ellipsoids(nb::handle radii, nb::handle poses, nb::handle pairs, nb::handle tolerance,
                              nb::handle order) {
    const Batch batch = batch_of(radii, poses, pairs, order);
    const double near = number_from_0(tolerance, "tolerance");
    const size_t n = batch.pairs.size();
    std::vector<PairDistance> found(n);
    {
        const nb::gil_scoped_release released;
        distance(batch.bodies(), batch.pairs, found, static_cast<float>(near));
    }
    auto lower = new_array<double>(n), upper = new_array<double>(n), point_a = new_array<double>(3 * n),
         point_b = new_array<double>(3 * n), normal = new_array<double>(3 * n);
    for (size_t i = 0; i < n; ++i) {
        const PairDistance& d = found[i];
        lower[i] = d.lower - batch.slack, upper[i] = d.upper + batch.slack;
        const Vec3 points[3] = {d.point_a, d.point_b, d.normal};
        double* const to[3] = {&point_a[3 * i], &point_b[3 * i], &normal[3 * i]};
        for (size_t k = 0; k < 3; ++k) {
            const Point origin = k < 2 ? batch.origin : Point{};
            to[k][0] = points[k].x + origin[0], to[k][1] = points[k].y + origin[1], to[k][2] = points[k].z + origin[2];
        }
    }
    return nb::make_tuple(to_numpy(std::move(lower), {n}), to_numpy(std::move(upper), {n}),
                          to_numpy(std::move(point_a), {n, 3}), to_numpy(std::move(point_b), {n, 3}),
                          to_numpy(std::move(normal), {n, 3}));
}

} // namespace

void bind_pairs(nb::module_& m) {
    m.def("pairs_collide", &collide_ellipsoids, nb::arg("radii").none(), nb::arg("poses").none(),
          nb::arg("pairs").none(), nb::arg("margin").none(), nb::arg("order").none());
    m.def("pairs_distance", &distance_ellipsoids, nb::arg("radii").none(), nb::arg("poses").none(),
          nb::arg("pairs").none(), nb::arg("tolerance").none(), nb::arg("order").none());
}

} // namespace prolate::python
