// Filled solids: they hold all that the ball cannot reach, the surface first of all, and little else.
#include "builder/fill.hpp"
#include "builder/free_space.hpp"
#include "builder/winding.hpp"

#include "tests/builder/bakes.hpp"
#include "tests/scenes.hpp"
#include "tests/shapes.hpp"

#include <prolate/verify.hpp>

#include <gtest/gtest.h>

#include <cmath>

namespace prolate {
namespace {

// The surface of the unit cube without a square window of this width in the middle of its lower side.
Mesh with_window(float width) {
    Mesh mesh = shapes::box();
    std::erase_if(mesh.triangles, [&](const Triangle& t) {
        return mesh.vertices[t[0]].z + mesh.vertices[t[1]].z + mesh.vertices[t[2]].z == 0;
    });
    const float low = 0.5f - width / 2, high = 0.5f + width / 2;
    const auto frame = [&](float x0, float y0, float x1, float y1) {
        const auto base = static_cast<uint32_t>(mesh.vertices.size());
        mesh.vertices.insert(mesh.vertices.end(), {{x0, y0, 0}, {x1, y0, 0}, {x1, y1, 0}, {x0, y1, 0}});
        mesh.triangles.push_back({base, base + 2, base + 1});
        mesh.triangles.push_back({base, base + 3, base + 2});
    };
    frame(0, 0, 1, low), frame(0, high, 1, 1), frame(0, low, low, high), frame(high, low, 1, high);
    return mesh;
}

double pitch_of(const Mesh& mesh, double radius) {
    Box box;
    for (const Vec3& v : mesh.vertices) box.add(to_vec(v));
    return fill_pitch(box, radius);
}

bool holds(const Winding& filled, const Vec& p) {
    return std::abs(filled(p)) > 0.5;
}

TEST(FreeSpace, DistancesAreNeverOverstatedAndRightWhereTheyMatter) {
    const Mesh mesh = shapes::moved(shapes::torus(1, 0.3f, 24, 12), {3, -2, 1});
    const TriangleTree surface(mesh.view());
    Box region;
    for (const Vec3& v : mesh.vertices) region.add(to_vec(v));
    region.low.array() -= 0.5, region.high.array() += 0.5;
    const FreeSpace space(surface, region, 0.06, 0.2, 0.4);
    size_t inside = 0;
    for (size_t i = 0; i < space.count(); ++i) {
        const double truth = surface.distance(space.node(space.place(i)));
        ASSERT_LE(space.distance(i), truth);
        if (truth < 0.2 || truth > 0.4) continue;
        ++inside;
        ASSERT_NEAR(space.distance(i), truth, 1e-6);
    }
    EXPECT_GT(inside, 1000u);
}

TEST(Fill, AWindowLetsOnlySmallerBallsIn) {
    const Mesh mesh = with_window(0.3f);
    const auto middle = [&](double radius) {
        const Mesh filled = fill(mesh.view(), radius);
        return holds(Winding(filled.view()), Vec(0.5, 0.5, 0.5));
    };
    EXPECT_TRUE(middle(0.2));
    EXPECT_FALSE(middle(0.13));
    EXPECT_FALSE(middle(0.05));
}

// By brute force, for any point that is left out: there is a ball over it that touches nothing.
TEST(Fill, HoldsAllThatTheBallCannotReach) {
    scenes::Random random(7);
    Mesh shards; // triangles without order
    for (int i = 0; i < 60; ++i) {
        const auto base = static_cast<uint32_t>(shards.vertices.size());
        const Vec at(random.in(0, 1), random.in(0, 1), random.in(0, 1));
        for (int corner = 0; corner < 3; ++corner)
            shards.vertices.push_back({static_cast<float>(at.x() + random.in(-0.2, 0.2)),
                                       static_cast<float>(at.y() + random.in(-0.2, 0.2)),
                                       static_cast<float>(at.z() + random.in(-0.2, 0.2))});
        shards.triangles.push_back({base, base + 1, base + 2});
    }
    for (const Mesh& mesh : {with_window(0.2f), shards, shapes::torus(1, 0.3f, 24, 12)}) {
        Box box;
        for (const Vec3& v : mesh.vertices) box.add(to_vec(v));
        const double radius = 0.12 * box.size().maxCoeff();
        const Mesh filled_mesh = fill(mesh.view(), radius);
        const Winding filled(filled_mesh.view());
        const TriangleTree surface(mesh.view());
        for (const Triangle& t : mesh.triangles)
            for (int i = 0; i < 20; ++i) {
                double u = random.in(0, 1), v = random.in(0, 1);
                if (u + v > 1) u = 1 - u, v = 1 - v;
                const Vec a = to_vec(mesh.vertices[t[0]]), b = to_vec(mesh.vertices[t[1]]),
                          c = to_vec(mesh.vertices[t[2]]);
                ASSERT_TRUE(holds(filled, a + u * (b - a) + v * (c - a)));
            }
        int left_out = 0, held = 0;
        for (int i = 0; i < 250; ++i) {
            Vec p;
            for (int k = 0; k < 3; ++k) p[k] = random.in(box.low[k] - 0.05, box.high[k] + 0.05);
            if (holds(filled, p)) {
                ++held;
                continue;
            }
            ++left_out;
            double farthest = 0; // from the surface, of places within the radius
            const int steps = 9;
            for (int x = -steps; x <= steps; ++x)
                for (int y = -steps; y <= steps; ++y)
                    for (int z = -steps; z <= steps; ++z)
                        if (const Vec by = radius / steps * Vec(x, y, z); by.norm() <= radius)
                            farthest = std::max(farthest, surface.distance(p + by));
            ASSERT_GT(farthest, 0.9 * radius) << p.transpose();
        }
        EXPECT_GT(left_out, 20);
        EXPECT_GT(held, 20);
    }
}

TEST(Fill, AddsASkinOfACellOrTwo) {
    const Mesh ball = shapes::icosphere(4);
    const double pitch = pitch_of(ball, 0.3);
    const Mesh filled = fill(ball.view(), 0.3);
    for (const Vec3& v : filled.vertices) {
        ASSERT_GT(to_vec(v).norm(), 0.98);
        ASSERT_LT(to_vec(v).norm(), 1 + 2.5 * pitch);
    }
    const Mesh box = fill(with_window(0.1f).view(), 0.2);
    EXPECT_LT(box.triangles.size(), 400u); // its sides are few rectangles, but for the dent in the window
}

TEST(Fill, AShellBecomesABlockAndIsProved) {
    const Mesh mesh = with_window(0.2f);
    BuildOptions options = quick(0);
    options.ellipsoids = 16;
    const double hollow = must_build(mesh, options).levels.back().union_volume;
    options.fill = 0.15f;
    const Build built = must_build(mesh, options);
    EXPECT_FALSE(built.surface_mode);
    EXPECT_NEAR(built.solid_volume, 1, 0.06);
    EXPECT_EQ(built.tree.view().bake_info().fill, 0.15f);
    EXPECT_GT(built.levels.back().union_volume, hollow * 0.5);
    const auto proof = verify(built.tree.view(), mesh.view());
    ASSERT_TRUE(proof);
    EXPECT_TRUE(proof->covered);
    EXPECT_FALSE(proof->surface_mode);
    // The proof is about the filled solid: the cover of the hollow one is none of it.
    options.threads = 1;
    EXPECT_TRUE(std::ranges::equal(must_build(mesh, options).tree.bytes(), built.tree.bytes()));
}

TEST(Fill, RefusesBallsThatDoNotSuitTheMesh) {
    const Mesh mesh = with_window(0.2f);
    BuildOptions options = quick(1);
    for (const float radius : {0.01f, 0.6f}) {
        options.fill = radius;
        const auto built = build(mesh.view(), options);
        ASSERT_FALSE(built);
        EXPECT_EQ(built.error().code, ErrorCode::bad_options);
    }
    options.fill = 0.1f, options.keep_holes = 0.1f, options.levels = 0;
    EXPECT_FALSE(build(mesh.view(), options));
    // A tree's ball may be far too large or small for another mesh.
    options.keep_holes = 0;
    options.levels = 1;
    const Build built = must_build(mesh, options);
    const auto other = verify(built.tree.view(), shapes::box(1000, 1000, 1000).view());
    ASSERT_FALSE(other);
    EXPECT_EQ(other.error().code, ErrorCode::bad_mesh);
}

} // namespace
} // namespace prolate
