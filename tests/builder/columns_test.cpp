// The solid as intervals along columns, and what is measured on them, against shapes of known volume.
#include "builder/columns.hpp"
#include "tests/shapes.hpp"

#include <gtest/gtest.h>

#include <numbers>

namespace prolate {
namespace {

TEST(Columns, MeasureVolumesOfClosedMeshes) {
    for (const Mesh& mesh : {shapes::icosphere(3), shapes::torus(1, 0.3f, 40, 20), shapes::tetrahedron(),
                             shapes::inverted(shapes::icosphere(3))}) {
        const Winding winding(mesh.view());
        const Columns columns(mesh.view(), true, &winding, {-1.5023, -1.5017, 0.005, 0.005, 602, 602});
        const double exact = std::abs(shapes::enclosed_volume(mesh));
        EXPECT_NEAR(columns.volume().value, exact, 4e-3 * exact);
    }
}

// Symmetric ones and ones with walls along the axes, where lattices like to agree on a wrong answer.
TEST(Columns, EstimateTheirError) {
    for (const Mesh& mesh :
         {shapes::icosphere(3), shapes::torus(1, 0.3f, 40, 20), shapes::tetrahedron(), shapes::box(1, 1, 1),
          shapes::box(1, 0.02f, 1), shapes::box(0.01f, 2, 3), shapes::moved(shapes::box(3, 2, 1), {7, 8, 9})})
        for (const int across : {128, 200, 512}) {
            const Quadrature volume = measuring_columns(mesh.view(), true, nullptr, across).volume();
            const double exact = std::abs(shapes::enclosed_volume(mesh));
            EXPECT_LE(std::abs(volume.value - exact), volume.error) << across;
            EXPECT_LE(volume.error, 0.03 * exact) << across; // not so large that it says nothing
        }
}

TEST(Columns, AreRightThroughEdgesAndVertices) {
    // A lattice exactly on the corners and edges of a box: each column must still see it once or not at all.
    const Mesh box = shapes::box(1, 1, 1);
    const Columns columns(box.view(), true, nullptr, {0, 0, 0.25, 0.25, 5, 5});
    for (int i = 0; i < 5; ++i)
        for (int j = 0; j < 5; ++j)
            for (const Interval& solid : columns.column(i, j)) {
                EXPECT_EQ(solid.low, 0);
                EXPECT_EQ(solid.high, 1);
            }
    EXPECT_EQ(columns.volume().value, 1.0); // 16 of 25: the symbolic step takes one border of two
}

// Two overlapping balls of radius 1, their centers 1 apart, around a cube of side 1/2 inside both; and around one so
// small that its own lattice would have 10^9 columns in them.
TEST(Columns, MeasureAUnionAgainstTheSolid) {
    for (const float side : {0.5f, 0.02f}) {
        const Mesh cube = shapes::moved(shapes::box(side, side, side), {0.25f, -0.25f, -0.25f});
        const std::vector<Ellipsoid> balls{{}, {.center = {1, 0, 0}}};
        const CoverVolume volume = measure_cover(measuring_columns(cube.view(), true, nullptr, 400), balls);
        const double ball = 4.0 / 3.0 * std::numbers::pi, lens = std::numbers::pi / 12 * (4 + 1) * (2 - 1) * (2 - 1);
        const double solid = std::pow(double{side}, 3);
        const auto expect = [](const Quadrature& measured, double exact) {
            EXPECT_LE(std::abs(measured.value - exact), measured.error);
            EXPECT_LE(measured.error, 1e-3);
        };
        expect(volume.whole, 2 * ball - lens);
        expect(volume.solid, solid);
        expect(volume.outside, 2 * ball - lens - solid);
        expect(volume.sum_outside, 2 * (ball - solid));
    }
}

} // namespace
} // namespace prolate
