// Trees of simple solids: they hold what they should, and queries answer for them as brute force does.
#include "tests/reference.hpp"
#include "tests/scenes.hpp"
#include "tests/shapes.hpp"

#include <prolate/collide.hpp>
#include <prolate/contacts.hpp>
#include <prolate/distance.hpp>
#include <prolate/half_space.hpp>
#include <prolate/points.hpp>
#include <prolate/primitives.hpp>
#include <prolate/shapes.hpp>
#include <prolate/sweep.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>
#include <utility>
#include <vector>

namespace prolate {
namespace {

using scenes::Point;
using scenes::Random;

std::vector<reference::Corners> placed(const TreeView& tree, const Pose& pose) {
    std::vector<reference::Corners> out;
    for (uint32_t t = 0; t < tree.triangle_count(); ++t) {
        const auto [a, b, c] = tree.triangle(t);
        out.push_back(reference::placed({tree.vertex(a), tree.vertex(b), tree.vertex(c)}, pose, {}));
    }
    return out;
}
double distance_of_all(const std::vector<reference::Corners>& a, const std::vector<reference::Corners>& b) {
    reference::Real least = HUGE_VALL;
    for (const auto& x : a)
        for (const auto& y : b) least = std::min(least, reference::distance(x, y));
    return static_cast<double>(least);
}
Tree must(Result<Tree> tree) {
    EXPECT_TRUE(tree) << (tree ? "" : tree.error().what);
    return std::move(*tree);
}
Pose near(Random& random, double far) {
    Pose pose = scenes::pose_at(random, random.in(0, far));
    return pose;
}

TEST(Primitives, ABoxIsTwelveTriangles) {
    const Tree tree = must(box_tree({1, 2, 3}));
    EXPECT_EQ(tree.view().triangle_count(), 12u);
    EXPECT_EQ(tree.view().vertex_count(), 8u);
    EXPECT_FALSE(tree.view().surface_mode());
    for (uint32_t v = 0; v < 8; ++v) {
        const Vec3 p = tree.view().vertex(v);
        EXPECT_EQ(std::abs(p.x), 1);
        EXPECT_EQ(std::abs(p.y), 2);
        EXPECT_EQ(std::abs(p.z), 3);
    }
}

// Every point of what a node stands for lies in it: of a random box, the corners of its leaves' triangles.
TEST(Primitives, NodesHoldTheirTriangles) {
    Random random(3);
    for (int i = 0; i < 200; ++i) {
        const auto length = [&] { return static_cast<float>(random.log_in(1e-6, 1e6)); };
        const float x = length(), y = length(), z = length();
        const Tree tree = i % 2 ? must(box_tree({x, y, z})) : must(cylinder_tree(x, y));
        const TreeView view = tree.view();
        view.for_each_in_cut(view.level_count() - 1, [&](uint32_t slot) {
            const TriangleRange range = view.triangles(slot);
            ASSERT_GT(range.count, 0u);
            for (uint32_t t = range.first; t < range.first + range.count; ++t)
                for (const uint32_t v : view.triangle(t)) {
                    const Vec3 p = view.vertex(v);
                    const double q[3] = {p.x, p.y, p.z};
                    EXPECT_LT(radial_squared(view.ellipsoid(slot), q), 1);
                    EXPECT_LT(radial_squared(view.ellipsoid(0), q), 1);
                }
        });
    }
}

TEST(Primitives, BoxesAgreeWithTheShape) { // whose tests share nothing with those of two trees
    Random random(1);
    const Tree a = must(convex_tree(shapes::icosphere(2).vertices, shapes::icosphere(2).triangles)),
               b = must(box_tree({0.5f, 0.25f, 0.75f}));
    const auto context = std::make_unique<QueryContext>();
    int meet = 0;
    for (int i = 0; i < 2000; ++i) {
        const Pose pose_a = near(random, 1), pose_b = near(random, 2);
        const Verdict as_tree = collide(a.view(), pose_a, b.view(), pose_b, *context).verdict,
                      as_shape = overlap(a.view(), pose_a, Box{pose_b, {0.5f, 0.25f, 0.75f}}, *context).verdict;
        EXPECT_EQ(as_tree, as_shape);
        meet += as_tree == Verdict::overlapping;
    }
    EXPECT_GT(meet, 300);
    EXPECT_LT(meet, 1700);
}

TEST(Primitives, DistancesAgreeWithAllTriangles) {
    Random random(2);
    const Tree trees[] = {must(box_tree({0.5f, 0.25f, 0.75f})), must(cylinder_tree(0.5f, 0.6f)),
                          must(convex_tree(shapes::tetrahedron().vertices, shapes::tetrahedron().triangles))};
    const auto context = std::make_unique<QueryContext>();
    int separated = 0;
    for (int i = 0; i < 300; ++i) {
        const TreeView a = trees[i % 3].view(), b = trees[i / 3 % 3].view();
        const Pose pose_a = near(random, 1), pose_b = near(random, 3);
        const double truth = distance_of_all(placed(a, pose_a), placed(b, pose_b));
        const DistanceResult got = distance(a, pose_a, b, pose_b, *context);
        if (got.enclosed) continue;
        EXPECT_LE(got.lower, truth + 1e-15);
        EXPECT_GE(got.upper, truth - 1e-15);
        EXPECT_LE(got.upper - got.lower, 2e-6 * truth + 1e-7);
        separated += got.verdict == Verdict::separated;
    }
    EXPECT_GT(separated, 100);
}

TEST(Primitives, ABoxRestsOnAFloor) {
    const Tree floor = must(box_tree({1000, 1000, 1})), box = must(box_tree({0.5f, 0.5f, 0.5f}));
    const auto context = std::make_unique<QueryContext>();
    ContactManifolds manifolds;
    const Pose below{{0, 0, -1}, {}}, above{{300, -200, 0.499f}, {0, 0, 0.38268343f, 0.92387953f}};
    const ContactResult got = contacts(floor.view(), below, box.view(), above, manifolds, *context);
    EXPECT_EQ(got.verdict, Verdict::overlapping);
    ASSERT_EQ(manifolds.count, 1u);
    const Manifold& m = manifolds.manifolds[0];
    EXPECT_NEAR(m.normal.z, 1, 1e-6);
    ASSERT_EQ(m.count, 4u);
    for (const ContactPoint& p : m.points) EXPECT_NEAR(p.depth, 0.001, 1e-5);
    const Motion at_rest{below, {}, {}, {}}, falling{{{300, -200, 5.5f}, {}}, {0, 0, -10}, {}, {}};
    const SweepResult fall = sweep(floor.view(), at_rest, box.view(), falling, *context);
    EXPECT_EQ(fall.verdict, Verdict::overlapping);
    EXPECT_NEAR(fall.time_upper, 0.5, 1e-3);
}

TEST(Primitives, ACylinderIsHeldAndLittleMore) {
    Random random(4);
    for (const auto& [radius, sides] : {std::pair(1.0f, 32u), {0.01f, 8u}, {250.0f, 256u}}) {
        const float half = 2 * radius;
        const double more = 5.3 / (sides * sides); // of the radius
        const Tree tree = must(sides == 32 ? cylinder_tree(radius, half) : cylinder_tree(radius, half, sides));
        EXPECT_EQ(tree.view().triangle_count(), 4 * sides - 4);
        const auto context = std::make_unique<QueryContext>();
        for (int i = 0; i < 500; ++i) {
            const double x = random.in(-1, 1), y = random.in(-1, 1), length = std::hypot(x, y);
            if (!(length > 0.01)) continue;
            const auto at = [&](double r, double z) {
                return Vec3{static_cast<float>(r * x / length), static_cast<float>(r * y / length),
                            static_cast<float>(z)};
            };
            const double z = random.in(-1, 1) * double{half};
            const SignedDistance on = signed_distance(tree.view(), {}, at(double{radius}, z), *context);
            EXPECT_LE(on.lower, 1e-7 * double{radius});
            EXPECT_GE(on.upper, -more * double{radius});
            EXPECT_EQ(contains(tree.view(), {}, at(0.999 * double{radius}, z), *context), Verdict::overlapping);
            EXPECT_EQ(contains(tree.view(), {}, at((1 + 1.1 * more) * double{radius}, z), *context),
                      Verdict::separated);
        }
    }
    for (const uint32_t sides : {0u, 4u, 33u, 2048u}) EXPECT_EQ(cylinder_tree(1, 1, sides).error().where, sides);
}

// ---- prisms beside the cylinders that they stand for ----

// The cylinder itself, in double precision, and what its prism of so many sides may stick out.
struct RoundCylinder {
    double radius, half_height, more;

    double distance(const Point& p) const { // in its own frame, 0 within
        const double out = std::max(std::hypot(p[0], p[1]) - radius, 0.0);
        return std::hypot(out, std::max(std::abs(p[2]) - half_height, 0.0));
    }
    // From the segment of these ends: the distance is convex along it.
    double distance(const Point& a, const Point& b) const {
        const auto at = [&](double t) {
            return distance(Point{a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]), a[2] + t * (b[2] - a[2])});
        };
        double low = 0, high = 1;
        for (int i = 0; i < 200; ++i) {
            const double third = (high - low) / 3;
            (at(low + third) < at(high - third) ? high : low) += at(low + third) < at(high - third) ? -third : third;
        }
        return at((low + high) / 2);
    }
    // How far it reaches against a direction, from its center.
    double depth(const Point& n) const { return radius * std::hypot(n[0], n[1]) + half_height * std::abs(n[2]); }
};
Point in_frame(const Pose& pose, const Vec3& p) {
    const reference::Vector x{reference::Real{p.x} - pose.translation.x, reference::Real{p.y} - pose.translation.y,
                              reference::Real{p.z} - pose.translation.z};
    const reference::Vector r = reference::operator*(reference::transposed(reference::rotation(pose.rotation)), x);
    return {static_cast<double>(r[0]), static_cast<double>(r[1]), static_cast<double>(r[2])};
}
Point turned(const Pose& pose, const Vec3& n) {
    return in_frame({{}, pose.rotation}, n);
}

struct Cylinders {
    std::vector<RoundCylinder> round;
    std::vector<Tree> prisms;
    Cylinders() {
        for (const uint32_t sides : {8u, 32u, 128u, 1024u})
            for (const float half : {0.05f, 0.7f, 3.0f}) {
                round.push_back({0.5, double{half}, 5.3 / sides / sides * 0.5});
                prisms.push_back(must(cylinder_tree(0.5f, half, sides)));
            }
    }
};
constexpr double kRounding = 2e-6; // of poses, balls and points, which are floats

// Nearer than the cylinder by no more than the prism sticks out, and never farther.
void expect_of_distance(const DistanceResult& got, double gap, double more) { // below 0: they meet
    if (got.verdict == Verdict::separated) {
        EXPECT_GT(gap, -kRounding);
    }
    const double truth = std::max(gap, 0.0);
    EXPECT_LE(got.lower, truth + kRounding);
    EXPECT_GE(got.lower, (truth - more) * (1 - 2e-6) - kRounding);
    EXPECT_LE(got.upper, truth * (1 + 2e-6) + kRounding);
    if (truth > more + kRounding) {
        EXPECT_EQ(got.verdict, Verdict::separated);
    }
}

TEST(Primitives, DistancesOfCylindersAreThoseOfRoundOnes) {
    const Cylinders cylinders;
    Random random(11);
    const auto context = std::make_unique<QueryContext>();
    int apart = 0, meet = 0;
    for (size_t i = 0; i < 3000; ++i) {
        const size_t k = i % cylinders.round.size();
        const RoundCylinder& truth = cylinders.round[k];
        const TreeView prism = cylinders.prisms[k].view();
        const Pose pose = near(random, 1);
        const auto far = [&] { return scenes::to_float(random.in_ball()); };
        // A capsule, every other time a ball: shrunk to within a little of the cylinder, for there it matters.
        const Vec3 a = far(), b = i % 2 == 0 ? a : far();
        const double room = truth.distance(in_frame(pose, a), in_frame(pose, b));
        const auto radius = static_cast<float>(std::max(room + random.in(-1, 1) * random.log_in(1e-5, 0.5), 1e-3));
        const Tree capsule = must(capsule_tree(a, b, radius));
        const DistanceResult got = distance(prism, pose, capsule.view(), {}, *context, {.tolerance_relative = 1e-6});
        expect_of_distance(got, room - double{radius}, truth.more);
        const Verdict verdict = collide(prism, pose, capsule.view(), {}, *context).verdict;
        EXPECT_EQ(verdict, got.verdict);
        ++(verdict == Verdict::separated ? apart : meet);
    }
    EXPECT_GT(apart, 500);
    EXPECT_GT(meet, 500);
}

TEST(Primitives, CylindersOnTheGroundAreRound) {
    const Cylinders cylinders;
    Random random(12);
    const auto context = std::make_unique<QueryContext>();
    int touching = 0, lying = 0;
    for (size_t i = 0; i < 6000; ++i) {
        const size_t k = i % cylinders.round.size();
        const RoundCylinder& truth = cylinders.round[k];
        const TreeView prism = cylinders.prisms[k].view();
        Pose pose = near(random, 1);
        if (i % 3 == 0) { // it lies there, rolled by any angle
            const auto angle = static_cast<float>(random.in(-3, 3));
            pose.rotation = {std::cos(angle), std::sin(angle), std::sin(angle), std::cos(angle)}; // x to z, about z
        }
        const Vec3 up = i % 3 == 0 ? Vec3{0, 0, 1} : scenes::to_float(random.direction());
        const Point n = turned(pose, up), c = {pose.translation.x, pose.translation.y, pose.translation.z};
        const double center = up.x * c[0] + up.y * c[1] + up.z * c[2];
        const double gap = random.in(-1, 1) * random.log_in(1e-6, 0.2), length = std::hypot(n[0], n[1], n[2]);
        const HalfSpace ground{up, static_cast<float>((center - truth.depth(n) - gap) / length)};
        const double apart = center / length - truth.depth(n) / length - double{ground.offset};
        const DistanceResult got = distance(prism, pose, ground, *context);
        expect_of_distance(got, apart, truth.more);
        const float margin = i % 2 == 0 ? 0 : 0.01f;
        ContactManifolds manifolds;
        const ContactResult contact = contacts(prism, pose, ground, manifolds, *context, {.margin = margin});
        if (apart < double{margin} - kRounding) {
            EXPECT_EQ(contact.verdict, Verdict::overlapping);
        }
        if (apart > double{margin} + truth.more + kRounding) {
            EXPECT_EQ(contact.verdict, Verdict::separated);
        }
        if (manifolds.count == 0) continue;
        const Manifold& m = manifolds.manifolds[0];
        double deepest = -1;
        for (uint32_t p = 0; p < m.count; ++p) deepest = std::max(deepest, double{m.points[p].depth});
        const double slack = 0.01 * std::abs(apart) + 1e-4 * (truth.radius + truth.half_height) + kRounding;
        EXPECT_GE(deepest, -apart - slack);
        EXPECT_LE(deepest, -apart + truth.more + kRounding);
        ++touching;
        if (i % 3 != 0 || margin > 0 || apart > 0) continue;
        // Of what rolls: points at both ends, near the line that the cylinder would touch with.
        double least = HUGE_VAL, most = -HUGE_VAL;
        for (uint32_t p = 0; p < m.count; ++p) {
            const Point at = in_frame(pose, m.points[p].point_a);
            least = std::min(least, at[2]), most = std::max(most, at[2]);
            const double under = truth.more - apart + kRounding; // how far it may reach into the ground
            const double chord = std::sqrt(2 * (truth.radius + truth.more) * under) + under;
            EXPECT_LE(std::hypot(at[0] - -truth.radius * n[0] / length, at[1] - -truth.radius * n[1] / length), chord);
        }
        EXPECT_NEAR(least, -truth.half_height, kRounding);
        EXPECT_NEAR(most, truth.half_height, kRounding);
        ++lying;
    }
    EXPECT_GT(touching, 2000);
    EXPECT_GT(lying, 300);
}

// It falls on the ground, and on a ball: not later than the cylinder would, and earlier by no more than it sticks out.
TEST(Primitives, CylindersMeetWhenRoundOnesDo) {
    const Cylinders cylinders;
    Random random(13);
    const auto context = std::make_unique<QueryContext>();
    for (size_t i = 0; i < 600; ++i) {
        const size_t k = i % cylinders.round.size();
        const RoundCylinder& truth = cylinders.round[k];
        const TreeView prism = cylinders.prisms[k].view();
        Pose pose = near(random, 0);
        pose.translation = {0, 0, 5};
        const Motion falling{pose, {0, 0, -8}, {}, {}};
        const double tolerance = 1e-5, slack = (tolerance + kRounding) / 8;
        const double on_ground = (5 - truth.depth(turned(pose, {0, 0, 1}))) / 8;
        const SweepResult ground = sweep(prism, falling, HalfSpace{{0, 0, 1}, 0}, *context, {.tolerance = tolerance});
        ASSERT_EQ(ground.verdict, Verdict::overlapping);
        EXPECT_LE(ground.time_lower, on_ground + slack);
        EXPECT_GE(ground.time_lower, on_ground - truth.more / 8 - slack);

        // Straight above the ball: the time of a round cylinder by bisection, for it falls on what is convex.
        const Tree ball = must(capsule_tree({0, 0, 0}, {0, 0, 0}, 0.4f));
        const auto meets = [&](double t) {
            Pose now = pose;
            now.translation.z = static_cast<float>(5 - 8 * t);
            return truth.distance(in_frame(now, {0, 0, 0})) <= 0.4;
        };
        double low = 0, high = 5.0 / 8;
        for (int step = 0; step < 40; ++step) (meets((low + high) / 2) ? high : low) = (low + high) / 2;
        const Motion still{{}, {}, {}, {}};
        const SweepResult got = sweep(ball.view(), still, prism, falling, *context, {.tolerance = tolerance});
        ASSERT_EQ(got.verdict, Verdict::overlapping);
        EXPECT_LE(got.time_lower, high + slack);
        EXPECT_GT(got.time_lower, 0);
    }
}

TEST(Primitives, AnEllipsoidIsHeldAndLittleMore) {
    Random random(5);
    double most = 0;
    for (int i = 0; i < 300; ++i) {
        const Point radii = scenes::radii(random, random.log_in(1, 100)), c = random.in_ball();
        const double size = random.log_in(1e-3, 1e3);
        const Ellipsoid e = scenes::ellipsoid({size * c[0], size * c[1], size * c[2]},
                                              {size * radii[0], size * radii[1], size * radii[2]}, random.rotation());
        const Tree tree = must(ellipsoid_tree(e));
        const Ellipsoid held = tree.view().ellipsoid(0);
        for (int k = 0; k < 100; ++k) {
            const Point u = random.direction();
            const double p[3] = {e.center.x + e.l11 * u[0], e.center.y + e.l21 * u[0] + e.l22 * u[1],
                                 e.center.z + e.l31 * u[0] + e.l32 * u[1] + e.l33 * u[2]};
            EXPECT_LT(radial_squared(held, p), 1);
        }
        most = std::max(most, std::cbrt(volume(held) / volume(e)) - 1);
    }
    EXPECT_LT(most, 1e-3);
    const Tree ball = must(sphere_tree(2));
    EXPECT_GE(ball.view().ellipsoid(0).l11, 2);
    EXPECT_LT(ball.view().ellipsoid(0).l11, 2 * (1 + 3e-4));
}

TEST(Primitives, WhatIsNoPolyhedronIsRefusedByName) {
    const Mesh tetrahedron = shapes::tetrahedron();
    const auto refused = [](const std::vector<Vec3>& points, const std::vector<Triangle>& triangles) {
        const auto tree = convex_tree(points, triangles);
        EXPECT_FALSE(tree);
        return tree ? std::string() : std::string(tree.error().what);
    };
    const auto with = [&](auto&& change) {
        Mesh mesh = tetrahedron;
        change(mesh);
        return refused(mesh.vertices, mesh.triangles);
    };
    EXPECT_NE(with([](Mesh& m) { m.triangles.pop_back(); }).find("four triangles"), std::string::npos);
    EXPECT_NE(with([](Mesh& m) { m.triangles[0][0] = 9; }).find("does not exist"), std::string::npos);
    EXPECT_NE(with([](Mesh& m) { m.vertices[1].x = std::numeric_limits<float>::quiet_NaN(); }).find("finite"),
              std::string::npos);
    EXPECT_NE(with([](Mesh& m) { std::swap(m.triangles[0][0], m.triangles[0][1]); }).find("same direction"),
              std::string::npos);
    EXPECT_NE(with([](Mesh& m) { m.vertices[3] = {0.5f, 0.5f, 0}; }).find("no area"), std::string::npos);
    const Mesh torus = shapes::torus(1, 0.3f, 8, 6), open = shapes::open_box(),
               inside_out = shapes::inverted(tetrahedron);
    EXPECT_NE(refused(torus.vertices, torus.triangles).find("not convex"), std::string::npos);
    EXPECT_NE(refused(open.vertices, open.triangles).find("open"), std::string::npos);
    EXPECT_NE(refused(inside_out.vertices, inside_out.triangles).find("not convex"), std::string::npos);
}

TEST(Primitives, NumbersOutOfRangeAreRefused) {
    const float nan = std::numeric_limits<float>::quiet_NaN(), infinite = std::numeric_limits<float>::infinity();
    for (const float x : {0.0f, -1.0f, nan, infinite, 1e-40f, 3e38f}) {
        EXPECT_FALSE(box_tree({x, x, x})) << x;
        EXPECT_FALSE(sphere_tree(x)) << x;
        EXPECT_FALSE(cylinder_tree(x, x)) << x;
    }
    EXPECT_FALSE(ellipsoid_tree({{0, 0, 0}, 1e-30f, 0, 1e-38f, 0, 0, 1e-30f}));
    EXPECT_FALSE(ellipsoid_tree({{nan, 0, 0}, 1, 0, 1, 0, 0, 1}));
    EXPECT_FALSE(ellipsoid_tree({{0, 0, 0}, 1, infinite, 1, 0, 0, 1}));
}

TEST(Primitives, PointsThatNoTriangleUsesAreLeftOut) {
    Mesh mesh = shapes::tetrahedron();
    mesh.vertices.insert(mesh.vertices.begin(), {9, 9, 9});
    for (Triangle& t : mesh.triangles)
        for (uint32_t& v : t) ++v;
    const Tree tree = must(convex_tree(mesh.vertices, mesh.triangles));
    EXPECT_EQ(tree.view().vertex_count(), 4u);
    const auto context = std::make_unique<QueryContext>();
    EXPECT_EQ(contains(tree.view(), {}, {0.1f, 0.1f, 0.1f}, *context), Verdict::overlapping);
    EXPECT_EQ(contains(tree.view(), {}, {0.5f, 0.5f, 0.5f}, *context), Verdict::separated);
}

} // namespace
} // namespace prolate
