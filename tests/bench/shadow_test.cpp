// Shadows of experiments: ellipsoids against fine meshes of them, and against lines followed one by one.
#include "bench/shadows/shadow.hpp"
#include "cli/export/sphere.hpp"
#include "tests/scenes.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace {

using namespace prolate;
using namespace prolate::bench;
using glm::dvec3;

// z is up; the ground is z = 0, one pixel 0.05 wide.
Ground some_ground() {
    return {{0, 0, 1}, {0.05, 0, 0}, {0, -0.05, 0}, {-5, 5, 0}, 200, 200};
}

Mesh mesh_of(const Ellipsoid& e) {
    const cli::SphereMesh sphere = cli::sphere_mesh(256);
    Mesh mesh;
    for (const auto& [x, y, z] : sphere.vertices)
        mesh.vertices.push_back({static_cast<float>(e.center.x + e.l11 * x),
                                 static_cast<float>(e.center.y + e.l21 * x + e.l22 * y),
                                 static_cast<float>(e.center.z + e.l31 * x + e.l32 * y + e.l33 * z)});
    mesh.triangles = sphere.triangles;
    return mesh;
}

std::vector<Ellipsoid> some_ellipsoids(float height) {
    scenes::Random random(3);
    std::vector<Ellipsoid> out;
    for (int i = 0; i < 20; ++i) {
        const auto size = [&] { return static_cast<float>(random.log_in(0.05, 0.7)); };
        const auto skew = [&] { return static_cast<float>(random.in(-0.3, 0.3)); };
        Ellipsoid e{scenes::to_float(random.direction()), size(), skew(), size(), skew(), skew(), size()};
        e.center.z += height;
        out.push_back(e);
    }
    return out;
}

TEST(Shadow, OfAnEllipsoidIsThatOfItsMesh) {
    const Ground ground = some_ground();
    const dvec3 light(4, -3, 9);
    for (const Ellipsoid& e : some_ellipsoids(2.5)) {
        const Mesh mesh = mesh_of(e);
        Mask smooth(ground.columns * ground.rows), facets(smooth);
        cast_shadow(std::span(&e, 1), light, ground, smooth);
        cast_shadow(mesh.view(), light, ground, facets);
        int dark = 0, only_smooth = 0, only_facets = 0;
        for (size_t i = 0; i < smooth.size(); ++i)
            dark += smooth[i], only_smooth += smooth[i] & ~facets[i], only_facets += facets[i] & ~smooth[i];
        EXPECT_GT(dark, 5);
        EXPECT_EQ(only_facets, 0) << "corners lie on the ellipsoid";
        EXPECT_LE(only_smooth, 2 + dark / 100);
        // Every dark pixel lies in the extent, and the extent is not much larger.
        const Extent extent = shadow_extent(mesh.view(), light, ground),
                     box = shadow_extent(std::span(&e, 1), light, ground);
        for (int y = 0; y < ground.rows; ++y)
            for (int x = 0; x < ground.columns; ++x)
                if (smooth[static_cast<size_t>(y * ground.columns + x)]) {
                    EXPECT_TRUE(x + 0.5 >= box.x0 && x + 0.5 <= box.x1 && y + 0.5 >= box.y0 && y + 0.5 <= box.y1);
                    EXPECT_TRUE(x + 0.6 >= extent.x0 && x + 0.4 <= extent.x1 && y + 0.6 >= extent.y0 &&
                                y + 0.4 <= extent.y1);
                }
    }
}

TEST(Shadow, IsOfWhatLiesBetweenGroundAndLight) {
    const Ground ground = some_ground();
    const dvec3 light(1, 2, 8);
    const std::vector<Ellipsoid> cover = some_ellipsoids(0.5); // some reach below the ground, some lie there
    Mask mask(ground.columns * ground.rows);
    cast_shadow(cover, light, ground, mask);
    int dark = 0, unsure = 0;
    for (int y = 0; y < ground.rows; y += 3)
        for (int x = 0; x < ground.columns; x += 3) {
            // The least radial coordinate along the line from the pixel to the light, by small steps.
            const dvec3 from = ground.corner + (x + 0.5) * ground.right + (y + 0.5) * ground.down;
            double least = 1e9;
            for (int k = 0; k <= 400; ++k) {
                const dvec3 p = from + (light - from) * (k / 400.0);
                if (p.z > 3) break;
                const double point[3] = {p.x, p.y, p.z};
                for (const Ellipsoid& e : cover) least = std::min(least, radial_squared(e, point));
            }
            const int seen = mask[static_cast<size_t>(y * ground.columns + x)];
            dark += seen;
            if (least <= 1)
                EXPECT_EQ(seen, 1) << x << ", " << y;
            else if (least > 1.2)
                EXPECT_EQ(seen, 0) << x << ", " << y;
            else
                ++unsure;
        }
    EXPECT_GT(dark, 80);
    EXPECT_LT(unsure, dark / 4);
}

TEST(Shadow, LikenessCountsPixels) {
    const Shadow a{{1, 0.5f, 0, 0}, {1, 1, 0, 0}}, b{{1, 0, 0.5f, 0}, {1, 0, 1, 0}};
    EXPECT_DOUBLE_EQ(likeness(a, b).iou, 1.0 / 3);
    EXPECT_DOUBLE_EQ(likeness(a, b).difference, 1.0 / 3);
    EXPECT_DOUBLE_EQ(likeness(a, a).iou, 1);
    EXPECT_DOUBLE_EQ(likeness(a, a).difference, 0);
}

TEST(Shadow, OfALampIsSoft) {
    const Ground ground = some_ground();
    const Lamp lamp{{0, 0, 8}, {2, 0, 0}, {0, 2, 0}};
    const Ellipsoid ball{{0, 0, 2}, 0.5f, 0, 0.5f, 0, 0, 0.5f};
    const Shadow shadow = shadow_of(std::span(&ball, 1), lamp, ground, 5);
    const auto at = [&](double x, double y) {
        return static_cast<size_t>((5 - y) / 0.05) * 200 + static_cast<size_t>((x + 5) / 0.05);
    };
    EXPECT_EQ(shadow.darkness[at(0.01, 0.01)], 1);
    EXPECT_EQ(shadow.darkness[at(3, 0)], 0);
    const float half = shadow.darkness[at(0.67, 0.01)]; // about the border of the shadow from the center
    EXPECT_TRUE(half > 0.2 && half < 0.8) << half;
    EXPECT_EQ(shadow.from_center[at(0.6, 0.01)], 1);
    EXPECT_EQ(shadow.from_center[at(0.75, 0.01)], 0);
}

} // namespace
