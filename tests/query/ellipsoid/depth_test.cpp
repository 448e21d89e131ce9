// The certified depth of two ellipsoids: below what any direction shows, and near the least of these.
#include "query/ellipsoid/depth.hpp"
#include "query/ellipsoid/gap.hpp"
#include "tests/reference.hpp"
#include "tests/scenes.hpp"

#include <gtest/gtest.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace prolate {
namespace {

using query::PlacedEllipsoid;
using scenes::Point;
using scenes::Random;

struct Bodies {
    PlacedEllipsoid a, b;
};
// The centers are up to `far` sizes apart.
Bodies overlapping(Random& random, double ratio, double far) {
    const double size = random.log_in(0.2, 5);
    const Point ra = scenes::radii(random, ratio), rb = scenes::radii(random, ratio);
    const Ellipsoid a = scenes::ellipsoid({0, 0, 0}, ra, random.rotation()),
                    b = scenes::ellipsoid({0, 0, 0}, {size * rb[0], size * rb[1], size * rb[2]}, random.rotation());
    const Point d = random.direction();
    const double r = random.in(0, far) * (ra[0] + size * rb[0]);
    const Pose pose{scenes::to_float({r * d[0], r * d[1], r * d[2]}), random.rotation()};
    return {query::place(a), query::place(b, query::relative_pose(Pose{}, pose))};
}
// What the bodies overlap by along a direction.
double overlap(const Bodies& p, const glm::dvec3& n) {
    return (glm::length(n * p.a.factor) + glm::length(n * p.b.factor) - glm::dot(n, p.b.center - p.a.center)) /
           glm::length(n);
}

// The least along many directions, of which the best are followed downhill.
double least_overlap(const Bodies& p, Random& random) {
    double least = HUGE_VAL;
    for (int start = 0; start < 8; ++start) {
        glm::dvec3 best = query::depth_of(p.a, p.b, 0).normal;
        const auto look = [&](const glm::dvec3& n) {
            if (overlap(p, n) < overlap(p, best)) best = n;
        };
        for (int k = 0; k < 40; ++k) {
            const Point d = random.direction();
            if (k == 0 && start > 0) best = {d[0], d[1], d[2]};
            look({d[0], d[1], d[2]});
        }
        for (double step = 0.5; step > 1e-3; step *= 0.9) {
            const Point d = random.direction();
            look(glm::normalize(best + step * glm::dvec3(d[0], d[1], d[2])));
        }
        least = std::min(least, overlap(p, best));
    }
    return least;
}

TEST(Depth, NoDirectionShowsLessAndSomeShowsLittleMore) {
    Random random(1);
    uint32_t deep = 0;
    for (const double ratio : {1.0, 3.0, 30.0})
        for (int i = 0; i < 1500; ++i) {
            const Bodies p = overlapping(random, ratio, 0.6);
            const double found = query::least_depth(p.a, p.b);
            const double least = least_overlap(p, random);
            ASSERT_LE(found, std::max(0.0, least) + 1e-13 * (p.a.reach + p.b.reach)) << ratio << " " << i;
            ASSERT_GE(found, 0.899 * least - 1e-3 * std::min(p.a.size, p.b.size)) << ratio << " " << i;
            deep += found > 0;
            EXPECT_LE(query::least_depth(p.a, p.b, 1.01 * least), 1.01 * std::max(0.0, least));
            EXPECT_EQ(query::least_depth(p.a, p.b, std::max(0.0, 1.25 * least)), 0);
            EXPECT_EQ(query::least_depth(p.a, p.b, 0.9 * found), found);
        }
    EXPECT_GT(deep, 2000u);
}

TEST(Depth, OfBodiesThatAreApartOrNotFiniteIsNothing) {
    Random random(2);
    for (int i = 0; i < 1000; ++i) {
        Bodies p = overlapping(random, 10, 1.5);
        if (query::test_pair(p.a, p.b).verdict == query::PairVerdict::separated) {
            EXPECT_EQ(query::least_depth(p.a, p.b), 0);
        }
        p.b.center.x = i % 2 == 0 ? std::numeric_limits<double>::quiet_NaN() : HUGE_VAL;
        EXPECT_EQ(query::least_depth(p.a, p.b), 0);
    }
}

// Of sizes 1 : 1e12, and of needles and discs.
TEST(Depth, StaysBelowWhatDirectionsShowAtAnyShape) {
    Random random(3);
    for (int i = 0; i < 2000; ++i) {
        const double ratio = random.log_in(1, 1e4), scale = random.log_in(1e-12, 1);
        Bodies p = overlapping(random, ratio, 0.5);
        for (int c = 0; c < 3; ++c) p.b.factor[c] *= scale;
        p.b.size *= scale;
        const double found = query::least_depth(p.a, p.b);
        double least = HUGE_VAL;
        for (int k = 0; k < 200; ++k) {
            const Point d = random.direction();
            least = std::min(least, overlap(p, {d[0], d[1], d[2]}));
        }
        ASSERT_LE(found, std::max(0.0, least) + 1e-13 * (p.a.reach + p.b.reach)) << i;
    }
}

} // namespace
} // namespace prolate
