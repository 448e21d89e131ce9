// How far bodies that deform are apart, against all pairs of their triangles and of their leaves.
#include "query/ellipsoid/gap.hpp"
#include "query/triangle/distance.hpp"
#include "tests/query/deform/moving_bodies.hpp"

#include <prolate/deform.hpp>
#include <prolate/distance.hpp>

#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <limits>
#include <memory>
#include <vector>

namespace prolate {
namespace {

using moving::ball, moving::ball_cover, moving::ball_exact, moving::Moving, moving::near_pose, moving::placed;
using moving::torus, moving::torus_cover, moving::torus_exact;
using scenes::Random;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

class DeformedDistances : public testing::Test {
protected:
    std::unique_ptr<QueryContext> context_ = std::make_unique<QueryContext>();
    QueryContext& context() { return *context_; }
};

// Of two sets of triangles, by all pairs whose bounding spheres are near enough.
double distance_of(const std::vector<query::PlacedTriangle>& a, const std::vector<query::PlacedTriangle>& b) {
    const auto sphere = [](const query::PlacedTriangle& t) {
        const glm::dvec3 middle = (t.corner[0] + t.corner[1] + t.corner[2]) / 3.0;
        double radius = 0;
        for (const glm::dvec3& corner : t.corner) radius = std::max(radius, glm::length(corner - middle));
        return std::pair(middle, radius);
    };
    std::vector<std::pair<glm::dvec3, double>> spheres;
    for (const auto& y : b) spheres.push_back(sphere(y));
    double out = kInfinity;
    for (const auto& x : a) {
        const auto [middle, radius] = sphere(x);
        for (size_t i = 0; i < b.size(); ++i)
            if (glm::length(middle - spheres[i].first) - radius - spheres[i].second < out)
                out = std::min(out, query::distance(x, b[i]).upper);
    }
    return out;
}

// Of the leaf ellipsoids, as deformation.hpp says that q moves and enlarges them: the least distance of two.
struct Leaf {
    query::PlacedEllipsoid core;
    double radius;
};
std::vector<Leaf> leaves(const TreeView& tree, const std::vector<float>& q, const Pose& pose) {
    std::vector<Leaf> out;
    const glm::dmat3 rotation = query::rotation_matrix(pose.rotation);
    tree.for_each_in_cut(tree.level_count() - 1, [&](uint32_t node) {
        Leaf leaf{query::place(tree.ellipsoid(node)), 0};
        double grown = 1;
        for (uint32_t m = 0; m < q.size(); ++m) {
            const Deformation::Motion motion = tree.deformation()->motion(node, m);
            leaf.core.center += double{q[m]} * glm::dvec3(motion.shift[0], motion.shift[1], motion.shift[2]);
            grown += std::abs(double{q[m]}) * motion.growth;
            leaf.radius += std::abs(double{q[m]}) * motion.radius;
        }
        leaf.core.factor = rotation * (grown * leaf.core.factor);
        leaf.core.center = rotation * leaf.core.center + query::to_double(pose.translation);
        leaf.core.size *= grown, leaf.core.reach = 10;
        out.push_back(leaf);
    });
    return out;
}
double distance_of(const std::vector<Leaf>& a, const std::vector<Leaf>& b) {
    double out = kInfinity;
    for (const Leaf& x : a)
        for (const Leaf& y : b)
            out = std::min(out, std::max(0.0, query::distance_of(x.core, y.core, 0).upper - x.radius - y.radius));
    return out;
}

double between(const DeformedDistanceResult& r) {
    return glm::length(query::to_double(r.point_b) - query::to_double(r.point_a));
}

constexpr double kRounding = 1e-6; // of points, as floats, and of the default tolerance

TEST_F(DeformedDistances, BoundsHoldOfDeformedTriangles) {
    Random random(21);
    int apart = 0, meeting = 0;
    for (int i = 0; i < 250; ++i) {
        const auto q_a = torus().random_q(random), q_b = ball().random_q(random);
        const Pose pose_a = near_pose(random, 1), pose_b = near_pose(random, 5);
        const double truth = distance_of(placed(torus(), q_a, pose_a), placed(ball(), q_b, pose_b));
        for (const bool exact_a : {false, true})
            for (const bool exact_b : {false, true}) {
                const DeformedBody a{(exact_a ? torus_exact() : torus_cover()).view(), pose_a, q_a},
                    b{(exact_b ? ball_exact() : ball_cover()).view(), pose_b, q_b};
                const DeformedDistanceResult found = distance(a, b, context());
                ASSERT_EQ(found.reason, Undecided::no);
                EXPECT_LE(found.lower, truth + 1e-12) << i; // never a false lower bound
                EXPECT_LE(found.lower, found.upper);
                if (!found.enclosed) {
                    EXPECT_LE(found.upper - found.lower, 1e-6 * found.upper + 1e-8) << i;
                }
                if (exact_a && exact_b) {
                    EXPECT_GE(found.upper, truth - 1e-9) << i;
                    EXPECT_NEAR(between(found), found.upper, kRounding) << i;
                    if (found.verdict == Verdict::separated) {
                        EXPECT_NEAR(found.upper, truth, 1e-6 * truth + 1e-9) << i;
                    }
                    apart += found.verdict == Verdict::separated, meeting += found.verdict == Verdict::overlapping;
                }
                const auto met = collide(a, b, context());
                EXPECT_EQ(found.verdict, met.verdict) << i;
                EXPECT_EQ(found.enclosed, met.enclosed) << i;
                const DeformedDistanceResult swapped = distance(b, a, context());
                EXPECT_EQ(swapped.verdict, found.verdict);
                EXPECT_NEAR(swapped.lower, found.lower, 1e-5 * found.upper + 1e-8);
            }
    }
    EXPECT_GT(apart, 60);
    EXPECT_GT(meeting, 60);
}

TEST_F(DeformedDistances, UpperBoundsAreThoseOfLeavesThatHaveMoved) {
    Random random(22);
    int same = 0, apart = 0;
    for (int i = 0; i < 300; ++i) {
        const auto q_a = torus().random_q(random), q_b = ball().random_q(random);
        const Pose pose_a = near_pose(random, 1), pose_b = near_pose(random, 6);
        const TreeView a = torus_cover().view(), b = ball_cover().view();
        const double truth = distance_of(leaves(a, q_a, pose_a), leaves(b, q_b, pose_b));
        const auto found = distance({a, pose_a, q_a}, {b, pose_b, q_b}, context());
        EXPECT_GE(found.upper, truth - 1e-9) << i;
        if (found.verdict != Verdict::separated) continue;
        EXPECT_LE(between(found), found.upper + kRounding) << i;
        EXPECT_GE(between(found), truth - kRounding) << i;
        EXPECT_NEAR(glm::length(query::to_double(found.normal)), 1, 1e-6);
        ++apart, same += found.upper <= truth * (1 + 1e-5) + 1e-9;
        EXPECT_GE(found.lower, truth * (1 - 1e-5) - 1e-9) << i; // nodes above leaves only raise it
    }
    EXPECT_GT(apart, 100);
    EXPECT_GT(same, apart / 2);
}

TEST_F(DeformedDistances, OfRigidBodiesAreThoseOfTheOtherQuery) {
    Random random(23);
    const Build rigid = must_build(shapes::box(0.5f, 0.6f, 0.7f), quick(1));
    for (int i = 0; i < 200; ++i) {
        const Pose pose_a = near_pose(random, 1), pose_b = near_pose(random, 5);
        for (const TreeView& one : {torus_exact().view(), torus_cover().view()})
            for (const TreeView& other : {rigid.tree.view(), ball_cover().view(), ball_exact().view()}) {
                const auto known = distance(one, pose_a, other, pose_b, context());
                const auto found = distance(DeformedBody{one, pose_a}, {other, pose_b}, context());
                if (found.enclosed) continue;
                EXPECT_EQ(found.verdict, known.verdict) << i;
                EXPECT_NEAR(found.lower, known.lower, 1e-5 * known.upper + 1e-8) << i;
                if (known.verdict == Verdict::separated) {
                    EXPECT_NEAR(found.upper, known.upper, 1e-5 * known.upper + 1e-8) << i;
                }
            }
    }
}

TEST_F(DeformedDistances, LimitsOnlyWidenTheBounds) {
    Random random(24);
    std::vector<std::byte> small(scratch_size(torus_exact().view(), ball_exact().view()));
    for (int i = 0; i < 12; ++i) {
        const auto q_a = torus().random_q(random), q_b = ball().random_q(random);
        const Pose pose_a = near_pose(random, 1), pose_b = near_pose(random, 5);
        const DeformedBody a{(i % 2 ? torus_exact() : torus_cover()).view(), pose_a, q_a},
            b{(i % 3 ? ball_exact() : ball_cover()).view(), pose_b, q_b};
        const auto best = distance(a, b, context());
        const double wide = 1e-6 * best.upper + 1e-8;
        DeformedDistanceResult last;
        for (uint64_t budget = 0; budget < best.stats.tests() + 100; budget += budget < 60 ? 1 : 37) {
            const auto now = distance(a, b, context(), {.max_pair_tests = budget});
            ASSERT_LE(now.stats.tests(), budget);
            ASSERT_GE(now.lower, last.lower) << budget;
            ASSERT_LE(now.upper, last.upper) << budget;
            ASSERT_TRUE(last.verdict == Verdict::undecided || last.verdict == now.verdict) << budget;
            ASSERT_EQ(now.reason, now.verdict == Verdict::undecided ? Undecided::budget : Undecided::no);
            last = now;
        }
        EXPECT_EQ(last.verdict, best.verdict);
        double lower = 0;
        for (uint32_t level = 0; level < 8; ++level) {
            const auto now = distance(a, b, context(), {.max_level = level});
            EXPECT_GE(now.lower, lower - wide);
            EXPECT_LE(now.lower, best.upper);
            EXPECT_GE(now.upper, best.lower);
            EXPECT_LT(now.upper, kInfinity);
            lower = now.lower;
        }
        const auto narrow = distance(a, b, Scratch(small));
        EXPECT_EQ(narrow.verdict, best.verdict);
        EXPECT_NEAR(narrow.upper, best.upper, wide);
        EXPECT_NEAR(narrow.lower, best.lower, wide);
        const auto rough = distance(a, b, context(), {.tolerance_relative = 0.3});
        EXPECT_EQ(rough.verdict, best.verdict);
        EXPECT_GE(rough.lower, 0.7 * rough.upper - wide);
        if (best.verdict == Verdict::separated) {
            EXPECT_LE(rough.stats.tests(), best.stats.tests());
        }
        const auto near_by = distance(a, b, context(), {.max_distance = best.lower / 2});
        EXPECT_GE(near_by.lower, best.enclosed ? 0 : best.lower / 2);
        EXPECT_EQ(near_by.verdict, best.verdict);
    }
}

TEST_F(DeformedDistances, WhatLiesInsideIsAtDistanceNought) {
    const Moving hollow(shapes::hollow_ball(), 2, 0.02, 8);
    const Moving small(shapes::moved(shapes::icosphere(1), {}, 0.05f), 2, 0.02, 9);
    const Tree outer = hollow.bake(true), inner = small.bake(true);
    for (const Pose& pose : {Pose{}, Pose{{0.95f, 0.95f, 0.95f}, {}}}) {
        const auto found = distance({outer.view(), {}, hollow.ranges}, {inner.view(), pose, small.ranges}, context());
        const bool inside = pose.translation.x == 0;
        EXPECT_EQ(found.verdict, inside ? Verdict::overlapping : Verdict::separated);
        EXPECT_EQ(found.enclosed, inside);
        EXPECT_EQ(found.lower == 0, inside);
        EXPECT_GT(found.upper, 0.01); // of the surfaces
    }
}

TEST_F(DeformedDistances, NothingIsSaidOfCoordinatesOutOfRange) {
    const TreeView tree = torus_cover().view(), other = ball_cover().view();
    const Pose far{{100, 0, 0}, {}}, nowhere{{std::numeric_limits<float>::quiet_NaN(), 0, 0}, {}};
    std::vector<float> q = torus().ranges;
    EXPECT_EQ(distance({tree, {}, q}, {other, far}, context()).verdict, Verdict::separated);
    const auto says_nothing = [](const DeformedDistanceResult& r, Undecided reason) {
        EXPECT_EQ(r.verdict, Verdict::undecided);
        EXPECT_EQ(r.reason, reason);
        EXPECT_EQ(r.lower, 0);
        EXPECT_EQ(r.upper, kInfinity);
    };
    says_nothing(distance({tree, nowhere, q}, {other, far}, context()), Undecided::input);
    says_nothing(distance({tree, {}, q}, {other, far}, Scratch(std::span<std::byte>())), Undecided::input);
    says_nothing(distance({tree, {}, q}, {other, far}, context(), {.max_pair_tests = 0}), Undecided::budget);
    q[1] = std::nextafter(q[1], 100.0f);
    says_nothing(distance({tree, {}, q}, {other, far}, context()), Undecided::coordinates);
    says_nothing(distance({other, far}, {tree, {}, q}, context()), Undecided::coordinates);
}

TEST_F(DeformedDistances, ScaledAndRoundedTreesAreScaledAndRounded) {
    Random random(25);
    for (const TreeView& tree : {ball_cover().view(), ball_exact().view()})
        for (int i = 0; i < 60; ++i) {
            const auto q = ball().random_q(random);
            const Pose pose = near_pose(random, 6),
                       doubled{{2 * pose.translation.x, 2 * pose.translation.y, 2 * pose.translation.z}, pose.rotation};
            const TreeView large = *tree.scaled(2), round = *tree.rounded(0.1f);
            const auto one = distance({tree, {}, q}, {tree, pose, q}, context());
            const auto twice = distance({large, {}, q}, {large, doubled, q}, context());
            EXPECT_EQ(twice.verdict, one.verdict);
            EXPECT_NEAR(twice.lower, 2 * one.lower, 1e-5 * one.upper + 1e-8);
            const auto rounded = distance({round, {}, q}, {round, pose, q}, context());
            EXPECT_EQ(rounded.verdict, collide({round, {}, q}, {round, pose, q}, context()).verdict);
            EXPECT_LE(rounded.lower, std::max(0.0, one.upper - 0.2) + 1e-7);
            if (rounded.verdict != Verdict::separated) continue;
            EXPECT_NEAR(rounded.upper, one.upper - 0.2, 1e-5 * one.upper + 1e-7);
            EXPECT_LE(rounded.upper - rounded.lower, 1e-6 * rounded.upper + 1e-8);
            EXPECT_NEAR(between(rounded), between(one) - 0.2, kRounding * 10);
        }
}

} // namespace
} // namespace prolate
