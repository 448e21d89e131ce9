// The lattice of distances against exact distances and winding numbers.
#include "builder/distance_field.hpp"
#include "builder/random.hpp"
#include "tests/shapes.hpp"

#include <gtest/gtest.h>

#include <tbb/task_arena.h>

#include <algorithm>
#include <vector>

namespace prolate {
namespace {

Vec random_vec(Random& random) {
    const double x = random.symmetric(), y = random.symmetric(), z = random.symmetric();
    return {x, y, z};
}

Box box_of(const Mesh& mesh) {
    Box box;
    for (const Vec3& v : mesh.vertices) box.add(to_vec(v));
    return box;
}

// Compares at random points of a box twice as large as the mesh's; returns how many were inside.
int compare(const Mesh& mesh, uint32_t resolution) {
    const Winding winding(mesh.view());
    const DistanceField field(mesh.view(), true, winding, resolution);
    const Box box = box_of(mesh);
    Random random(resolution);
    int inside = 0;
    for (int round = 0; round < 3000; ++round) {
        const Vec p = box.center() + random_vec(random).cwiseProduct(box.size());
        const double distance = winding.tree().distance(p);
        const bool in = std::abs(winding(p, HUGE_VAL)) > 0.5;
        inside += in;
        const double off = std::abs(field(p) - (in ? -distance : distance));
        const Vec margin = (p - box.center()).cwiseAbs() - 0.5 * box.size();
        const double beyond = margin.maxCoeff();
        if (beyond < 2 * field.pitch()) {
            // Linear between nodes: where the distance has a crease the chord is off by up to half a step's diagonal.
            EXPECT_LE(off, 0.9 * field.pitch()) << p.transpose();
        } else {
            // The nearest point of the lattice is a detour, or the way from there to the surface leads back.
            EXPECT_GT(field(p), 0);
            EXPECT_LE(field(p), distance + 2 * (margin.cwiseMax(0).norm() + field.pitch()));
            EXPECT_GE(field(p), margin.cwiseMax(0).norm() - 6 * field.pitch());
        }
        // Signs, wherever the surface is not within the interpolation's reach.
        if (distance > 0.9 * field.pitch()) {
            EXPECT_EQ(field(p) < 0, in) << p.transpose();
        }
    }
    return inside;
}

TEST(DistanceField, IsTheSignedDistance) {
    for (const uint32_t resolution : {16u, 60u}) {
        EXPECT_GT(compare(shapes::icosphere(3), resolution), 100);
        EXPECT_GT(compare(shapes::box(1, 2, 3), resolution), 100);
        EXPECT_GT(compare(shapes::torus(1, 0.3f, 48, 24), resolution), 50);
        EXPECT_GT(compare(shapes::moved(shapes::icosphere(2), {1e4f, -2e4f, 3e3f}, 0.5f), resolution), 100);
        EXPECT_GT(compare(shapes::moved(shapes::torus(1, 0.4f, 48, 24), {}, 1e-5f), resolution), 50);
    }
}

TEST(DistanceField, TellsOutwardsAndInwardsApartWhateverTheOrientation) {
    const Mesh ball = shapes::icosphere(3), turned = shapes::inverted(ball);
    const DistanceField one(ball.view(), true, Winding(ball.view()), 40);
    const DistanceField other(turned.view(), true, Winding(turned.view()), 40);
    EXPECT_TRUE(std::ranges::equal(one.values(), other.values()));
    EXPECT_NEAR(other(Vec::Zero()), -1, 0.03);
}

TEST(DistanceField, IsAccurateNextToASmoothSurface) {
    // Where the optimiser looks: the error of interpolation there is that of a chord, half the curvature times the
    // square of half a step's diagonal.
    const Mesh ball = shapes::icosphere(5);
    const DistanceField field(ball.view(), true, Winding(ball.view()), 64);
    Random random(5);
    for (int round = 0; round < 3000; ++round) {
        const Vec p = random_vec(random);
        const double at = 1 + 0.02 * random.symmetric();
        EXPECT_NEAR(field(at * p.normalized()), at - 1, 1e-3);
    }
}

TEST(DistanceField, NodesNextToTheSurfaceAreExact) {
    const Mesh mesh = shapes::torus(1, 0.3f, 40, 20);
    const Winding winding(mesh.view());
    const DistanceField field(mesh.view(), true, winding, 30);
    const auto& size = field.size();
    int near = 0;
    for (int i = 0; i < size[0]; ++i)
        for (int j = 0; j < size[1]; ++j)
            for (int k = 0; k < size[2]; ++k) {
                const Vec p = field.origin() + field.pitch() * Vec(i, j, k);
                const double exact = winding.tree().distance(p);
                const double distance = std::abs(double{field.values()[field.index(i, j, k)]});
                EXPECT_GE(distance, exact * (1 - 1e-5) - 1e-6); // the distance of some point of the surface
                EXPECT_LE(distance, exact + 0.5 * field.pitch());
                if (exact > field.pitch() || exact < 1e-3) continue;
                ++near;
                EXPECT_NEAR(distance, exact, 1e-6);
            }
    EXPECT_GT(near, 1000);
}

TEST(DistanceField, OfAnOpenSheetIsPositive) {
    const Mesh sheet = shapes::sheet(2, 1, 4);
    const DistanceField field(sheet.view(), false, Winding(sheet.view()), 32);
    for (const float d : field.values()) EXPECT_GE(d, 0);
    Random random(6);
    for (int round = 0; round < 1000; ++round) {
        const Vec p(2 * random.uniform(), random.uniform(), 0.18 * random.symmetric());
        EXPECT_NEAR(field(p), std::abs(p.z()), field.pitch());
    }
}

TEST(DistanceField, IsTheSameForAnyNumberOfThreads) {
    const Mesh mesh = shapes::torus(1, 0.3f, 40, 20);
    const Winding winding(mesh.view());
    std::vector<float> values[2];
    for (const size_t run : {0u, 1u})
        tbb::task_arena(run == 0 ? 1 : 4).execute([&] {
            const DistanceField field(mesh.view(), true, winding, 50);
            values[run].assign(field.values().begin(), field.values().end());
        });
    EXPECT_EQ(values[0], values[1]);
}

} // namespace
} // namespace prolate
