// Holes that covers leave free: which a mesh has, how far a cover is from them, and bakes that keep them.
#include "builder/fit.hpp"
#include "builder/passages.hpp"

#include "tests/builder/bakes.hpp"
#include "tests/scenes.hpp"
#include "tests/shapes.hpp"

#include <prolate/verify.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace prolate {
namespace {

// Points of an ellipsoid's surface.
std::vector<Vec> points_of(const Ellipsoid& e, int count) {
    const Fit fit(e);
    std::vector<Vec> out;
    for (int i = 0; i < count; ++i) {
        const double z = 1 - (2 * i + 1.0) / count, angle = 2.399963229728653 * i, r = std::sqrt(1 - z * z);
        out.push_back(fit.center + fit.factor * Vec(r * std::cos(angle), r * std::sin(angle), z));
    }
    return out;
}

TEST(Passages, OnlyHolesAreFoundThatTheBallPasses) {
    const Mesh ring = shapes::torus(1, 0.3f, 48, 24); // its hole has a radius of 0.7
    EXPECT_TRUE(Passages(ring.view(), 0.3).any());
    EXPECT_TRUE(Passages(ring.view(), 0.5).any());
    EXPECT_FALSE(Passages(ring.view(), 0.8).any());
    EXPECT_FALSE(Passages(shapes::box().view(), 0.1).any());
    // The skeleton leads through the middle of the ring.
    const Passages passages(ring.view(), 0.4);
    EXPECT_TRUE(std::ranges::any_of(passages.skeleton(), [](const Vec& p) { return p.norm() < 0.2; }));
    // Two balls: the ball passes between them, or not.
    Mesh two = shapes::icosphere(2);
    shapes::append(two, shapes::moved(shapes::icosphere(2), {3, 0, 0}));
    EXPECT_TRUE(Passages(two.view(), 0.3).any());
    EXPECT_FALSE(Passages(two.view(), 0.6).any());
}

TEST(Passages, TheDistanceOfACoverIsALowerBoundAndTight) {
    const Passages passages(shapes::torus(1, 0.3f, 48, 24).view(), 0.4);
    scenes::Random random(5);
    for (int trial = 0; trial < 60; ++trial) {
        Mat lower = Mat::Zero();
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j <= i; ++j) lower(i, j) = i == j ? random.in(0.02, 0.4) : random.in(-0.2, 0.2);
        const Fit fit(Vec(random.in(-1, 1), random.in(-1, 1), random.in(-1, 1)), lower);
        const Ellipsoid e = fit.ellipsoid();
        const Fit rounded(e);
        double truth = HUGE_VAL;
        const std::vector<Vec> points = points_of(e, 2000);
        for (const Vec& p : passages.skeleton()) {
            if (rounded.radial_squared(p) <= 1) truth = 0;
            for (const Vec& q : points) truth = std::min(truth, (p - q).norm());
        }
        const double found = passages.nearest({{e}}).distance;
        EXPECT_LE(found, truth);
        if (truth < 1) {
            EXPECT_NEAR(found, truth, 0.05);
        }
    }
}

TEST(Passages, ABakeKeepsTheHoleFree) {
    const Mesh ring = shapes::torus(1, 0.3f, 48, 24);
    BuildOptions options = quick(0);
    options.keep_holes = 0.5f;
    const Build built = must_build(ring, options);
    EXPECT_TRUE(built.goal_reached);
    EXPECT_GE(built.hole_radius, 0.5);
    EXPECT_EQ(built.tree.view().bake_info().keep_holes, 0.5f);
    const auto proof = verify(built.tree.view(), ring.view());
    ASSERT_TRUE(proof);
    EXPECT_TRUE(proof->covered && proof->holes_kept);
    // Somewhere in the plane of the ring there is room for the ball.
    std::vector<Vec> cover;
    const TreeView tree = built.tree.view();
    tree.for_each_in_cut(tree.level_count() - 1, [&](uint32_t n) {
        const std::vector<Vec> points = points_of(tree.ellipsoid(n), 2000);
        cover.insert(cover.end(), points.begin(), points.end());
    });
    double widest = 0;
    for (double x = -0.3; x <= 0.3; x += 0.05)
        for (double y = -0.3; y <= 0.3; y += 0.05) {
            double room = HUGE_VAL;
            for (const Vec& q : cover) room = std::min(room, (q - Vec(x, y, 0)).norm());
            widest = std::max(widest, room);
        }
    EXPECT_GE(widest, 0.5);
}

TEST(Passages, WhatCannotBeKeptIsAdmitted) {
    const Mesh ring = shapes::torus(1, 0.3f, 48, 24);
    BuildOptions options = quick(0);
    options.keep_holes = 0.5f, options.ellipsoids = 2;
    const Build built = must_build(ring, options);
    EXPECT_FALSE(built.goal_reached);
    EXPECT_LT(built.hole_radius, 0.5);
    const auto proof = verify(built.tree.view(), ring.view());
    ASSERT_TRUE(proof);
    EXPECT_FALSE(proof->holes_kept || proof->covered);
    for (const LevelProof& level : proof->levels) EXPECT_TRUE(level.covered);
    options.ellipsoids = 0;
    const auto none = build(shapes::box().view(), options);
    ASSERT_FALSE(none);
    EXPECT_EQ(none.error().code, ErrorCode::bad_options);
}

} // namespace
} // namespace prolate
