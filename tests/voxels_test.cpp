// Winding numbers, clipping, columns and voxels against exact geometry.
#include "builder/clip.hpp"
#include "builder/columns.hpp"
#include "builder/outside_volume.hpp"
#include "builder/random.hpp"
#include "builder/voxels.hpp"
#include "tests/shapes.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>

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

TEST(Columns, MeasureVolumesOfClosedMeshes) {
    for (const Mesh& mesh : {shapes::icosphere(3), shapes::torus(1, 0.3f, 40, 20), shapes::tetrahedron(),
                             shapes::inverted(shapes::icosphere(3))}) {
        const Winding winding(mesh.view());
        const Columns columns(mesh.view(), true, winding, {-1.5023, -1.5017, 0.005, 0.005, 602, 602});
        const double exact = std::abs(shapes::enclosed_volume(mesh));
        EXPECT_NEAR(columns.volume(), exact, 4e-3 * exact);
    }
}

TEST(Columns, AreRightThroughEdgesAndVertices) {
    // A lattice exactly on the corners and edges of a box: each column must still see it once or not at all.
    const Mesh box = shapes::box(1, 1, 1);
    const Columns columns(box.view(), true, Winding(box.view()), {0, 0, 0.25, 0.25, 5, 5});
    for (int i = 0; i < 5; ++i)
        for (int j = 0; j < 5; ++j)
            for (const Interval& solid : columns.column(i, j)) {
                EXPECT_EQ(solid.low, 0);
                EXPECT_EQ(solid.high, 1);
            }
    EXPECT_EQ(columns.volume(), 1.0); // 16 of 25: the symbolic step takes one border of two
}

TEST(Columns, MeasureAUnionAgainstTheSolid) {
    // Two overlapping balls of radius 1, their centers 1 apart, around a cube of side 1/2 inside both.
    const Mesh cube = shapes::moved(shapes::box(0.5f, 0.5f, 0.5f), {0.25f, -0.25f, -0.25f});
    const std::vector<Ellipsoid> balls{{}, {.center = {1, 0, 0}}};
    const CoverVolume volume = measure_cover(cube.view(), true, Winding(cube.view()), balls, 800);
    const double ball = 4.0 / 3.0 * std::numbers::pi, lens = std::numbers::pi / 12 * (4 + 1) * (2 - 1) * (2 - 1);
    EXPECT_NEAR(volume.whole, 2 * ball - lens, 2e-3);
    EXPECT_NEAR(volume.solid, 0.125, 1e-3);
    EXPECT_NEAR(volume.outside, 2 * ball - lens - 0.125, 3e-3);
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

TEST(Voxels, FractionsAndSamplesAddUp) {
    const Mesh mesh = shapes::torus(1, 0.3f, 64, 32);
    Voxels voxels(mesh.view(), true, Winding(mesh.view()), 40);
    voxels.sample_surface(mesh.view(), 5000, 1);
    const double exact = shapes::enclosed_volume(mesh);
    EXPECT_NEAR(voxels.solid_volume(), exact, 2e-3 * exact);
    double sum = 0;
    const auto& n = voxels.size();
    for (size_t v = 0; v < voxels.index(n[0] - 1, n[1] - 1, n[2] - 1) + 1; ++v) sum += voxels.solid_fraction(v);
    EXPECT_NEAR(sum * std::pow(voxels.pitch(), 3), exact, 2e-3 * exact);
    size_t samples = 0;
    for (uint32_t c = 0; c < voxels.cell_count(); ++c) {
        samples += voxels.samples(c).size();
        for (const Vec& p : voxels.samples(c)) EXPECT_NEAR(std::hypot(std::hypot(p.x(), p.y()) - 1, p.z()), 0.3, 0.01);
    }
    EXPECT_NEAR(double(samples), 5000, 5);
}

TEST(OutsideVolume, OfEllipsoidsAroundABall) {
    const Mesh ball = shapes::icosphere(4);
    const Voxels voxels(ball.view(), true, Winding(ball.view()), 64);
    const double inner = shapes::enclosed_volume(ball);
    for (const double stretch : {1.01, 1.5, 3.0}) {
        const Fit fit(Vec::Zero(), Vec(stretch, 1.01, 1.2).asDiagonal().toDenseMatrix());
        const double exact = fit.volume() - inner;
        EXPECT_NEAR(outside_volume(fit, voxels), exact, 0.01 * fit.volume()) << stretch;
    }
    // Wholly inside the solid: nothing outside. Small and beyond the grid: all of it.
    EXPECT_NEAR(outside_volume(Fit(Vec(0.1, 0, 0), 0.4 * Mat::Identity()), voxels), 0, 1e-4);
    const Fit far(Vec(3, 3, 3), 0.02 * Mat::Identity());
    EXPECT_NEAR(outside_volume(far, voxels), far.volume(), 0.02 * far.volume());
}

TEST(SurfaceError, IsTheRadialDistance) {
    const Fit fit(Vec(1, 2, 3), Vec(2, 1, 0.5).asDiagonal().toDenseMatrix());
    EXPECT_NEAR(radial_distance(fit, Vec(1 + 1, 2, 3)), 1, 1e-12); // half way out along the long axis
    EXPECT_NEAR(radial_distance(fit, Vec(1, 2, 3 + 0.4)), 0.1, 1e-12);
    EXPECT_NEAR(radial_distance(fit, Vec(1, 4, 3)), 1, 1e-12); // outside
    EXPECT_GE(radial_distance(fit, Vec(1, 2, 3)), 2);          // at the center: the longest radius at least
}

} // namespace
} // namespace prolate
