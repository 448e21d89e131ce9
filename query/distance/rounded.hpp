// Distances of bodies that are all within a radius of their cores.
#pragma once

#include "query/node/limits.hpp"

#include <prolate/distance.hpp>

#include <algorithm>
#include <limits>

namespace prolate::query {

/// Makes what is known of the cores, at `options`, what is known of the bodies: less both radii. Where that says
/// nothing, `meet(QueryOptions)`, a query with a verdict and stats, knows whether the bodies meet.
template <class Meet>
void round_distance(DistanceResult& out, float radius_a, float radius_b, const DistanceOptions& options, Meet&& meet) {
    if (out.verdict == Verdict::overlapping) return;
    const double radii = double{radius_a} + radius_b;
    if (out.upper <= radii * (1 - 0x1p-20)) { // whatever the budget leaves for collide(), which would say so
        out.verdict = Verdict::overlapping;
    } else if (out.lower <= radii * (1 + 0x1p-20)) {
        const auto met = meet(QueryOptions{.max_level = options.max_level,
                                           .max_pair_tests = tests_left(options.max_pair_tests, out.stats.tests())});
        add(met.stats, out.stats);
        // At a level that ends its search, nodes that come near are said to meet.
        const bool certain = options.max_level >= kMaxLevels || out.upper <= radii;
        out.verdict = met.verdict == Verdict::overlapping && !certain ? Verdict::undecided : met.verdict;
    }
    out.lower = std::max(0.0, out.lower * (1 - 0x1p-51) - radii);
    out.upper = std::max(0.0, out.upper * (1 + 0x1p-51) - radii);
    if (out.verdict == Verdict::overlapping) out.lower = 0;
    if (out.verdict == Verdict::separated) out.lower = std::max(out.lower, std::numeric_limits<double>::min());
    if (out.verdict == Verdict::separated) out.upper = std::max(out.upper, out.lower);
    const auto move = [&](Vec3& p, float by) {
        p = {p.x + by * out.normal.x, p.y + by * out.normal.y, p.z + by * out.normal.z};
    };
    move(out.point_a, radius_a), move(out.point_b, -radius_b);
}

} // namespace prolate::query
