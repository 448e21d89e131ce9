// Enclosing ellipsoids: against known optima, the axis ratio cap, and cover after quantisation.
#include "builder/cover.hpp"
#include "builder/fit.hpp"
#include "builder/random.hpp"
#include "builder/split.hpp"
#include "tests/shapes.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>

#include <cmath>
#include <numbers>

namespace prolate {
namespace {

constexpr double kUnitBall = 4.0 / 3.0 * std::numbers::pi;

Vec random_vec(Random& random) {
    return {random.symmetric(), random.symmetric(), random.symmetric()};
}

TEST(Fit, KnowsMinimumVolumeEllipsoidsOfRegularBodies) {
    // The Loewner ellipsoids of the cube and the regular tetrahedron are their circumscribed balls (John 1948), and
    // minimum volume is affinely invariant.
    std::vector<Vec> cube, tetra{{1, 1, 1}, {1, -1, -1}, {-1, 1, -1}, {-1, -1, 1}};
    for (int i = 0; i < 8; ++i) cube.emplace_back(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1);
    const double ball = kUnitBall * std::pow(std::sqrt(3.0), 3);
    Random random(7);
    for (int round = 0; round < 20; ++round) {
        Mat a = Mat::Identity() * 1.5;
        for (int i = 0; i < 9; ++i) a(i / 3, i % 3) += round ? 0.5 * random.symmetric() : 0; // axis ratio below the cap
        const Vec shift = 100 * random_vec(random);
        for (const auto& body : {cube, tetra}) {
            std::vector<Vec> points;
            for (const Vec& p : body) points.push_back(a * p + shift);
            const Fit fit = enclosing_ellipsoid(points, 1e-9, 1e-4);
            const double expected = ball * std::abs(a.determinant());
            EXPECT_GE(fit.volume(), expected * (1 - 1e-9));
            EXPECT_LE(fit.volume(), expected * 1.003);
            EXPECT_LE(fit.reach(points), 1 + 1e-9);
        }
    }
}

TEST(Fit, EnclosesWhateverItIsGiven) {
    Random random(11);
    for (int round = 0; round < 2000; ++round) {
        // Clouds from a single point over segments and sheets to solids, in any unit and place.
        const Vec stretch(std::pow(10, -4 * random.uniform()), random.uniform() < 0.3 ? 0 : random.uniform(),
                          random.uniform() < 0.3 ? 0 : random.uniform());
        const double unit = std::pow(10.0, 12 * random.uniform() - 6);
        const Vec place = unit * 1e3 * random_vec(random);
        std::vector<Vec> points;
        const auto count = static_cast<int>(1 + random.uniform() * 60);
        for (int i = 0; i < count; ++i) points.push_back(place + unit * random_vec(random).cwiseProduct(stretch));
        const Fit fit = enclosing_ellipsoid(points, 1e-5 * unit);
        EXPECT_LE(fit.reach(points), 1 + 1e-6) << "round " << round;
        const PrincipalAxes axes = principal_axes({.center = {},
                                                   .l11 = float(fit.factor(0, 0)),
                                                   .l21 = float(fit.factor(1, 0)),
                                                   .l22 = float(fit.factor(1, 1)),
                                                   .l31 = float(fit.factor(2, 0)),
                                                   .l32 = float(fit.factor(2, 1)),
                                                   .l33 = float(fit.factor(2, 2))});
        EXPECT_LE(axes.radii[0], axes.radii[2] * kMaxAxisRatio * 1.001) << "round " << round;
        EXPECT_GE(axes.radii[2], 1e-5 * unit * 0.999);
    }
}

TEST(Sketch, MergesLikeTheUnion) {
    Random random(3);
    std::vector<Vec> a, b, both;
    for (int i = 0; i < 50; ++i) a.push_back(random_vec(random)), b.push_back(random_vec(random) + Vec(0.5, 0, 0));
    both = a;
    both.insert(both.end(), b.begin(), b.end());
    Sketch merged(a);
    merged.add(Sketch(b));
    const Sketch whole(both);
    ASSERT_EQ(merged.points().size(), sketch_directions().size());
    for (size_t d = 0; d < sketch_directions().size(); ++d) EXPECT_EQ(merged.points()[d], whole.points()[d]);
    for (const Vec& d : sketch_directions()) EXPECT_NEAR(d.norm(), 1, 1e-12);
}

TEST(Cover, DecodedNodesCoverWithLittleWaste) {
    const Mesh mesh = shapes::torus(1, 0.3f, 48, 24);
    const Winding winding(mesh.view());
    const Voxels voxels(mesh.view(), true, winding, 24);
    const double low[3] = {-1.5, -1.5, -0.5}, high[3] = {1.5, 1.5, 0.5};
    const format::Lattice lattice = format::lattice_for(low, high);
    Random random(5);
    for (int round = 0; round < 200; ++round) {
        std::vector<uint32_t> cells;
        const auto first = static_cast<uint32_t>(random.uniform() * (voxels.cell_count() - 40));
        for (uint32_t c = 0; c < 1 + random.bits() % 40; ++c) cells.push_back(first + c);
        const Fit fit = fit_cells(voxels, cells, 1e-5);
        // Also from a fit that is far too small: cover must not depend on the fit.
        for (const double scale : {1.0, 0.2}) {
            const auto node = covering_node(fit.scaled(scale), voxels, cells, lattice);
            ASSERT_TRUE(node);
            const Fit decoded(format::decode(*node, lattice));
            double reach = 0;
            for (const uint32_t cell : cells) reach = std::max(reach, decoded.reach(voxels.points(cell)));
            EXPECT_LE(reach, 1 - kSlack);
            EXPECT_GE(reach, 1 - 2e-3);
            if (scale == 1.0) {
                EXPECT_LE(decoded.volume(), fit.volume() * 1.02);
            }
        }
    }
}

} // namespace
} // namespace prolate
