// Winding numbers, clipping, columns and voxels against exact geometry.
#include "builder/clip.hpp"
#include "builder/columns.hpp"
#include "builder/random.hpp"
#include "builder/voxels.hpp"
#include "tests/shapes.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <numbers>

namespace prolate {
namespace {

double brute_winding(const Mesh& mesh, const Vec& p) {
    double angle = 0;
    for (const Triangle& t : mesh.triangles)
        angle += solid_angle(to_vec(mesh.vertices[t[0]]), to_vec(mesh.vertices[t[1]]), to_vec(mesh.vertices[t[2]]), p);
    return angle / (4 * std::numbers::pi);
}

TEST(Winding, IsOneInsideAndZeroOutside) {
    const Mesh ball = shapes::icosphere(3);
    const Winding winding(ball.view());
    Random random(1);
    int inside = 0;
    for (int i = 0; i < 5000; ++i) {
        const Vec p = 1.5 * Vec(random.symmetric(), random.symmetric(), random.symmetric());
        const double exact = brute_winding(ball, p);
        inside += exact > 0.5;
        EXPECT_NEAR(winding(p), exact, 0.06);
        EXPECT_NEAR(winding(p, 1e30), exact, 1e-12); // nothing counts as far: the exact sum
    }
    EXPECT_GT(inside, 500);
    EXPECT_LT(inside, 2500);
    EXPECT_NEAR(Winding(shapes::inverted(ball).view())(Vec(0.1, 0.2, 0.3)), -1, 0.06);
}

TEST(Winding, IsZeroInTheCavityOfAShell) {
    // The normals of the two sides cancel: a dipole alone is off by 0.3 in the middle.
    Mesh shell = shapes::icosphere(3);
    shapes::append(shell, shapes::inverted(shapes::moved(shapes::icosphere(3), {}, 0.8f)));
    const Winding winding(shell.view());
    Random random(6);
    for (int i = 0; i < 1000; ++i) {
        const Vec p = 0.4 * Vec(random.symmetric(), random.symmetric(), random.symmetric());
        EXPECT_NEAR(winding(p), 0, 0.1);
    }
}

TEST(Winding, OfAHalfOpenBallIsFractional) {
    Mesh half = shapes::icosphere(3);
    std::erase_if(half.triangles, [&](const Triangle& t) {
        return half.vertices[t[0]].z + half.vertices[t[1]].z + half.vertices[t[2]].z > 0;
    });
    const Winding winding(half.view());
    EXPECT_NEAR(winding(Vec(0, 0, 0)), 0.5, 0.05);
    EXPECT_GT(winding(Vec(0, 0, -0.9)), 0.6);
    EXPECT_LT(winding(Vec(0, 0, 0.9)), 0.4);
}

TEST(Clip, SplitsKeepTheAreaAndTheSides) {
    Random random(2);
    const auto area = [](const Polygon& p) {
        Vec sum = Vec::Zero();
        for (size_t i = 2; i < p.size(); ++i) sum += (p[i - 1] - p[0]).cross(p[i] - p[0]);
        return 0.5 * sum.norm();
    };
    int both = 0;
    for (int round = 0; round < 3000; ++round) {
        Polygon polygon;
        for (int i = 0; i < 3; ++i) polygon.emplace_back(random.symmetric(), random.symmetric(), random.symmetric());
        const int axis = static_cast<int>(random.bits() % 3);
        const double at = round % 3 ? random.symmetric() : polygon[0][axis]; // also through a corner
        Polygon below, above;
        split_polygon(polygon, axis, at, below, above);
        both += !below.empty() && !above.empty();
        EXPECT_NEAR(area(below) + area(above), area(polygon), 1e-12);
        for (const Vec& v : below) EXPECT_LE(v[axis], at);
        for (const Vec& v : above) EXPECT_GE(v[axis], at);
    }
    EXPECT_GT(both, 1000);
}

TEST(Clip, APolygonInThePlaneGoesToBothSides) {
    const Polygon flat{{0, 0, 1}, {1, 0, 1}, {0, 1, 1}};
    Polygon below, above;
    split_polygon(flat, 2, 1, below, above);
    EXPECT_EQ(below, flat);
    EXPECT_EQ(above, flat);
}

// Random points of the solid lie in the hull of their cell's points: tested with ellipsoids, which is what they are
// for.
TEST(Voxels, AnEllipsoidAroundThePointsCoversThePiece) {
    Mesh thin = shapes::box(1, 1, 0.01f); // thinner than a cell
    shapes::append(thin, shapes::moved(shapes::torus(0.3f, 0.05f, 30, 12), {0.5f, 0.5f, 0.4f}));
    const Winding winding(thin.view());
    const Voxels voxels(thin.view(), true, winding, 16);
    Random random(9);
    int tested = 0;
    for (int round = 0; round < 200'000; ++round) {
        const Vec p(random.uniform(), random.uniform(), 0.47 * random.uniform());
        if (std::abs(winding(p, 6)) < 0.5) continue;
        const Vec at = (p - voxels.origin()) / voxels.pitch();
        const uint32_t cell = voxels.cell_at(int(at.x()), int(at.y()), int(at.z()));
        ASSERT_NE(cell, Voxels::kNoCell) << p.transpose();
        if (tested++ % 8) continue;
        const Fit fit = enclosing_ellipsoid(voxels.points(cell), 1e-6);
        EXPECT_LE(fit.radial_squared(p), 1 + 1e-6);
        // A stretched one, so that not only the roundest ellipsoid is tried.
        const Vec axis = Vec(random.symmetric(), random.symmetric(), random.symmetric()).normalized();
        Fit needle = capped(fit.center, Mat::Identity() + 99 * axis * axis.transpose(), 1e-6);
        needle = needle.scaled(needle.reach(voxels.points(cell)));
        EXPECT_LE(needle.radial_squared(p), 1 + 1e-9);
    }
    EXPECT_GT(tested, 2000);
}

TEST(Voxels, KnowTheTrianglesInACell) {
    const Mesh mesh = shapes::torus(1, 0.3f, 30, 12);
    const Winding winding(mesh.view());
    const Voxels voxels(mesh.view(), true, winding, 24);
    // A point of a triangle lies in the box of its cell's points, and the cell knows the triangle.
    Random random(3);
    for (uint32_t t = 0; t < mesh.triangles.size(); ++t)
        for (int i = 0; i < 10; ++i) {
            const double u = random.uniform(), v = (1 - u) * random.uniform();
            const Vec a = to_vec(mesh.vertices[mesh.triangles[t][0]]);
            const Vec p = a + u * (to_vec(mesh.vertices[mesh.triangles[t][1]]) - a) +
                          v * (to_vec(mesh.vertices[mesh.triangles[t][2]]) - a);
            const uint32_t cell = voxels.cell_at(p);
            ASSERT_NE(cell, Voxels::kNoCell);
            EXPECT_TRUE(std::ranges::count(voxels.triangles(cell), t) == 1);
            const Box box = voxels.box(cell);
            EXPECT_TRUE((p - box.low).minCoeff() >= -1e-12 && (box.high - p).minCoeff() >= -1e-12);
        }
    // Without triangles a cell is solid throughout, and its points are its corners.
    int inner = 0;
    for (uint32_t cell = 0; cell < voxels.cell_count(); ++cell) {
        const auto& [i, j, k] = voxels.coordinates(cell);
        EXPECT_EQ(voxels.cell_at(i, j, k), cell);
        if (!voxels.triangles(cell).empty()) continue;
        ++inner;
        EXPECT_EQ(voxels.points(cell).size(), 8u);
        EXPECT_GT(winding(voxels.box(cell).center()), 0.9);
    }
    EXPECT_GT(inner, 100);
    EXPECT_EQ(voxels.cell_at(Vec(0, 0, 0)), Voxels::kNoCell); // the hole
    EXPECT_EQ(voxels.cell_at(Vec(1e30, 0, 0)), Voxels::kNoCell);
    EXPECT_EQ(voxels.cell_at(Vec(-1e30, NAN, 0)), Voxels::kNoCell);
    EXPECT_EQ(voxels.cell_at(-1, 0, 0), Voxels::kNoCell);
}

TEST(Voxels, OfARegionAreThoseThatMeetIt) {
    const Mesh mesh = shapes::torus(1, 0.3f, 30, 12);
    const Voxels voxels(mesh.view(), true, Winding(mesh.view()), 20);
    Random random(4);
    size_t met = 0;
    for (int round = 0; round < 200; ++round) {
        Box region;
        for (int i = 0; i < 2; ++i) {
            const double x = random.symmetric(), y = random.symmetric(), z = random.symmetric();
            region.add(1.6 * Vec(x, y, z));
        }
        std::vector<uint32_t> expected, seen;
        for (uint32_t cell = 0; cell < voxels.cell_count(); ++cell) {
            const auto& [i, j, k] = voxels.coordinates(cell);
            const Vec low = voxels.origin() + voxels.pitch() * Vec(i, j, k);
            const Vec high = low + Vec::Constant(voxels.pitch());
            if ((low.array() <= region.high.array()).all() && (high.array() >= region.low.array()).all())
                expected.push_back(cell);
        }
        voxels.for_each_in(region, [&](uint32_t cell) { seen.push_back(cell); });
        EXPECT_EQ(seen, expected);
        met += seen.size();
    }
    EXPECT_GT(met, 10'000u);
}

} // namespace
} // namespace prolate
