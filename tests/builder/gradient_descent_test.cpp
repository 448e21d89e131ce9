// The joint descent: onto solids whose best covers are known.
#include "builder/border.hpp"
#include "builder/columns.hpp"
#include "builder/gradient_descent.hpp"
#include "builder/random.hpp"
#include "tests/shapes.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

namespace prolate {
namespace {

Vec random_vec(Random& random) {
    const double x = random.symmetric(), y = random.symmetric(), z = random.symmetric();
    return {x, y, z};
}

Fit ball(const Vec& center, double radius) {
    return {center, radius * Mat::Identity()};
}

/// A closed mesh around the unit ball mapped by `fit`.
Mesh mesh_of(const Fit& fit, int subdivisions = 4) {
    Mesh mesh = shapes::icosphere(subdivisions);
    for (Vec3& v : mesh.vertices) {
        const Vec p = fit.center + fit.factor * to_vec(v);
        v = {float(p.x()), float(p.y()), float(p.z())};
    }
    return mesh;
}

std::vector<Vec> points_of(const Mesh& mesh) {
    std::vector<Vec> out;
    for (const Vec3& v : mesh.vertices) out.push_back(to_vec(v));
    return out;
}

std::vector<uint32_t> nearest_of(std::span<const Fit> fits, std::span<const Vec> points) {
    std::vector<uint32_t> out;
    for (const Vec& p : points) {
        const auto nearer = [&](const Fit& a, const Fit& b) { return a.radial_squared(p) < b.radial_squared(p); };
        out.push_back(static_cast<uint32_t>(std::min_element(fits.begin(), fits.end(), nearer) - fits.begin()));
    }
    return out;
}

Fit random_fit(Random& random) {
    Mat shape = random_rotation(random);
    for (int axis = 0; axis < 3; ++axis) shape.col(axis) *= 0.05 + random.uniform();
    return {random_vec(random), cholesky(shape * shape.transpose())};
}

TEST(BorderSamples, AreHiddenByWhatHoldsThem) {
    Random random(11);
    BorderSamples samples(120);
    int hidden_count = 0, apart_count = 0;
    for (int round = 0; round < 500; ++round) {
        const Fit fit = random_fit(random), other = random_fit(random);
        samples.turn(random_rotation(random));
        const Fit both[] = {fit, other};
        const uint32_t others[] = {1};
        const std::vector<uint32_t> hidden = samples.hidden(fit, both, others);
        const bool between = depth(fit, other) < 0;
        apart_count += between;
        for (size_t i = 0; i < samples.directions().size(); ++i) {
            const double radial = other.radial(fit.center + fit.factor * samples.directions()[i]).norm();
            if (std::abs(radial - 1) > 1e-4) {
                EXPECT_EQ(hidden[i] == 1, radial < 1) << radial;
            }
            if (between) {
                EXPECT_GE(radial, 1);
            }
            hidden_count += hidden[i] == 1;
        }
    }
    EXPECT_GT(hidden_count, 2000);
    EXPECT_GT(apart_count, 50);
}

DescentOptions options_for(int iterations, Primitive primitive = Primitive::ellipsoid) {
    return {.objective = {0.5, 0.5, 0.3},
            .primitive = primitive,
            .iterations = iterations,
            .directions = 256,
            .min_radius = 1e-5,
            .relocate = false,
            .first_kappa = 1,
            .seed = 7};
}

void descend_onto(const Mesh& mesh, std::vector<Fit>& set, const DescentOptions& options) {
    const DistanceField field(mesh.view(), true, Winding(mesh.view()), 60);
    const std::vector<Vec> points = points_of(mesh);
    descend(set, field, points, nearest_of(set, points), options);
}

CoverVolume measure(const Mesh& mesh, std::span<const Fit> fits) {
    std::vector<Ellipsoid> ellipsoids;
    for (const Fit& fit : fits) ellipsoids.push_back(fit.ellipsoid());
    return measure_cover(measuring_columns(mesh.view(), true, nullptr, 200), ellipsoids);
}

double uncovered(const CoverVolume& volume) {
    return volume.solid.value - (volume.whole.value - volume.outside.value);
}

TEST(EvenDirections, AreEvenAndOfUnitLength) {
    for (const int count : {1, 2, 96, 384, 2000}) {
        const std::vector<Vec> directions = even_directions(count);
        ASSERT_EQ(directions.size(), static_cast<size_t>(count));
        for (const Vec& d : directions) EXPECT_NEAR(d.norm(), 1, 1e-12);
        if (count < 96) continue;
        Vec mean = Vec::Zero();
        Mat second = Mat::Zero();
        for (const Vec& d : directions) mean += d / count, second += d * d.transpose() / count;
        EXPECT_LT(mean.norm(), 0.01);
        EXPECT_LT((second - Mat::Identity() / 3).norm(), 0.01);
        // No direction is lonely or crowded: a cap that is theirs alone has about 4 pi / count.
        const double width = std::sqrt(4 * std::numbers::pi / count);
        for (const Vec& d : directions) {
            double nearest = 2;
            for (const Vec& e : directions)
                if (&e != &d) nearest = std::min(nearest, (d - e).norm());
            EXPECT_GT(nearest, 0.6 * width);
            EXPECT_LT(nearest, 1.2 * width);
        }
    }
}

TEST(RandomRotation, IsARotationAndSpreadsEvenly) {
    Random random(1);
    Vec mean = Vec::Zero();
    for (int round = 0; round < 2000; ++round) {
        const Mat r = random_rotation(random);
        EXPECT_LT((r * r.transpose() - Mat::Identity()).norm(), 1e-12);
        EXPECT_NEAR(r.determinant(), 1, 1e-12);
        mean += r.col(0) / 2000;
    }
    EXPECT_LT(mean.norm(), 0.05);
}

TEST(AsPrimitive, KeepsTheVolume) {
    const Fit fit(Vec(1, 2, 3), (Mat() << 2, 0, 0, 0.3, 1, 0, -0.2, 0.4, 0.5).finished());
    const Fit sphere = as_primitive(fit, Primitive::sphere);
    EXPECT_NEAR(sphere.volume(), fit.volume(), 1e-12);
    EXPECT_EQ(sphere.factor, sphere.factor(0, 0) * Mat::Identity());
    EXPECT_EQ(sphere.center, fit.center);
    EXPECT_EQ(as_primitive(fit, Primitive::ellipsoid).factor, fit.factor);
}

TEST(Moved, IsTheMappedEllipsoid) {
    Random random(2);
    for (int round = 0; round < 500; ++round) {
        const Fit fit = capped(random_vec(random), Vec(1 + random.uniform(), 1, 0.5).asDiagonal(), 1e-6);
        const Vec s = 0.3 * random_vec(random);
        Mat g;
        for (int i = 0; i < 9; ++i) g(i / 3, i % 3) = 0.1 * random.symmetric();
        g = (g + g.transpose()).eval();
        const Fit out = moved(fit, s, g, 1e-6);
        EXPECT_EQ(out.factor, Mat(out.factor.triangularView<Eigen::Lower>()));
        for (int i = 0; i < 5; ++i) { // c + L u goes to c + L (s + (1 + G) u): the border stays the border
            const Vec u = random_vec(random).normalized();
            EXPECT_NEAR(out.radial_squared(fit.center + fit.factor * (s + u + g * u)), 1, 1e-9);
        }
    }
    // Squeezed flat: within the caps all the same.
    const Fit flat = moved(ball(Vec::Zero(), 1), Vec::Zero(), Vec(0, 0, -0.999).asDiagonal(), 1e-6);
    EXPECT_TRUE(within_caps(flat, 1e-6));
    EXPECT_TRUE(within_caps(moved(ball(Vec::Zero(), 1), Vec::Zero(), -0.999 * Mat::Identity(), 0.1), 0.1));
}

TEST(NeighboursOf, AreThoseOfBruteForce) {
    Random random(3);
    for (const size_t count : {0u, 1u, 2u, 60u, 300u}) {
        std::vector<Fit> fits;
        for (size_t i = 0; i < count; ++i) {
            const Vec axis = random_vec(random).normalized();
            const Vec center = random_vec(random);
            fits.push_back(capped(center, 0.01 * (Mat::Identity() * 0.1 + axis * axis.transpose()), 1e-6));
        }
        for (const double margin : {1.0, 1.2, 3.0}) {
            const auto found = neighbours_of(fits, margin);
            ASSERT_EQ(found.size(), count);
            for (uint32_t i = 0; i < count; ++i) {
                std::vector<uint32_t> expected;
                for (uint32_t j = 0; j < count; ++j) {
                    const Vec gap = (fits[i].center - fits[j].center).cwiseAbs() - margin * fits[i].half_extents() -
                                    margin * fits[j].half_extents();
                    if (i != j && gap.maxCoeff() <= 0) expected.push_back(j);
                }
                EXPECT_EQ(found[i], expected);
            }
        }
    }
}

TEST(Descent, FindsTheEllipsoidThatTheSolidIs) {
    Random random(4);
    for (int round = 0; round < 5; ++round) {
        const Mat turn = random_rotation(random);
        const Vec radii(1, 0.5 + 0.3 * random.uniform(), 0.3);
        const Fit solid = capped(random_vec(random), turn * radii.cwiseAbs2().asDiagonal() * turn.transpose(), 1e-6);
        const Mesh mesh = mesh_of(solid);
        std::vector<Fit> set{ball(solid.center + 0.3 * random_vec(random), 0.5)};
        descend_onto(mesh, set, options_for(200));
        const CoverVolume volume = measure(mesh, set);
        EXPECT_LT(volume.outside.value, 0.03 * volume.solid.value);
        EXPECT_LT(uncovered(volume), 5e-3 * volume.solid.value);
        EXPECT_LT((set[0].center - solid.center).norm(), 0.01);
        const Mat difference = solid.inverse * set[0].factor;
        EXPECT_LT((difference * difference.transpose() - Mat::Identity()).norm(), 0.05);
    }
}

TEST(Descent, SharesTwoBallsBetweenTwoEllipsoids) {
    Mesh mesh = mesh_of(ball({0, 0, 0}, 0.5), 3);
    shapes::append(mesh, mesh_of(ball({1.5, 0.5, 0}, 0.3), 3));
    for (const Primitive primitive : {Primitive::ellipsoid, Primitive::sphere}) {
        // From too large and in between, and from inside.
        for (const auto& start : {std::pair(ball({0.3, 0.2, 0}, 0.8), ball({1, 0.3, 0.1}, 0.6)),
                                  std::pair(ball({0.1, 0.1, 0}, 0.1), ball({1.4, 0.5, 0}, 0.1))}) {
            std::vector<Fit> set{start.first, start.second};
            descend_onto(mesh, set, options_for(200, primitive));
            const CoverVolume volume = measure(mesh, set);
            EXPECT_LT(volume.outside.value, 0.04 * volume.solid.value);
            EXPECT_LT(uncovered(volume), 5e-3 * volume.solid.value);
            EXPECT_LT((set[0].center - Vec(0, 0, 0)).norm(), 0.02);
            EXPECT_LT((set[1].center - Vec(1.5, 0.5, 0)).norm(), 0.02);
        }
    }
}

// Ellipsoids around a ring.
std::vector<Fit> around_a_torus(int count) {
    std::vector<Fit> set;
    for (int i = 0; i < count; ++i) {
        const double angle = 2 * std::numbers::pi * i / count;
        set.push_back(ball({std::cos(angle), std::sin(angle), 0}, 0.35 + 0.01 * (i % 3)));
    }
    return set;
}

TEST(Descent, NearlyCoversAndGetsTighter) {
    const Mesh mesh = shapes::torus(1, 0.3f, 48, 24);
    std::vector<Fit> set = around_a_torus(8);
    descend_onto(mesh, set, options_for(150));
    const CoverVolume volume = measure(mesh, set);
    EXPECT_LT(volume.outside.value, 0.2 * volume.solid.value);
    EXPECT_LT(uncovered(volume), 0.01 * volume.solid.value);
    for (const Fit& fit : set) EXPECT_TRUE(within_caps(fit, 1e-5));
}

TEST(Descent, LetsIdleEllipsoidsHelpElsewhere) {
    // Five of six are on one ball of three.
    Mesh mesh = mesh_of(ball({0, 0, 0}, 0.5), 3);
    shapes::append(mesh, mesh_of(ball({2, 0, 0}, 0.5), 3));
    shapes::append(mesh, mesh_of(ball({4, 0, 0}, 0.5), 3));
    std::vector<Fit> start;
    for (int i = 0; i < 5; ++i) start.push_back(ball({0.05 * i, 0.05 * i, 0}, 0.45));
    start.push_back(ball({3, 0, 0}, 1.6));
    double outside[2];
    for (const bool relocate : {false, true}) {
        std::vector<Fit> set = start;
        DescentOptions options = options_for(200);
        options.relocate = relocate;
        descend_onto(mesh, set, options);
        const CoverVolume volume = measure(mesh, set);
        outside[relocate] = volume.outside.value / volume.solid.value;
        EXPECT_LT(uncovered(volume), 0.02 * volume.solid.value);
    }
    EXPECT_LT(outside[1], 0.1);
    EXPECT_GT(outside[0], 0.2); // without, it stays between the two
}

TEST(Descent, LetsIdleBallsHelpElsewhere) {
    const Mesh mesh = shapes::torus(1, 0.3f, 48, 24);
    std::vector<Fit> start = around_a_torus(12);
    for (int i = 0; i < 12; ++i) start.push_back(ball(start[static_cast<size_t>(i)].center, 0.05));
    double outside[2];
    for (const bool relocate : {false, true}) {
        std::vector<Fit> set = start;
        DescentOptions options = options_for(300, Primitive::sphere);
        options.relocate = relocate;
        descend_onto(mesh, set, options);
        const CoverVolume volume = measure(mesh, set);
        outside[relocate] = volume.outside.value / volume.solid.value;
        EXPECT_LT(uncovered(volume), 0.02 * volume.solid.value);
    }
    EXPECT_LT(outside[1], 0.7 * outside[0]);
}

TEST(Descent, SpheresStaySpheres) {
    std::vector<Fit> set = around_a_torus(12);
    DescentOptions options = options_for(60, Primitive::sphere);
    options.relocate = true;
    descend_onto(shapes::torus(1, 0.3f, 40, 20), set, options);
    for (const Fit& fit : set) EXPECT_EQ(fit.factor, fit.factor(0, 0) * Mat::Identity());
}

TEST(Descent, IsTheSameForAnyNumberOfThreads) {
    const Mesh mesh = shapes::torus(1, 0.3f, 40, 20);
    std::vector<Fit> sets[2] = {around_a_torus(30), around_a_torus(30)};
    for (const size_t run : {0u, 1u})
        tbb::task_arena(run == 0 ? 1 : 4).execute([&] {
            DescentOptions options = options_for(40);
            options.relocate = true;
            descend_onto(mesh, sets[run], options);
        });
    for (size_t i = 0; i < sets[0].size(); ++i) {
        EXPECT_EQ(sets[0][i].center, sets[1][i].center);
        EXPECT_EQ(sets[0][i].factor, sets[1][i].factor);
    }
}

} // namespace
} // namespace prolate
