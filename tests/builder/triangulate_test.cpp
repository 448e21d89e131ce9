// triangulate(): concave, touching and degenerate polygons; the triangles tile them.
#include "builder/triangulate.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <random>

namespace prolate {
namespace {

using Polygon = std::vector<std::array<double, 2>>;

double area(const Polygon& p) {
    double twice = 0;
    for (size_t i = 0; i < p.size(); ++i) {
        const auto &a = p[i], &b = p[(i + 1) % p.size()];
        twice += a[0] * b[1] - a[1] * b[0];
    }
    return twice / 2;
}

// The polygon in space: across `axis`, or turned by a matrix if `turn`.
std::vector<Vec3> in_space(const Polygon& flat, size_t axis, bool turn) {
    std::vector<Vec3> out;
    for (const auto& [x, y] : flat) {
        std::array<double, 3> p{};
        p[(axis + 1) % 3] = x, p[(axis + 2) % 3] = y;
        if (turn) { // about the axis (1, 2, 2) / 3 by 90 degrees: rational numbers, so columns are orthonormal
            const double m[3][3] = {{1. / 9, -4. / 9, 8. / 9}, {8. / 9, 4. / 9, 1. / 9}, {-4. / 9, 7. / 9, 4. / 9}};
            const std::array<double, 3> q = p;
            for (size_t i = 0; i < 3; ++i) p[i] = m[i][0] * q[0] + m[i][1] * q[1] + m[i][2] * q[2];
        }
        out.push_back({static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])});
    }
    return out;
}

std::array<double, 3> cross(const Vec3& a, const Vec3& b, const Vec3& c) {
    const double u[3] = {double{b.x} - a.x, double{b.y} - a.y, double{b.z} - a.z};
    const double v[3] = {double{c.x} - a.x, double{c.y} - a.y, double{c.z} - a.z};
    return {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]};
}

// The triangles are n - 2, face as the polygon does, use every edge once, and their areas sum up to its.
void expect_tiled(const Polygon& flat, bool turn = true) {
    for (const bool backwards : {false, true})
        for (size_t axis = 0; axis < 3; ++axis) {
            Polygon p = flat;
            if (backwards) std::reverse(p.begin(), p.end());
            const std::vector<Vec3> points = in_space(p, axis, turn);
            std::vector<uint32_t> corners(p.size());
            std::iota(corners.begin(), corners.end(), 0u);
            std::vector<Triangle> triangles;
            ASSERT_TRUE(triangulate(points, corners, triangles))
                << testing::PrintToString(flat) << backwards << axis << turn;
            ASSERT_EQ(triangles.size(), p.size() - 2);
            std::array<double, 3> sum{};
            double sizes = 0;
            std::vector<std::array<uint32_t, 2>> edges;
            for (const Triangle& t : triangles) {
                const auto n = cross(points[t[0]], points[t[1]], points[t[2]]);
                for (size_t k = 0; k < 3; ++k) sum[k] += n[k] / 2;
                sizes += std::hypot(n[0], n[1], n[2]) / 2;
                for (size_t i = 0; i < 3; ++i) edges.push_back({t[i], t[(i + 1) % 3]});
            }
            const double whole = std::abs(area(flat)), length = std::hypot(sum[0], sum[1], sum[2]);
            EXPECT_NEAR(length, whole, 1e-5 * whole + 1e-6) << "the sum of normals is the polygon's";
            EXPECT_NEAR(sizes, length, 1e-5 * whole + 1e-6) << "no triangle is turned";
            for (uint32_t i = 0; i < p.size(); ++i) {
                const std::array<uint32_t, 2> edge = {i, static_cast<uint32_t>((i + 1) % p.size())};
                EXPECT_EQ(std::count(edges.begin(), edges.end(), edge), 1) << "the border's edges stay";
            }
        }
}

TEST(Triangulate, ConcavePolygons) {
    expect_tiled({{0, 0}, {4, 0}, {4, 3}, {2, 1}, {0, 3}});
    expect_tiled({{0, 0}, {1, 0}, {1, 1}, {0, 1}});
    expect_tiled({{0, 0}, {2, 0.1}, {4, 0}, {2.1, 5}}); // one reflex corner
    std::mt19937 engine(5);
    std::uniform_real_distribution<double> unit(0, 1);
    for (int round = 0; round < 40; ++round) { // combs, as they once lost their teeth
        const int teeth = 2 + round % 7;
        Polygon p = {{0, 0}, {2. * teeth - 1, 0}};
        for (int t = teeth - 1; t >= 0; --t) {
            const double h = 1 + 2 * unit(engine);
            p.push_back({2. * t + 1, h}), p.push_back({2. * t, h});
            if (t > 0) p.push_back({2. * t, 0.5}), p.push_back({2. * t - 1, 0.5});
        }
        expect_tiled(p);
    }
    for (int round = 0; round < 60; ++round) { // stars
        const int n = 4 + round;
        Polygon p;
        for (int i = 0; i < n; ++i) {
            const double angle = 2 * std::numbers::pi * i / n, r = 0.05 + unit(engine);
            p.push_back({r * std::cos(angle), r * std::sin(angle)});
        }
        expect_tiled(p);
    }
    Polygon spiral; // inwards and back
    for (int i = 0; i <= 60; ++i)
        spiral.push_back({(7 - i * 0.1) * std::cos(0.3 * i), (7 - i * 0.1) * std::sin(0.3 * i)});
    for (int i = 60; i >= 0; --i)
        spiral.push_back({(6.5 - i * 0.1) * std::cos(0.3 * i), (6.5 - i * 0.1) * std::sin(0.3 * i)});
    expect_tiled(spiral);
}

TEST(Triangulate, CornersOnALineAndRepeatedOnes) {
    expect_tiled({{0, 0}, {1, 0}, {2, 0}, {2, 1}, {2, 2}, {1, 2}, {0, 2}, {0, 1}});
    expect_tiled({{0, 0}, {1, 0}, {2, 0}, {3, 0}, {1.5, 2}}, false);
    expect_tiled({{0, 0}, {0, 0}, {2, 0}, {2, 2}, {2, 2}, {2, 2}, {0, 2}});
    expect_tiled({{0, 0}, {2, 0}, {3, 0}, {2, 0}, {2, 2}, {0, 2}}); // a spike
    std::vector<Triangle> triangles; // no area at all: as many triangles, none with an area
    const std::vector<Vec3> line = {{0, 0, 0}, {1, 1, 1}, {2, 2, 2}, {1, 1, 1}};
    const uint32_t corners[] = {0, 1, 2, 3};
    EXPECT_TRUE(triangulate(line, corners, triangles));
    EXPECT_EQ(triangles.size(), 2u);
}

TEST(Triangulate, PolygonsThatTouchThemselves) {
    // A square with one square hole, and with two, joined to the border by cuts that are run through twice.
    const Polygon ring = {{0, 0}, {6, 0}, {6, 6}, {0, 6}, {0, 0}, {2, 2}, {2, 4}, {4, 4}, {4, 2}, {2, 2}};
    EXPECT_EQ(area(ring), 32);
    expect_tiled(ring, false), expect_tiled(ring);
    const Polygon two = {{0, 0}, {9, 0}, {9, 5}, {4, 5}, {4, 4}, {4, 3}, {3, 3}, {3, 4}, {4, 4},
                         {4, 5}, {0, 5}, {0, 0}, {1, 1}, {1, 2}, {2, 2}, {2, 1}, {1, 1}};
    EXPECT_EQ(area(two), 43);
    expect_tiled(two, false), expect_tiled(two);
    expect_tiled({{0, 0}, {4, 0}, {4, 4}, {2, 0}, {0, 4}});                // a reflex corner on the opposite edge
    expect_tiled({{0, 0}, {2, 2}, {4, 0}, {4, 4}, {2, 2}, {0, 4}}, false); // two triangles that meet in a point
    // Bricks: rings around random cells of a lattice, where corners touch and lie on lines.
    std::mt19937 engine(6);
    for (int round = 0; round < 50; ++round) {
        Polygon p = {{0, 0}, {10, 0}};
        for (int x = 9; x >= 0; --x) {
            const double h = 1. + static_cast<double>(engine() % 3);
            p.push_back({x + 1., h}), p.push_back({static_cast<double>(x), h});
        }
        expect_tiled(p, false), expect_tiled(p);
    }
}

TEST(Triangulate, RefusesPolygonsThatCrossThemselves) {
    const std::vector<Vec3> points = {{0, 0, 0}, {2, 2, 0}, {2, 0, 0}, {0, 2, 0}, {5, 1, 0}, {0, 1, 0}};
    std::vector<Triangle> triangles;
    for (const std::vector<uint32_t>& corners : {std::vector<uint32_t>{0, 1, 2, 3}, {0, 2, 1, 3, 4}, {0, 4, 2, 1, 5}}) {
        EXPECT_FALSE(triangulate(points, corners, triangles));
        EXPECT_TRUE(triangles.empty());
    }
}

TEST(Triangulate, ManyCornersTakeNoTime) {
    for (const int n : {2000, 20000}) {
        Polygon circle, saw;
        for (int i = 0; i < n; ++i) {
            const double angle = 2 * std::numbers::pi * i / n;
            circle.push_back({1000 * std::cos(angle), 1000 * std::sin(angle)});
            saw.push_back({(i % 2 ? 1000 : 500) * std::cos(angle), (i % 2 ? 1000 : 500) * std::sin(angle)});
        }
        for (const Polygon& p : {circle, saw}) {
            const std::vector<Vec3> points = in_space(p, 2, false);
            std::vector<uint32_t> corners(p.size());
            std::iota(corners.begin(), corners.end(), 0u);
            std::vector<Triangle> triangles;
            EXPECT_TRUE(triangulate(points, corners, triangles));
            EXPECT_EQ(triangles.size(), p.size() - 2);
        }
    }
}

TEST(Triangulate, TellsHowFarFromFlat) {
    const std::vector<Vec3> points = {{0, 0, 0.1f}, {1, 0, -0.1f}, {1, 1, 0.1f}, {0, 1, -0.1f}};
    const uint32_t corners[] = {0, 1, 2, 3};
    EXPECT_NEAR(distance_from_flat(points, corners), 0.1, 1e-6);
}

} // namespace
} // namespace prolate
