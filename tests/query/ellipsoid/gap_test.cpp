// Distance and depth of two ellipsoids: what is certified is checked in long double, by duality.
//
// The gap along any normal is a lower bound of the signed distance, the distance of any two points of the bodies an
// upper one: so a normal and two points prove themselves, and no second optimiser is needed for bodies that are apart.
// The depth of bodies that overlap is compared with the best of many directions.
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

using query::Gap;
using query::PlacedEllipsoid;
using reference::operator*;
using reference::Real;
using reference::transposed;
using scenes::Point;
using scenes::Random;

struct Bodies {
    Ellipsoid a, b;
    Pose pose_a, pose_b;
};
struct Placed {
    PlacedEllipsoid a, b;
};

Placed placed(const Bodies& p) {
    return {query::place(p.a), query::place(p.b, query::relative_pose(p.pose_a, p.pose_b))};
}

// In A's frame, as the tested functions answer.
struct Truth {
    reference::Pair pair; // in world orientation
    reference::Matrix to_world;
    explicit Truth(const Bodies& p)
        : pair(p.a, p.pose_a, p.b, p.pose_b), to_world(reference::rotation(p.pose_a.rotation)) {}

    static Real length(const reference::Vector& v) { return std::sqrt(reference::dot(v, v)); }
    Real gap(const glm::dvec3& normal) const {
        const reference::Vector n = to_world * reference::Vector{normal.x, normal.y, normal.z};
        return (reference::dot(n, pair.r) - length(transposed(pair.l1) * n) - length(transposed(pair.l2) * n)) /
               length(n);
    }
    // Distance of the two bodies' points that are farthest along the normal.
    Real witness_distance(const glm::dvec3& normal) const {
        const reference::Vector n = to_world * reference::Vector{normal.x, normal.y, normal.z};
        const reference::Vector a = pair.q1 * n, b = pair.q2 * n;
        const Real ka = length(transposed(pair.l1) * n), kb = length(transposed(pair.l2) * n);
        reference::Vector d;
        for (size_t i = 0; i < 3; ++i) d[i] = pair.r[i] - a[i] / ka - b[i] / kb;
        return length(d);
    }
};

double radial(const PlacedEllipsoid& e, const glm::dvec3& p) {
    return glm::length(glm::inverse(e.factor) * (p - e.center));
}

Ellipsoid centered(const Point& radii, Random& random) {
    return scenes::ellipsoid({0, 0, 0}, radii, random.rotation());
}

// Bodies whose contact function is `target`.
Bodies at_contact(Random& random, double ratio, double size_ratio, double target) {
    const double s = random.log_in(1 / size_ratio, size_ratio);
    const Point ra = scenes::radii(random, ratio), rb = scenes::radii(random, ratio);
    const Ellipsoid a = centered(ra, random), b = centered({s * rb[0], s * rb[1], s * rb[2]}, random);
    const Quat qa = random.rotation(), qb = random.rotation();
    Bodies p{a, b, {{}, qa}, {{}, qb}};
    const Point d = random.direction();
    p.pose_b.translation = scenes::to_float({2 * d[0], 2 * d[1], 2 * d[2]});
    const double t = 2 * target / static_cast<double>(reference::contact({p.a, p.pose_a, p.b, p.pose_b}));
    p.pose_b.translation = scenes::to_float({t * d[0], t * d[1], t * d[2]});
    return p;
}

double size(const Placed& p) {
    return p.a.size + p.b.size + glm::length(p.b.center - p.a.center);
}

constexpr double kRatios[] = {2, 10, 100, 1000};

TEST(Gap, BoundsOfDistanceHoldAndMeet) {
    Random random(1);
    uint32_t pairs = 0, wide = 0;
    uint64_t evaluations = 0;
    for (const double ratio : kRatios)
        for (int i = 0; i < 5000; ++i) {
            const double target = 1 + (i % 3 == 0 ? random.log_in(1e-6, 1e-3) : random.log_in(1e-3, 100));
            const Bodies bodies = at_contact(random, ratio, i % 2 ? 2 : 100, target);
            const Placed p = placed(bodies);
            const Truth truth(bodies);
            const double tolerance = 1e-9 * size(p);
            const Gap gap = query::distance_of(p.a, p.b, tolerance);
            ASSERT_GT(gap.lower, 0) << i;
            ASSERT_LE(gap.lower, gap.upper) << i;
            ASSERT_LE(gap.lower, truth.gap(gap.normal)) << i;
            // Of the two points, only their distance: their error is that of the bound.
            ASSERT_GE(gap.upper, glm::length(gap.point_b - gap.point_a)) << i;
            ASSERT_GE(gap.upper, truth.gap(gap.normal)) << i; // duality
            ASSERT_NEAR(glm::length(gap.normal), 1, 1e-14);
            ASSERT_NEAR(radial(p.a, gap.point_a), 1, 1e-9 * ratio) << i;
            ASSERT_NEAR(radial(p.b, gap.point_b), 1, 1e-9 * ratio * ratio) << i;
            ASSERT_LE(gap.lower, truth.witness_distance(gap.normal)) << i;
            wide += gap.upper - gap.lower > tolerance;
            evaluations += gap.evaluations, ++pairs;
        }
    EXPECT_LE(wide, pairs / 500); // rounding, where curvature is high
    EXPECT_LT(evaluations, 6 * pairs);
}

// The normal that was found, given again, is found again at once; tolerance 0 ends.
TEST(Gap, AStartNormalSavesWork) {
    Random random(2);
    uint64_t cold = 0, warm = 0;
    for (int i = 0; i < 5000; ++i) {
        const Bodies bodies = at_contact(random, kRatios[i % 4], 10, 1 + random.log_in(1e-3, 10));
        const Placed p = placed(bodies);
        const Gap first = query::distance_of(p.a, p.b, 1e-6 * size(p));
        const Gap again = query::distance_of(p.a, p.b, 1e-6 * size(p), 3.0 * first.normal);
        const Gap best = query::distance_of(p.a, p.b, 0);
        ASSERT_LE(again.lower, best.upper);
        ASSERT_LE(best.lower, again.upper);
        ASSERT_LE(best.upper - best.lower, 1e-6 * size(p) + 2e-13 * size(p));
        cold += first.evaluations, warm += again.evaluations;
    }
    EXPECT_LT(2 * warm, cold);
}

TEST(Gap, SpheresAreExact) {
    Random random(3);
    for (int i = 0; i < 5000; ++i) {
        const double ra = random.in(0.1, 2), rb = random.in(0.1, 2), d = random.in(0.01, 8);
        const auto ball = [](double r) {
            const auto f = static_cast<float>(r);
            return Ellipsoid{{}, f, 0, f, 0, 0, f};
        };
        const Point u = random.direction();
        const Bodies bodies{ball(ra), ball(rb), {}, {scenes::to_float({d * u[0], d * u[1], d * u[2]}), {}}};
        const Placed p = placed(bodies);
        const double truth = glm::length(p.b.center) - double{bodies.a.l11} - double{bodies.b.l11};
        const Gap gap = truth > 0 ? query::distance_of(p.a, p.b, 0) : query::depth_of(p.a, p.b, 0);
        ASSERT_LE(gap.lower, truth);
        ASSERT_GE(gap.upper, truth);
        ASSERT_NEAR(gap.lower, truth, 1e-12);
        if (truth > 0) {
            ASSERT_NEAR(gap.upper, truth, 1e-12);
        } else {
            ASSERT_LE(gap.upper, 0.57 * truth);
        }
        ASSERT_NEAR(glm::dot(gap.point_b - gap.point_a, gap.normal), truth, 1e-12);
    }
}

TEST(Gap, BoundsOfDepthHoldAndTheDepthIsTheLeastOfManyDirections) {
    Random random(4);
    uint32_t pairs = 0, not_least = 0;
    double share = 0;
    for (const double ratio : kRatios)
        for (int i = 0; i < 600; ++i) {
            const Bodies bodies =
                at_contact(random, ratio, 5, i % 2 ? random.in(0.05, 1) : 1 - random.log_in(1e-5, 1e-2));
            const Placed p = placed(bodies);
            const Truth truth(bodies);
            const Gap gap = query::depth_of(p.a, p.b, 1e-9 * size(p));
            ASSERT_LT(gap.lower, 0);
            ASSERT_LE(gap.lower, truth.gap(gap.normal));
            ASSERT_LE(gap.upper, 0);
            Real best = -std::numeric_limits<Real>::infinity();
            for (int k = 0; k < 40; ++k) {
                const Point start = random.direction();
                const Gap other = query::depth_of(p.a, p.b, 1e-6 * size(p), {start[0], start[1], start[2]});
                best = std::max(best, truth.gap(other.normal));
                ASSERT_GE(gap.upper, truth.gap(other.normal)) << ratio << ' ' << i;
                ASSERT_GE(gap.upper, truth.gap({start[0], start[1], start[2]})) << ratio << ' ' << i;
            }
            not_least += best > static_cast<Real>(gap.lower) * 0.99L + 1e-8L * size(p);
            share += gap.upper / gap.lower;
            ++pairs;
        }
    EXPECT_LE(not_least, pairs / 20);
    EXPECT_GT(share, 0.2 * pairs); // the certified depth is not empty
}

TEST(Gap, ConcentricBodiesPartAlongTheThinnestAxis) {
    const PlacedEllipsoid disc = query::place(Ellipsoid{{}, 1, 0, 1, 0, 0, 0.1f});
    const Gap gap = query::depth_of(disc, disc, 1e-9);
    EXPECT_NEAR(-gap.lower, 0.2, 1e-6);
    EXPECT_NEAR(std::abs(gap.normal.z), 1, 1e-6);
    EXPECT_LT(gap.upper, -0.1);
}

TEST(Gap, OverlapAndSeparationAreToldApart) {
    Random random(5);
    for (int i = 0; i < 20'000; ++i) {
        const double target = i % 2 ? 1 + random.log_in(1e-7, 1) : 1 - random.log_in(1e-7, 0.9);
        const Bodies bodies = at_contact(random, kRatios[i % 3], 5, target);
        const Placed p = placed(bodies);
        const Gap gap = query::distance_of(p.a, p.b, 1e-3 * size(p));
        if (reference::contact({bodies.a, bodies.pose_a, bodies.b, bodies.pose_b}) < 1) {
            ASSERT_LT(gap.lower, 0) << i;
        } else {
            ASSERT_GT(gap.upper, 0) << i;
        }
        ASSERT_LE(gap.lower, gap.upper) << i;
    }
}

// A harness that cannot fail proves nothing: bounds without their margin are caught.
TEST(Gap, AWrongMarginIsCaught) {
    Random random(6);
    uint32_t caught = 0;
    for (int i = 0; i < 5000; ++i) {
        const Bodies bodies = at_contact(random, kRatios[i % 3], 5, 1 + random.log_in(1e-6, 1));
        const Placed p = placed(bodies);
        const Gap gap = query::distance_of(p.a, p.b, 0);
        const double without = gap.lower + query::kSeparationMargin * (p.a.reach + p.b.reach);
        caught += without > Truth(bodies).gap(gap.normal);
    }
    EXPECT_GT(caught, 100u);
}

TEST(Gap, BadInputClaimsNothing) {
    constexpr double kNan = std::numeric_limits<double>::quiet_NaN(), kInf = std::numeric_limits<double>::infinity();
    const PlacedEllipsoid ball = query::place(Ellipsoid{});
    for (const double bad : {kNan, kInf, -kInf}) {
        PlacedEllipsoid moved = ball, bent = ball;
        moved.center = {bad, 3, 0}, moved.reach = std::abs(bad);
        bent.center = {3, 0, 0}, bent.factor[1][1] = bad, bent.reach = bent.size = std::abs(bad);
        for (const PlacedEllipsoid& b : {moved, bent})
            for (const Gap& gap : {query::distance_of(ball, b, 0), query::distance_of(b, ball, 0, {1, 0, 0}),
                                   query::depth_of(ball, b, 0), query::depth_of(b, ball, 0, {0, 1, 0})}) {
                EXPECT_FALSE(gap.lower > 0);
                EXPECT_FALSE(gap.upper < 0);
            }
    }
}

} // namespace
} // namespace prolate
