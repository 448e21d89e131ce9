#include "python/src/rays.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace prolate::python {

Rays::Rays(nb::handle pose, nb::handle origins, nb::handle directions, nb::handle max_t, nb::handle order, size_t more,
           bool more_single)
    : poses_(pose, "pose", order), origins_(rows_of_doubles(origins, "origins", 3, true)),
      directions_(rows_of_doubles(directions, "directions", 3, true)),
      max_t_(max_t.is_none() ? std::numeric_limits<double>::infinity() : number_from_0(max_t, "max_t")),
      count_(std::max({poses_.count(), origins_.count, directions_.count, more})),
      single_(poses_.single() && origins_.single && directions_.single && more_single) {
    const size_t counts[] = {poses_.count(), origins_.count, directions_.count, more};
    if (std::find(std::begin(counts), std::end(counts), size_t{0}) != std::end(counts)) count_ = 0;
    for (const size_t n : counts)
        if (count_ > 0 && n != count_ && n != 1)
            value_error("raycast", more == 1 ? "pose, origins and directions must be as many, or one"
                                             : "pose, coordinates, origins and directions must be as many, or one");
    for (size_t i = 0; i < directions_.count; ++i) {
        const double* const d = row(directions_, i);
        if (d[0] == 0 && d[1] == 0 && d[2] == 0) value_error("directions[" + std::to_string(i) + "]", "is 0");
    }
}

Rays::Placed Rays::placed(size_t i) const noexcept {
    Placed out = without_end(i);
    out.ray.max_t = rounded_up(max_t_ / out.scale);
    return out;
}

// As given, if floats hold all of it; else taken into the body's frame in double precision and rounded there.
Rays::Placed Rays::without_end(size_t i) const noexcept {
    const auto vec = [](const Point& p) {
        return Vec3{static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])};
    };
    const auto exact = [](const Point& p) {
        return std::all_of(p.begin(), p.end(),
                           [](double x) { return static_cast<double>(static_cast<float>(x)) == x; });
    };
    const double *const origin = row(origins_, i), *const direction = row(directions_, i);
    const Point o = {origin[0], origin[1], origin[2]}, d = {direction[0], direction[1], direction[2]};
    if (poses_.floats() && exact(o) && exact(d)) return {poses_.floats()[poses_.index(i)], {vec(o), vec(d)}};
    const DoublePose pose = poses_.at(i);
    const double most = std::max({std::abs(d[0]), std::abs(d[1]), std::abs(d[2])});
    const double scale = most > 1e-30 && most < 1e30 ? 1 : 1 / most; // floats hold the direction's length
    const Point local_origin = rotated_back(pose, {o[0] - pose.t[0], o[1] - pose.t[1], o[2] - pose.t[2]});
    const Point local_direction = rotated_back(pose, {d[0] * scale, d[1] * scale, d[2] * scale});
    return {{}, {vec(local_origin), vec(local_direction)}, true, scale};
}

} // namespace prolate::python
