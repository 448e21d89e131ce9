// Points against bodies: all leaves by brute force in long double, winding numbers by solid angles.
#include "tests/exact_scenes.hpp"
#include "tests/reference.hpp"
#include "tests/scenes.hpp"
#include "tests/shapes.hpp"
#include "tests/targets.hpp"

#include <prolate/points.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <vector>

namespace prolate {
namespace {

using reference::Corners;
using reference::Matrix;
using reference::Real;
using reference::Vector;
using reference::operator*;
using reference::operator-;
using scenes::Point;
using scenes::Random;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// ---- the truth ----

Corners placed(const Mesh& mesh, uint32_t t, const Pose& pose, const Vec3& origin) {
    const auto& [a, b, c] = mesh.triangles[t];
    return reference::placed({mesh.vertices[a], mesh.vertices[b], mesh.vertices[c]}, pose, origin);
}
std::vector<Corners> placed(const Mesh& mesh, const Pose& pose, const Vec3& origin) {
    std::vector<Corners> out;
    for (uint32_t t = 0; t < mesh.triangles.size(); ++t) out.push_back(placed(mesh, t, pose, origin));
    return out;
}
Real distance_from_origin(const std::vector<Corners>& triangles) {
    Real least = HUGE_VALL;
    for (const Corners& t : triangles) least = std::min(least, reference::distance(t, Corners{}));
    return least;
}
// A. van Oosterom, J. Strackee, "The Solid Angle of a Plane Triangle", 1983.
int winding_around_origin(const std::vector<Corners>& triangles) {
    Real sum = 0;
    for (const Corners& t : triangles) {
        const Real a = reference::length(t[0]), b = reference::length(t[1]), c = reference::length(t[2]);
        const Real volume = reference::dot(t[0], reference::cross(t[1], t[2]));
        sum += 2 * std::atan2(volume, a * b * c + reference::dot(t[0], t[1]) * c + reference::dot(t[1], t[2]) * a +
                                          reference::dot(t[2], t[0]) * b);
    }
    return static_cast<int>(std::lround(sum / (4 * std::numbers::pi_v<Real>)));
}

Matrix factor(const Ellipsoid& e) {
    return {{{e.l11, 0, 0}, {e.l21, e.l22, 0}, {e.l31, e.l32, e.l33}}};
}
// Of a point, in an ellipsoid's frame: |L^-1 x|, and outside the distance, by halving t in |L^T (Q + t I)^-1 x| = 1.
struct Seen {
    Real radius, distance;
};
Seen seen(const Ellipsoid& e, const Vector& p) {
    const Matrix l = factor(e), q = l * reference::transposed(l);
    const Vector x = p - reference::vector(e.center);
    const Real radius = reference::length(reference::inverse(l) * x);
    if (radius <= 1) return {radius, 0};
    const auto solve = [&](Real t) {
        Matrix m = q;
        for (size_t i = 0; i < 3; ++i) m[i][i] += t;
        return reference::inverse(m) * x;
    };
    Real low = 0, high = reference::length(x) * (reference::length(x) + std::sqrt(q[0][0] + q[1][1] + q[2][2]));
    for (int i = 0; i < 200; ++i) {
        const Real t = (low + high) / 2;
        (reference::length(reference::transposed(l) * solve(t)) > 1 ? low : high) = t;
    }
    return {radius, reference::length(x - q * solve(high))};
}

// How far from x, inside, a ray leaves all of them: from one to the next until none holds its end.
Real way_out(const std::vector<Ellipsoid>& leaves, const Vector& x, const Vector& direction) {
    Real way = 0;
    for (bool moved = true; moved;) {
        moved = false;
        for (const Ellipsoid& e : leaves) {
            const Matrix to_ball = reference::inverse(factor(e));
            const Vector u = to_ball * (reference::along(x, way, direction) - reference::vector(e.center)),
                         v = to_ball * direction;
            const Real uv = reference::dot(u, v), vv = reference::dot(v, v), in = 1 - reference::dot(u, u);
            if (in < 0) continue;
            const Real leave = (std::sqrt(uv * uv + vv * in) - uv) / vv;
            if (leave > 1e-15L) way += leave, moved = true;
        }
    }
    return way;
}

// ---- scenes ----

Vec3 world_point(const Pose& pose, const Point& p) {
    const Point r = scenes::rotate(pose.rotation, p);
    return scenes::to_float({r[0] + pose.translation.x, r[1] + pose.translation.y, r[2] + pose.translation.z});
}

struct Named {
    const char* name;
    Mesh mesh;
};
std::vector<Named> closed_meshes() {
    Mesh crossing = shapes::box();
    shapes::append(crossing, shapes::moved(shapes::box(), {0.5f, 0.25f, 0.125f}));
    Mesh flat = shapes::icosphere(2);
    for (Vec3& v : flat.vertices) v.z *= 0.01f;
    return {{"ball", shapes::icosphere(2)},
            {"box", shapes::box(1, 2, 3)},
            {"torus", shapes::torus(1, 0.3f, 24, 12)},
            {"hollow", shapes::hollow_ball()},
            {"pieces", shapes::two_pieces()},
            {"crossing", crossing},
            {"flat", flat}};
}

// A point near the body: anywhere, or close to a triangle's corner, edge or face, or on it but for rounding.
Vec3 point_near(Random& random, const Mesh& mesh, const Pose& pose, double size) {
    if (random.below(3) == 0) {
        const Point p = random.in_ball();
        return world_point(pose, {2 * size * p[0], 2 * size * p[1], 2 * size * p[2]});
    }
    const Triangle& t = mesh.triangles[random.below(static_cast<uint32_t>(mesh.triangles.size()))];
    double w[3] = {random.unit(), random.unit(), random.unit()};
    for (double& weight : w)
        if (random.below(3) == 0) weight = 0;
    if (!(w[0] + w[1] + w[2] > 0)) w[0] = 1;
    const double sum = w[0] + w[1] + w[2];
    const Point away = random.direction();
    const double off = random.below(4) == 0 ? 0 : random.log_in(1e-9, 1) * size;
    Point p{off * away[0], off * away[1], off * away[2]};
    for (size_t k = 0; k < 3; ++k) {
        const Vec3 v = mesh.vertices[t[k]];
        const double x[] = {v.x, v.y, v.z};
        for (size_t i = 0; i < 3; ++i) p[i] += w[k] / sum * x[i];
    }
    return world_point(pose, p);
}

struct Counts {
    int points = 0, outside = 0, inside = 0, touching = 0;
};

// ---- exact trees ----

void check_side(const SignedDistance& got, const std::vector<Corners>& triangles, Real distance, Real rounding,
                Counts& counts) {
    ASSERT_NE(got.verdict, Verdict::undecided);
    ASSERT_LE(got.lower, got.upper);
    if (distance > rounding) { // the side is beyond doubt
        const bool inside = winding_around_origin(triangles) != 0;
        const Real truth = inside ? -distance : distance;
        EXPECT_LE(got.lower, truth) << distance;
        EXPECT_GE(got.upper, truth) << distance;
        EXPECT_EQ(got.verdict, inside ? Verdict::overlapping : Verdict::separated);
        ++(inside ? counts.inside : counts.outside);
    } else {
        EXPECT_LE(got.lower, distance);
        EXPECT_GE(got.upper, -distance);
        ++counts.touching;
    }
}

void check_exact(const Mesh& mesh, const TreeView& tree, const Pose& pose, const Vec3& p, double size, Counts& counts) {
    const auto context = std::make_unique<QueryContext>();
    const SignedDistance got = signed_distance(tree, pose, p, *context);
    const std::vector<Corners> triangles = placed(mesh, pose, p);
    const Real distance = distance_from_origin(triangles);
    const double far = std::hypot(pose.translation.x, pose.translation.y, pose.translation.z) + 4 * size;
    const Real rounding = 1e-11L * far;
    ++counts.points;
    check_side(got, triangles, distance, rounding, counts);
    EXPECT_LE(got.upper - got.lower, 4e-9 * far);
    EXPECT_EQ(contains(tree, pose, p, *context), got.verdict);
    // The point lies on the triangle that is named, as far away as it is said to be.
    ASSERT_LT(got.triangle, mesh.triangles.size());
    const Real of_named = reference::distance(placed(mesh, got.triangle, pose, p), Corners{});
    EXPECT_LE(of_named, distance + rounding);
    const Vector there = reference::vector(got.point) - reference::vector(p);
    EXPECT_NEAR(static_cast<double>(reference::length(there)), static_cast<double>(distance), 4e-7 * far);
    if (distance > 1e-4L * far) {
        const Real along = reference::dot(there, reference::vector(got.gradient)) / distance;
        EXPECT_NEAR(static_cast<double>(along), got.lower > 0 ? -1 : 1, 0.02);
    }
}

TEST(Points, ExactTreesAgainstAllTriangles) {
    targets::for_each([](const char* target) {
        Random random(1);
        Counts counts;
        for (const Named& named : closed_meshes())
            for (const double unit : {1.0, 1e-3}) {
                SCOPED_TRACE(::testing::Message() << target << " " << named.name << " " << unit);
                const scenes::ExactScene scene = scenes::exact_tree(
                    shapes::moved(shapes::moved(named.mesh, {0.1f, -0.2f, 0.05f}), {}, static_cast<float>(unit)));
                const TreeView tree = *TreeView::open(scene.bytes);
                for (int i = 0; i < 60; ++i) {
                    const Pose pose = scenes::pose_at(random, i % 5 == 0 ? 100 * unit : unit);
                    check_exact(scene.mesh, tree, pose, point_near(random, scene.mesh, pose, unit), unit, counts);
                }
            }
        EXPECT_GT(counts.outside, counts.points / 5);
        EXPECT_GT(counts.inside, counts.points / 10);
    });
}

// Corners in the body's own frame are no farther than nothing.
TEST(Points, CornersAreNeverOutside) {
    const scenes::ExactScene scene = scenes::exact_tree(shapes::torus(1, 0.3f, 24, 12));
    const TreeView tree = *TreeView::open(scene.bytes);
    const auto context = std::make_unique<QueryContext>();
    for (const Vec3& v : scene.mesh.vertices) {
        const SignedDistance got = signed_distance(tree, {}, v, *context);
        EXPECT_EQ(got.verdict, Verdict::overlapping);
        EXPECT_LE(got.lower, 0);
        EXPECT_GE(got.upper, 0);
        EXPECT_EQ(got.point, v);
        EXPECT_NEAR(std::hypot(got.gradient.x, got.gradient.y, got.gradient.z), 1, 1e-6);
    }
}

// A node that leaves out its triangles hides them: the comparison above would notice.
TEST(Points, NodesThatDoNotHoldTheirTrianglesAreNoticed) {
    Random random(4);
    const scenes::ExactScene scene = scenes::exact_tree(shapes::icosphere(3), {.shrink = 0.5});
    const TreeView tree = *TreeView::open(scene.bytes);
    const auto context = std::make_unique<QueryContext>();
    int wrong = 0;
    for (int i = 0; i < 200; ++i) {
        const Vec3 p = point_near(random, scene.mesh, {}, 1);
        const Real truth = distance_from_origin(placed(scene.mesh, {}, p));
        const SignedDistance got = signed_distance(tree, {}, p, *context);
        wrong += std::min(std::abs(got.lower), std::abs(got.upper)) > truth * (1 + 1e-6L);
    }
    EXPECT_GT(wrong, 0);
}

// ---- trees without triangles ----

void check_inside(const SignedDistance& got, const std::vector<Ellipsoid>& leaves, const Vector& x, const Vector& out) {
    EXPECT_LE(got.upper, 0);
    EXPECT_GT(got.lower, -kInfinity);
    // No way out in any direction is shorter than the depth that is certain.
    Random random(9);
    for (int i = 0; i < 100; ++i) {
        const Point d = random.direction();
        EXPECT_LE(-got.upper, way_out(leaves, x, {d[0], d[1], d[2]}));
    }
    // And the way out that is claimed ends outside.
    for (const Ellipsoid& e : leaves) EXPECT_GT(seen(e, out).radius, 1 - 1e-4L);
    EXPECT_NEAR(static_cast<double>(reference::length(out - x)), -got.lower, 1e-4);
}

void check_ellipsoids(const TreeView& tree, const Pose& pose, const Vec3& p, Counts& counts) {
    const auto context = std::make_unique<QueryContext>();
    const SignedDistance got = signed_distance(tree, pose, p, *context);
    const auto to_body = [&](const Vec3& world) {
        return reference::transposed(reference::rotation(pose.rotation)) *
               (reference::vector(world) - reference::vector(pose.translation));
    };
    const Vector x = to_body(p);
    Real distance = HUGE_VALL, radius = HUGE_VALL;
    std::vector<Ellipsoid> leaves;
    tree.for_each_in_cut(tree.level_count() - 1, [&](uint32_t slot) {
        leaves.push_back(tree.ellipsoid(slot));
        const Seen one = seen(leaves.back(), x);
        distance = std::min(distance, one.distance), radius = std::min(radius, one.radius);
    });
    ++counts.points;
    EXPECT_EQ(contains(tree, pose, p, *context), got.verdict);
    ASSERT_LE(got.lower, got.upper);
    if (radius > 1 + 1e-9L) {
        ++counts.outside;
        EXPECT_EQ(got.verdict, Verdict::separated);
        EXPECT_LE(got.lower, distance * (1 + 1e-15L));
        EXPECT_GE(got.upper, distance * (1 - 1e-15L));
        EXPECT_LE(got.upper - got.lower, 1e-9 * got.upper + 1e-10);
    } else if (radius < 1 - 1e-9L) {
        ++counts.inside;
        EXPECT_EQ(got.verdict, Verdict::overlapping);
        check_inside(got, leaves, x, to_body(got.point));
    }
}

TEST(Points, EllipsoidsAgainstAllLeaves) {
    targets::for_each([](const char* target) {
        SCOPED_TRACE(target);
        Random random(2);
        Counts counts;
        for (int i = 0; i < 12; ++i) {
            const scenes::Scene scene =
                scenes::tree(random, scenes::cloud(random, 300), {.degree = 8, .levels = 1 + random.below(3)});
            const TreeView tree = *TreeView::open(scene.bytes);
            for (int k = 0; k < 25; ++k) {
                const Pose pose = scenes::pose_at(random, 2);
                const Point d = random.in_ball(), &at = scene.points[random.below(300)];
                const double off = random.log_in(1e-6, 2);
                check_ellipsoids(tree, pose,
                                 world_point(pose, {at[0] + off * d[0], at[1] + off * d[1], at[2] + off * d[2]}),
                                 counts);
            }
        }
        EXPECT_GT(counts.outside, 10);
        EXPECT_GT(counts.inside, 100);
    });
}

TEST(Points, AlongAnAxisOfOneEllipsoid) {
    const double center[3] = {0, 0, 0}, factor_of[6] = {1, 0, 2, 0, 0, 3};
    const format::Lattice lattice = format::lattice_for(center, center, 4);
    format::PackedLevel level;
    level.nodes.resize(1);
    format::quantise(level.nodes[0], lattice, center, factor_of);
    const auto bytes = format::encode({}, 8, lattice, std::span(&level, 1));
    const TreeView tree = *TreeView::open(bytes);
    const double radius = tree.ellipsoid(0).l11;
    ASSERT_NEAR(radius, 1, 1e-3);
    const auto context = std::make_unique<QueryContext>();
    for (const float x : {0.0f, 0.25f, 0.75f, 1.5f}) {
        const SignedDistance got = signed_distance(tree, {}, {x, 0, 0}, *context);
        EXPECT_NEAR(got.upper, x - radius, 1e-9);
        EXPECT_NEAR(got.lower, x - radius, 1e-9);
        EXPECT_NEAR(std::abs(got.gradient.x), 1, 1e-6);
        EXPECT_NEAR(std::abs(got.point.x), radius, 1e-6);
    }
}

// ---- what all have in common ----

bool same(const SignedDistance& a, const SignedDistance& b) {
    return a.verdict == b.verdict && a.lower == b.lower && a.upper == b.upper && a.point == b.point &&
           a.gradient == b.gradient && a.node == b.node && a.triangle == b.triangle;
}

TEST(Points, BatchesGiveTheSameBits) {
    Random random(3);
    const scenes::ExactScene scene = scenes::exact_tree(shapes::torus(1, 0.3f, 32, 16));
    const TreeView tree = *TreeView::open(scene.bytes);
    const auto context = std::make_unique<QueryContext>();
    const Pose pose = scenes::pose_at(random, 1);
    std::vector<Vec3> points;
    for (int i = 0; i < 2000; ++i) { // walks, with jumps
        const Point d = random.in_ball();
        const Vec3 from = i % 50 == 0 ? point_near(random, scene.mesh, pose, 1) : points.back();
        points.push_back({from.x + 0.05f * static_cast<float>(d[0]), from.y + 0.05f * static_cast<float>(d[1]),
                          from.z + 0.05f * static_cast<float>(d[2])});
    }
    std::vector<SignedDistance> out(points.size());
    std::vector<Verdict> sides(points.size());
    signed_distance(tree, pose, points, out, *context);
    contains(tree, pose, points, sides, *context);
    uint64_t alone = 0, together = 0;
    for (size_t i = 0; i < points.size(); ++i) {
        const SignedDistance one = signed_distance(tree, pose, points[i], *context);
        EXPECT_TRUE(same(one, out[i])) << i;
        EXPECT_EQ(sides[i], one.verdict);
        alone += one.stats.tests(), together += out[i].stats.tests();
    }
    EXPECT_LT(together, alone);
    std::vector<SignedDistance> few(3);
    signed_distance(tree, pose, points, few, *context); // as many as both spans have
    EXPECT_TRUE(same(few[2], out[2]));
}

TEST(Points, BudgetsOnlyWiden) {
    Random random(5);
    const scenes::ExactScene exact = scenes::exact_tree(shapes::torus(1, 0.3f, 24, 12));
    const scenes::Scene cloud = scenes::tree(random, scenes::cloud(random, 300), {.degree = 8, .levels = 3});
    const auto context = std::make_unique<QueryContext>();
    for (const auto* bytes : {&exact.bytes, &cloud.bytes}) {
        const TreeView tree = *TreeView::open(*bytes);
        for (int i = 0; i < 60; ++i) {
            const Vec3 p = point_near(random, exact.mesh, {}, 1);
            const SignedDistance whole = signed_distance(tree, {}, p, *context);
            for (uint64_t budget = 0; budget < 2 * whole.stats.tests(); budget += 1 + budget / 4) {
                const SignedDistance got = signed_distance(tree, {}, p, *context, {.max_pair_tests = budget});
                EXPECT_LE(got.stats.tests(), budget);
                EXPECT_LE(got.lower, whole.lower);
                EXPECT_GE(got.upper, whole.upper);
                if (got.verdict != Verdict::undecided) {
                    EXPECT_EQ(got.verdict, whole.verdict);
                }
            }
        }
    }
}

TEST(Points, MaxDistanceIsALowerBound) {
    Random random(6);
    const scenes::ExactScene scene = scenes::exact_tree(shapes::icosphere(3));
    const TreeView tree = *TreeView::open(scene.bytes);
    const auto context = std::make_unique<QueryContext>();
    int far = 0;
    for (int i = 0; i < 200; ++i) {
        const Vec3 p = point_near(random, scene.mesh, {}, 1);
        const SignedDistance whole = signed_distance(tree, {}, p, *context),
                             near = signed_distance(tree, {}, p, *context, {.max_distance = 0.1});
        EXPECT_EQ(whole.verdict, near.verdict);
        if (std::abs(whole.upper) < 0.0999) {
            EXPECT_TRUE(same(whole, near));
            continue;
        }
        ++far;
        EXPECT_LE(near.lower, whole.lower);
        EXPECT_GE(near.upper, whole.upper);
        EXPECT_GE(std::max(near.lower, -near.upper), 0.0998);
    }
    EXPECT_GT(far, 50);
}

TEST(Points, OpenMeshesHaveNoInside) {
    const scenes::ExactScene scene = scenes::exact_tree(shapes::open_box(), {.closed = false});
    const TreeView tree = *TreeView::open(scene.bytes);
    const auto context = std::make_unique<QueryContext>();
    const SignedDistance middle = signed_distance(tree, {}, {0.5f, 0.5f, 0.5f}, *context);
    EXPECT_EQ(middle.verdict, Verdict::separated);
    EXPECT_NEAR(middle.lower, 0.5, 1e-9);
    const SignedDistance corner = signed_distance(tree, {}, {0, 0, 0}, *context);
    EXPECT_EQ(corner.verdict, Verdict::overlapping);
    EXPECT_EQ(corner.lower, 0);
}

TEST(Points, PrefixesOfExactTreesOnlyBoundFromBelow) {
    const scenes::ExactScene scene = scenes::exact_tree(shapes::icosphere(3));
    const TreeView whole = *TreeView::open(scene.bytes);
    ASSERT_GT(whole.level_count(), 2u);
    const TreeView tree = *TreeView::open(std::span(scene.bytes).first(whole.level(1).end_byte));
    const auto context = std::make_unique<QueryContext>();
    EXPECT_EQ(signed_distance(tree, {}, {0, 0, 0}, *context).verdict, Verdict::undecided);
    const Vec3 p{3, 0.5f, 1};
    const SignedDistance got = signed_distance(tree, {}, p, *context), truth = signed_distance(whole, {}, p, *context);
    EXPECT_EQ(got.verdict, Verdict::separated);
    EXPECT_GT(got.lower, 0.7 * truth.lower);
    EXPECT_LE(got.lower, truth.lower);
    EXPECT_EQ(got.upper, kInfinity);
}

TEST(Points, WhatIsNotFiniteIsNeverOutside) {
    const scenes::ExactScene scene = scenes::exact_tree(shapes::box());
    const TreeView tree = *TreeView::open(scene.bytes);
    const auto context = std::make_unique<QueryContext>();
    const float nan = std::numeric_limits<float>::quiet_NaN(), infinite = std::numeric_limits<float>::infinity();
    const Pose bad[] = {{{nan, 0, 0}, {}}, {{infinite, 0, 0}, {}}, {{}, {0, 0, 0, 0}}, {{}, {nan, 0, 0, 1}}};
    for (const Pose& pose : bad) {
        EXPECT_EQ(signed_distance(tree, pose, {5, 5, 5}, *context).verdict, Verdict::undecided);
        EXPECT_EQ(contains(tree, pose, {5, 5, 5}, *context), Verdict::undecided);
    }
    for (const float x : {nan, infinite}) {
        const SignedDistance got = signed_distance(tree, {}, {5, x, 5}, *context);
        EXPECT_EQ(got.verdict, Verdict::undecided);
        EXPECT_EQ(got.lower, -kInfinity);
        EXPECT_EQ(got.upper, kInfinity);
    }
    // As far as floats reach.
    const SignedDistance far = signed_distance(tree, {}, {3e38f, 0, 0}, *context);
    EXPECT_EQ(far.verdict, Verdict::separated);
    EXPECT_NEAR(far.lower / 3e38, 1, 1e-6);
}

} // namespace
} // namespace prolate
