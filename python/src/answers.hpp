// What the queries about two bodies have in common: the limits that callers set, and arrays of answers.
#pragma once

#include "python/src/arrays.hpp"
#include "python/src/poses.hpp"

#include <prolate/contacts.hpp>
#include <prolate/distance.hpp>
#include <prolate/query.hpp>
#include <prolate/raycast.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <vector>

namespace prolate::python {

/// margin, max_level and budget of a call.
struct Limits {
    double margin;
    uint32_t max_level;
    uint64_t budget;

    /// `name`: the margin's, as callers have it.
    Limits(nb::handle margin_, nb::handle max_level_, nb::handle budget_, const char* name = "margin")
        : margin(number_from_0(margin_, name)),
          max_level(static_cast<uint32_t>(whole_or(max_level_, "max_level", 0, UINT32_MAX, kMaxLevels))),
          budget(whole_or(budget_, "budget", 0, UINT64_MAX, UINT64_MAX)) {}

    QueryOptions options(double slack) const noexcept {
        return {.max_level = max_level, .max_pair_tests = budget, .margin = rounded_up(margin + slack)};
    }
};

/// tolerance, max_distance, max_level and budget of a call.
inline DistanceOptions distance_options(nb::handle tolerance, nb::handle max_distance, nb::handle max_level,
                                        nb::handle budget) {
    DistanceOptions out;
    out.tolerance_relative = number_from_0(tolerance, "tolerance");
    if (!max_distance.is_none()) out.max_distance = number_from_0(max_distance, "max_distance");
    out.max_level = static_cast<uint32_t>(whole_or(max_level, "max_level", 0, UINT32_MAX, kMaxLevels));
    out.max_pair_tests = whole_or(budget, "budget", 0, UINT64_MAX, UINT64_MAX);
    return out;
}

inline void store_point(double* at, const Point& p) noexcept {
    std::copy(p.begin(), p.end(), at);
}

/// Arrays of what is known of N pairs of points.
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
        store_point(&point_a[3 * i], known ? at.to_world(r.point_a) : unknown);
        store_point(&point_b[3 * i], known ? at.to_world(r.point_b) : unknown);
        store_point(&normal[3 * i], known ? at.direction_to_world(r.normal) : unknown);
    }
    /// Of a query whose bodies are placed up to `at.slack`.
    void store(size_t i, const DistanceResult& r, const PlacedBodies& at) noexcept {
        lower[i] = std::max(0.0, r.lower - at.slack);
        upper[i] = r.upper + at.slack;
        const bool near = r.verdict == Verdict::separated && !(lower[i] > 0); // as collide() has it
        verdict[i] = static_cast<uint8_t>(near ? Verdict::overlapping : r.verdict);
        store_points(i, r, std::isfinite(r.upper) && !r.enclosed, at);
    }
    nb::tuple take() {
        const size_t n = count;
        return nb::make_tuple(to_numpy(std::move(lower), {n}), to_numpy(std::move(upper), {n}),
                              to_numpy(std::move(point_a), {n, 3}), to_numpy(std::move(point_b), {n, 3}),
                              to_numpy(std::move(normal), {n, 3}), to_numpy(std::move(verdict), {n}));
    }
};

/// Arrays of where N rays hit.
struct HitArrays {
    size_t count;
    std::unique_ptr<double[]> t, point, normal;
    std::unique_ptr<int64_t[]> node, triangle;
    std::unique_ptr<uint8_t[]> verdict;

    explicit HitArrays(size_t n)
        : count(n), t(new_array<double>(n)), point(new_array<double>(3 * n)), normal(new_array<double>(3 * n)),
          node(new_array<int64_t>(n)), triangle(new_array<int64_t>(n)), verdict(new_array<uint8_t>(n)) {}

    /// The ray from `o` along `d` ends at `o + at d`; `n` is the normal in the world.
    void store(size_t i, const RaycastResult& r, double at, const double* o, const double* d,
               const Point& n) const noexcept {
        const bool hit = std::isfinite(r.t);
        t[i] = at;
        verdict[i] = static_cast<uint8_t>(r.verdict);
        node[i] = hit ? int64_t{r.node} : -1;
        triangle[i] = hit && r.triangle != kNoTriangle ? int64_t{r.triangle} : -1;
        for (size_t k = 0; k < 3; ++k) {
            point[3 * i + k] = hit ? o[k] + at * d[k] : std::numeric_limits<double>::quiet_NaN();
            normal[3 * i + k] = hit ? n[k] : std::numeric_limits<double>::quiet_NaN();
        }
    }
    nb::tuple take() {
        const size_t n = count;
        return nb::make_tuple(to_numpy(std::move(t), {n}), to_numpy(std::move(point), {n, 3}),
                              to_numpy(std::move(normal), {n, 3}), to_numpy(std::move(node), {n}),
                              to_numpy(std::move(triangle), {n}), to_numpy(std::move(verdict), {n}));
    }
};

/// A point of a manifold, in the world.
struct Contact {
    Point point_a, point_b, normal;
    double depth;
    uint64_t id;
    uint32_t manifold;
};

inline void collect(const ContactManifolds& found, const PlacedBodies& at, std::vector<Contact>& out) {
    for (uint32_t m = 0; m < found.count; ++m) {
        const Manifold& manifold = found.manifolds[m];
        for (uint32_t p = 0; p < manifold.count; ++p) {
            const ContactPoint& point = manifold.points[p];
            out.push_back({at.to_world(point.point_a), at.to_world(point.point_b),
                           at.direction_to_world(manifold.normal), point.depth, point.id, m});
        }
    }
}

/// (offsets, point_a, point_b, normal, depth, manifold, id)
inline nb::tuple contact_arrays(const std::vector<std::vector<Contact>>& found) {
    const size_t n = found.size();
    auto offsets = new_array<int64_t>(n + 1);
    offsets[0] = 0;
    for (size_t i = 0; i < n; ++i) offsets[i + 1] = offsets[i] + static_cast<int64_t>(found[i].size());
    const auto m = static_cast<size_t>(offsets[n]);
    auto point_a = new_array<double>(3 * m), point_b = new_array<double>(3 * m), normal = new_array<double>(3 * m),
         depth = new_array<double>(m);
    auto id = new_array<uint64_t>(m);
    auto manifold = new_array<int64_t>(m);
    size_t row = 0;
    for (const auto& contacts : found)
        for (const Contact& c : contacts) {
            std::copy(c.point_a.begin(), c.point_a.end(), &point_a[3 * row]);
            std::copy(c.point_b.begin(), c.point_b.end(), &point_b[3 * row]);
            std::copy(c.normal.begin(), c.normal.end(), &normal[3 * row]);
            depth[row] = c.depth, id[row] = c.id, manifold[row] = c.manifold;
            ++row;
        }
    return nb::make_tuple(to_numpy(std::move(offsets), {n + 1}), to_numpy(std::move(point_a), {m, 3}),
                          to_numpy(std::move(point_b), {m, 3}), to_numpy(std::move(normal), {m, 3}),
                          to_numpy(std::move(depth), {m}), to_numpy(std::move(manifold), {m}),
                          to_numpy(std::move(id), {m}));
}

} // namespace prolate::python
