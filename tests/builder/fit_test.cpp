// Enclosing ellipsoids: against known optima, the axis ratio cap, and cover after quantisation.
#include "builder/cover.hpp"
#include "builder/fit.hpp"
#include "builder/random.hpp"
#include "tests/shapes.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include <cmath>
#include <numbers>
#include <numeric>

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

// Two triangles of the horse: all directions that the fit starts from find the same two corners.
TEST(Fit, StartsFromAFlatTetrahedron) {
    const std::vector<Vec> points{{0.034200001507997513, 0.02105649933218956, 0.0018389998003840446},
                                  {0.034504000097513199, 0.022013500332832336, 0.0025400000158697367},
                                  {0.034517001360654831, 0.022009499371051788, 0.0018349997699260712},
                                  {0.034772001206874847, 0.022973500192165375, 0.0025349999777972698}};
    const Fit fit = enclosing_ellipsoid(points, 1e-6);
    EXPECT_LE(fit.reach(points), 1 + 1e-9);
    Mat edges;
    for (int i = 0; i < 3; ++i) edges.col(i) = points[size_t(i)] - points[3];
    const double volume = std::abs(edges.determinant()) / 6;
    EXPECT_LE(fit.volume(), 1.01 * volume * std::numbers::pi / 2 * std::pow(3, 1.5)); // as of any tetrahedron
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

TEST(Capped, KeepsToTheCapsAndWithinCapsSaysSo) {
    Random random(13);
    int changed = 0;
    for (int round = 0; round < 2000; ++round) {
        const Vec axis = random_vec(random).normalized();
        const double unit = std::pow(10.0, 12 * random.uniform() - 6), flat = std::pow(10.0, -14 * random.uniform());
        const Mat q = unit * unit * (Mat::Identity() - (1 - flat) * axis * axis.transpose());
        const Fit raw(Vec::Zero(), cholesky(q)), fit = capped(Vec::Zero(), q, 1e-6 * unit, kMaxAxisRatio);
        EXPECT_TRUE(within_caps(fit, 1e-6 * unit, kMaxAxisRatio));
        const bool legal = flat * kMaxAxisRatio * kMaxAxisRatio >= 1;
        EXPECT_EQ(within_caps(raw, 1e-6 * unit, kMaxAxisRatio), legal);
        if (legal) {
            EXPECT_EQ(fit.factor, raw.factor);
        }
        changed += !legal;
    }
    EXPECT_GT(changed, 500);
    EXPECT_LT(changed, 1500);
    EXPECT_FALSE(within_caps(Fit(), 1.001));
    EXPECT_TRUE(within_caps(capped(Vec::Zero(), Mat::Identity(), 3), 3));
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
    const Pieces pieces(mesh.view(), true, winding, 24);
    const double low[3] = {-1.5, -1.5, -0.5}, high[3] = {1.5, 1.5, 0.5};
    const format::Lattice lattice = format::lattice_for(low, high);
    Random random(5);
    for (int round = 0; round < 200; ++round) {
        std::vector<uint32_t> members;
        const auto first = static_cast<uint32_t>(random.uniform() * (pieces.size() - 40));
        for (uint32_t c = 0; c < 1 + random.bits() % 40; ++c) members.push_back(first + c);
        const Fit fit = fit_pieces(pieces, members, 1e-5);
        // Also from a fit that is far too small: cover must not depend on the fit.
        for (const double scale : {1.0, 0.2}) {
            const auto node = covering_node(fit.scaled(scale), pieces, members, lattice);
            ASSERT_TRUE(node);
            const Fit decoded(format::decode(*node, lattice));
            double reach = 0;
            for (const uint32_t piece : members) reach = std::max(reach, decoded.reach(pieces.points(piece)));
            EXPECT_LE(reach, 1 - kSlack);
            EXPECT_GE(reach, 1 - 2e-3);
            if (scale == 1.0) {
                EXPECT_LE(decoded.volume(), fit.volume() * 1.02);
            }
        }
    }
}

// A rotation about a random axis: by a random angle, or by a small one, so that the axes nearly keep to the lattice's.
Mat random_attitude(Random& random, int kind) {
    const double angle = kind == 0 ? 0 : kind == 1 ? std::pow(10, -6 * random.uniform()) : 4 * random.uniform();
    return Eigen::AngleAxisd(angle, random_vec(random).normalized()).toRotationMatrix();
}

// A sheet, a blade or a needle, as a node that covers its corners.
double outside_ratio_of_box(const Vec& half, const Mat& attitude, const format::Lattice& lattice, const Vec& center) {
    std::vector<Vec> corners;
    for (unsigned i = 0; i < 8; ++i)
        corners.push_back(center + attitude * Vec(i & 1 ? half.x() : -half.x(), i & 2 ? half.y() : -half.y(),
                                                  i & 4 ? half.z() : -half.z()));
    const auto reach = [&](const Fit& fit) { return fit.reach(corners); };
    const auto node = covering_node(enclosing_ellipsoid(corners, 1e-6), lattice, reach);
    if (!node) return HUGE_VAL;
    const Fit decoded(format::decode(*node, lattice));
    EXPECT_LE(decoded.reach(corners), 1);
    return decoded.volume() / (8 * half.prod()) - 1;
}

// The minimum ellipsoid of any box has pi sqrt(3) / 2 times its volume.
constexpr double kBoxInEllipsoid = std::numbers::pi * std::numbers::sqrt3 / 2 - 1; // 1.72

TEST(Cover, ThinBoxesHaveThinNodesInAnyAttitude) {
    Random random(17);
    for (int round = 0; round < 1500; ++round) {
        const double thin = std::pow(10, -4 * (round % 5 == 0 ? 1 : random.uniform()));
        const double other = round % 3 == 0 ? thin : round % 3 == 1 ? 1 : std::sqrt(thin);
        const Vec half(1, other, thin);
        const Mat attitude = random_attitude(random, round % 4) * random_attitude(random, round % 4);
        const Vec size = attitude.cwiseAbs() * half, low = Vec(0, 0, 0), high = Vec(0, 0, 0);
        const auto lattice = format::lattice_for(low.data(), high.data(), size.maxCoeff()); // as for a single node
        EXPECT_LE(outside_ratio_of_box(half, attitude, lattice, Vec::Zero()), 1.1 * kBoxInEllipsoid)
            << "1 x " << other << " x " << thin << "\n"
            << attitude;
    }
}

TEST(SurfaceError, IsTheLargestRadialDistance) {
    const Mesh cube = shapes::moved(shapes::box(2, 2, 2), {-1, -1, -1});
    const Pieces pieces(cube.view(), true, Winding(cube.view()), 16);
    std::vector<uint32_t> all(pieces.size());
    std::iota(all.begin(), all.end(), 0u);
    const auto of_ball = [&](double radius) {
        return surface_error(Fit(Vec::Zero(), radius * Mat::Identity()), pieces, all);
    };
    const double corner = std::sqrt(3.0);
    EXPECT_NEAR(of_ball(0.5), corner - 0.5, 1e-12); // inside: the corners are farthest away
    EXPECT_NEAR(of_ball(3), 3 - 1, 0.01);           // around: the middles of the sides, by the corner next to them
    EXPECT_NEAR(of_ball(corner), corner - 1, 0.01);
    // Half as large along x: the same picture, squeezed. A corner is 1 / |(2, 1, 1)| of its way out on the border.
    const Fit flat(Vec::Zero(), Vec(0.5, 1, 1).asDiagonal().toDenseMatrix());
    EXPECT_NEAR(surface_error(flat, pieces, all), corner * (1 - 1 / std::sqrt(6.0)), 1e-12);
}

} // namespace
} // namespace prolate
