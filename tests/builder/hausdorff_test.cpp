// The distance from a union of ellipsoids to the solid: against exact values and dense samples.
#include "builder/fit.hpp"
#include "builder/hausdorff.hpp"
#include "builder/random.hpp"
#include "tests/shapes.hpp"

#include <gtest/gtest.h>

#include <tbb/task_arena.h>

#include <cmath>
#include <numbers>
#include <vector>

namespace prolate {
namespace {

constexpr double kPi = std::numbers::pi;

Ellipsoid ball(Vec3 center, float radius) {
    return {.center = center, .l11 = radius, .l22 = radius, .l33 = radius};
}

TEST(Hausdorff, OfABallOnASheetIsKnown) {
    const Mesh sheet = shapes::moved(shapes::sheet(8, 8, 10), {-4, -4, 0});
    const std::vector<Ellipsoid> cover{ball({0, 0, 0}, 2)};
    const HausdorffDistance d = hausdorff_distance(cover, Winding(sheet.view()), false, 1e-3); // |z| is even in [0, 2]
    EXPECT_LE(d.max, 2 + 1e-12);
    EXPECT_GE(d.max + d.max_error, 2);
    EXPECT_LE(d.max_error, 1.001e-3);
    EXPECT_NEAR(d.mean, 1, 1e-3);
    EXPECT_NEAR(d.p99, 1.98, 2e-3);
    EXPECT_NEAR(d.area, 16 * kPi, 1e-2);
    EXPECT_GT(d.samples, 15'000u);
}

TEST(Hausdorff, AreaIsThatOfTheUnionsBoundary) {
    // Two unit balls whose centers are 1 apart hide a cap of height 1/2 of each other.
    const Mesh cube = shapes::moved(shapes::box(), {0, -0.5f, -0.5f});
    const Winding winding(cube.view());
    const std::vector<Ellipsoid> two{{}, ball({1, 0, 0}, 1)};
    const HausdorffDistance d = hausdorff_distance(two, winding, true, 1e-3);
    EXPECT_NEAR(d.area, 2 * (4 * kPi - kPi), 0.05);
    // The same again, and one that is hidden, add nothing.
    const std::vector<Ellipsoid> five{two[0], two[1], two[1], two[0], ball({0.5f, 0, 0}, 0.5f)};
    const HausdorffDistance same = hausdorff_distance(five, winding, true, 1e-3);
    EXPECT_NEAR(same.area, d.area, 0.05);
    EXPECT_NEAR(same.mean, d.mean, 5e-3);
    EXPECT_NEAR(same.max, d.max, 1e-3);
}

TEST(Hausdorff, OfEllipsoidsInsideTheSolidIsZero) {
    const Mesh cube = shapes::moved(shapes::box(4, 4, 4), {-2, -2, -2});
    const std::vector<Ellipsoid> inside{{}, ball({0.5f, 0, 0}, 1)};
    const HausdorffDistance d = hausdorff_distance(inside, Winding(cube.view()), true, 1e-3);
    EXPECT_EQ(d.max, 0);
    EXPECT_EQ(d.mean, 0);
    EXPECT_EQ(d.p99, 0);
    EXPECT_GT(d.area, 4 * kPi);
    // Inside out it is the same solid; as an open mesh it is its triangles.
    EXPECT_EQ(hausdorff_distance(inside, Winding(shapes::inverted(cube).view()), true, 1e-3).max, 0);
    EXPECT_NEAR(hausdorff_distance(inside, Winding(cube.view()), false, 1e-3).max, 2, 1e-3);
    EXPECT_EQ(hausdorff_distance({}, Winding(cube.view()), true, 1e-3).max, 0);
}

TEST(Hausdorff, FindsTheWorstPointInACavity) {
    // On the boundary of the union the distance is below 0.1; the ball's center is the farthest point.
    Mesh shell = shapes::icosphere(3);
    shapes::append(shell, shapes::inverted(shapes::moved(shapes::icosphere(3), {}, 0.5f)));
    const Winding winding(shell.view());
    const std::vector<Ellipsoid> cover{ball({0.01f, 0.02f, 0}, 1.05f)};
    const HausdorffDistance d = hausdorff_distance(cover, winding, true, 1e-4);
    EXPECT_LE(d.max, winding.tree().distance(Vec::Zero()) + 1e-3);
    EXPECT_GE(d.max + d.max_error, winding.tree().distance(Vec::Zero()));
    EXPECT_LE(d.max_error, 1.001e-4);
    EXPECT_LT(d.p99, 0.1);
}

TEST(Hausdorff, OfALayerOfConstantThicknessIsFoundToo) {
    const Mesh mesh = shapes::icosphere(5);
    const std::vector<Ellipsoid> cover{ball({0, 0, 0}, 1.2f)};
    const HausdorffDistance d = hausdorff_distance(cover, Winding(mesh.view()), true, 1e-2);
    EXPECT_LE(d.max_error, 1.001e-2);
    EXPECT_NEAR(d.max, 0.2, 2e-3); // a little more: the faces lie below the sphere
    EXPECT_NEAR(d.mean, 0.2, 2e-3);
}

TEST(Hausdorff, BoundsEveryPointOfTheUnion) {
    const Mesh mesh = shapes::torus(1, 0.3f, 32, 16);
    const Winding winding(mesh.view());
    Random random(1);
    for (int round = 0; round < 5; ++round) {
        std::vector<Ellipsoid> cover;
        for (int i = 0; i < 12; ++i) {
            Ellipsoid e = ball({}, 1);
            for (float* v : {&e.center.x, &e.center.y}) *v = float(1.2 * random.symmetric());
            for (float* v : {&e.center.z, &e.l21, &e.l31, &e.l32}) *v = float(0.3 * random.symmetric());
            for (float* v : {&e.l11, &e.l22, &e.l33}) *v = float(0.1 + 0.5 * random.uniform());
            cover.push_back(e);
        }
        const HausdorffDistance d = hausdorff_distance(cover, winding, true, 1e-3, 5000);
        ASSERT_LE(d.max_error, 1.001e-3);
        double largest = 0;
        for (int k = 0; k < 3000; ++k) {
            const size_t own = random.bits() % cover.size();
            Vec u;
            for (int axis = 0; axis < 3; ++axis) u[axis] = random.symmetric();
            const Fit fit(cover[own]);
            const Vec p = fit.center + fit.factor * u.normalized();
            const double distance = std::abs(winding(p, 1e9)) > 0.5 ? 0 : winding.tree().distance(p);
            ASSERT_LE(distance, d.max + d.max_error);
            largest = std::max(largest, distance);
        }
        EXPECT_GT(largest, 0.85 * d.max);
        EXPECT_LT(d.mean, d.p99);
        EXPECT_LT(d.p99, d.max);
    }
}

TEST(Hausdorff, IsTheSameForAnyNumberOfThreads) {
    const Mesh mesh = shapes::torus(1, 0.3f, 32, 16);
    const Winding winding(mesh.view());
    std::vector<Ellipsoid> cover;
    for (int i = 0; i < 40; ++i) {
        const float turn = 2 * float(kPi) * float(i) / 40;
        cover.push_back(ball({std::cos(turn), std::sin(turn), 0}, 0.35f));
    }
    HausdorffDistance d[2];
    for (const int threads : {1, 2})
        tbb::task_arena(threads).execute([&] { d[threads > 1] = hausdorff_distance(cover, winding, true, 1e-3); });
    EXPECT_EQ(d[0].max, d[1].max);
    EXPECT_EQ(d[0].max_error, d[1].max_error);
    EXPECT_EQ(d[0].mean, d[1].mean);
    EXPECT_EQ(d[0].p99, d[1].p99);
    EXPECT_EQ(d[0].area, d[1].area);
    EXPECT_NEAR(d[0].area, 4 * kPi * kPi * 0.35, 0.1); // a bumpy torus
}

} // namespace
} // namespace prolate
