// Points against a body: signed distances, nearest points, sides.
#include "python/src/batch.hpp"
#include "python/src/poses.hpp"
#include "python/src/tree.hpp"

#include <prolate/points.hpp>

#include <array>
#include <cmath>

namespace prolate::python {
namespace {

constexpr size_t kChunk = 128; // points that the runtime gets at a time

// Points of a call, and the pose of the body; in the frame that the runtime asks in.
class PlacedPoints {
public:
    PlacedPoints(nb::handle points, nb::handle pose, nb::handle order)
        : points_(rows_of_doubles(points, "points", 3, true)),
          poses_(pose.is_none() ? Poses() : Poses(pose, "pose", order)) {
        if (!poses_.single()) value_error("pose", "must be one pose");
        body_ = poses_.at(0);
        // Where floats hold everything, the runtime answers as it does in C++.
        as_given_ = poses_.floats() != nullptr || holds_floats(body_);
        for (size_t i = 0; i < points_.values.size() && as_given_; ++i)
            as_given_ = static_cast<double>(static_cast<float>(points_.values[i])) == points_.values[i];
        if (as_given_) pose_ = to_floats(body_);
    }

    size_t count() const noexcept { return points_.count; }
    bool single() const noexcept { return points_.single; }
    const Pose& pose() const noexcept { return pose_; } ///< of the body, in the frame

    /// Point i in the frame, and by how much rounding moved it, metres.
    Vec3 point(size_t i, double& slack) const noexcept {
        const double* const p = &points_.values[3 * i];
        slack = 0;
        if (as_given_) return {static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])};
        const Point d = {p[0] - body_.t[0], p[1] - body_.t[1], p[2] - body_.t[2]};
        const Point local = rotated_back(body_, d);
        const Vec3 out{static_cast<float>(local[0]), static_cast<float>(local[1]), static_cast<float>(local[2])};
        slack = 1.0001 * std::hypot(local[0] - out.x, local[1] - out.y, local[2] - out.z) +
                0x1p-46 * std::hypot(d[0], d[1], d[2]);
        return out;
    }
    Point to_world(const Vec3& p) const noexcept {
        return as_given_ ? Point{p.x, p.y, p.z} : transformed(body_, {p.x, p.y, p.z});
    }
    Point direction_to_world(const Vec3& v) const noexcept {
        return as_given_ ? Point{v.x, v.y, v.z} : rotated(body_, {v.x, v.y, v.z});
    }

private:
    Rows<double> points_;
    Poses poses_;
    DoublePose body_;
    Pose pose_;
    bool as_given_ = false;
};

uint8_t verdict_of(Verdict found, double lower) noexcept {
    const bool hidden = found == Verdict::separated && !(lower > 0); // rounding hides the gap
    return static_cast<uint8_t>(hidden ? Verdict::overlapping : found);
}

// Calls take(i, answer, slack) for all points, chunk by chunk.
template <class Take>
void ask(const HeldTree& held, const PlacedPoints& points, int threads, const PointOptions& options, const Take& take) {
    for_ranges(points.count(), threads, [&](size_t begin, size_t end, QueryContext& context) {
        std::array<Vec3, kChunk> at;
        std::array<double, kChunk> slack;
        std::array<SignedDistance, kChunk> out;
        for (size_t first = begin; first < end; first += kChunk) {
            const size_t n = std::min(kChunk, end - first);
            double most = 0;
            for (size_t k = 0; k < n; ++k) {
                at[k] = points.point(first + k, slack[k]);
                most = std::max(most, slack[k]);
            }
            PointOptions here = options;
            here.max_distance += 2 * most;
            signed_distance(held.view, points.pose(), std::span(at).first(n), std::span(out).first(n), context, here);
            for (size_t k = 0; k < n; ++k) take(first + k, out[k], slack[k]);
        }
    });
}

void store(double* at, const Point& p, bool known) noexcept {
    for (size_t k = 0; k < 3; ++k) at[k] = known ? p[k] : std::numeric_limits<double>::quiet_NaN();
}

// ((lower, upper, point, gradient, node, triangle, verdict), single)
nb::tuple distances(nb::handle tree, nb::handle points_, nb::handle pose, nb::handle max_distance, nb::handle budget,
                    nb::handle threads, nb::handle order) {
    const HeldTree& held = tree_of(tree, "tree");
    const PlacedPoints points(points_, pose, order);
    PointOptions options;
    if (!max_distance.is_none()) options.max_distance = number_from_0(max_distance, "max_distance");
    options.max_pair_tests = whole_or(budget, "budget", 0, UINT64_MAX, UINT64_MAX);
    const size_t n = points.count();
    auto lower = new_array<double>(n), upper = new_array<double>(n), point = new_array<double>(3 * n),
         gradient = new_array<double>(3 * n);
    auto node = new_array<int64_t>(n), triangle = new_array<int64_t>(n);
    auto verdict = new_array<uint8_t>(n);
    ask(held, points, thread_count(threads), options, [&](size_t i, const SignedDistance& r, double slack) {
        lower[i] = r.lower - slack, upper[i] = r.upper + slack;
        const bool known = std::isfinite(r.upper);
        store(&point[3 * i], points.to_world(r.point), known);
        store(&gradient[3 * i], points.direction_to_world(r.gradient), known);
        node[i] = known ? int64_t{r.node} : -1;
        triangle[i] = known && r.triangle != kNoTriangle ? int64_t{r.triangle} : -1;
        verdict[i] = verdict_of(r.verdict, lower[i]);
    });
    return nb::make_tuple(nb::make_tuple(to_numpy(std::move(lower), {n}), to_numpy(std::move(upper), {n}),
                                         to_numpy(std::move(point), {n, 3}), to_numpy(std::move(gradient), {n, 3}),
                                         to_numpy(std::move(node), {n}), to_numpy(std::move(triangle), {n}),
                                         to_numpy(std::move(verdict), {n})),
                          points.single());
}

nb::object sides(nb::handle tree, nb::handle points_, nb::handle pose, nb::handle threads, nb::handle order) {
    const HeldTree& held = tree_of(tree, "tree");
    const PlacedPoints points(points_, pose, order);
    auto verdict = new_array<uint8_t>(points.count());
    for_all(points.count(), thread_count(threads), [&](size_t i, QueryContext& context) {
        double slack = 0;
        const Vec3 at = points.point(i, slack);
        Verdict found = contains(held.view, points.pose(), at, context);
        // A point that was rounded is outside if it is so by more than that.
        if (found == Verdict::separated && slack > 0 &&
            !(signed_distance(held.view, points.pose(), at, context, {.max_distance = 2 * slack}).lower > slack))
            found = Verdict::overlapping;
        verdict[i] = static_cast<uint8_t>(found);
    });
    if (points.single()) return nb::int_(verdict[0]);
    return to_numpy(std::move(verdict), {points.count()});
}

} // namespace

void bind_points(nb::module_& m) {
    m.def("signed_distance", &distances, nb::arg("tree").none(), nb::arg("points").none(), nb::arg("pose").none(),
          nb::arg("max_distance").none(), nb::arg("budget").none(), nb::arg("threads").none(), nb::arg("order").none());
    m.def("contains", &sides, nb::arg("tree").none(), nb::arg("points").none(), nb::arg("pose").none(),
          nb::arg("threads").none(), nb::arg("order").none());
}

} // namespace prolate::python
