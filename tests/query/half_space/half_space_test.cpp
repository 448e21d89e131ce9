// Bodies against half-spaces: all corners and all ellipsoids by brute force, in long double.
#include "tests/exact_scenes.hpp"
#include "tests/reference.hpp"
#include "tests/scenes.hpp"
#include "tests/shapes.hpp"
#include "tests/targets.hpp"

#include <prolate/half_space.hpp>
#include <prolate/primitives.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <vector>

namespace prolate {
namespace {

using reference::Real;
using reference::Vector;
using reference::operator*;
using reference::operator-;
using scenes::Point;
using scenes::Random;

struct Plane {
    Vector normal;
    Real offset;
    Real height(const Vector& p) const { return reference::dot(normal, p) - offset; }
};
Plane plane_of(const HalfSpace& h) {
    const Vector n = reference::vector(h.normal);
    const Real length = reference::length(n);
    return {{n[0] / length, n[1] / length, n[2] / length}, h.offset};
}
Vector to_world(const Pose& pose, const Vector& p) {
    const Vector r = reference::rotation(pose.rotation) * p, t = reference::vector(pose.translation);
    return {r[0] + t[0], r[1] + t[1], r[2] + t[2]};
}

// Heights of all corners of a tree, or the least of each leaf ellipsoid.
std::vector<Real> heights(const TreeView& tree, const Pose& pose, const Plane& plane) {
    std::vector<Real> out;
    for (uint32_t v = 0; v < tree.vertex_count(); ++v)
        out.push_back(plane.height(to_world(pose, reference::vector(tree.vertex(v)))));
    if (tree.has_triangles()) return out;
    const Vector n = reference::transposed(reference::rotation(pose.rotation)) * plane.normal;
    tree.for_each_in_cut(tree.level_count() - 1, [&](uint32_t slot) {
        const Ellipsoid e = tree.ellipsoid(slot);
        const Vector m{e.l11 * n[0] + e.l21 * n[1] + e.l31 * n[2], e.l22 * n[1] + e.l32 * n[2], e.l33 * n[2]};
        out.push_back(plane.height(to_world(pose, reference::vector(e.center))) - reference::length(m));
    });
    return out;
}

struct Bodies {
    std::vector<std::vector<std::byte>> bytes;
    std::vector<TreeView> trees;
    Bodies() {
        Random random(8);
        bytes.push_back(scenes::exact_tree(shapes::torus(1, 0.3f, 32, 16)).bytes);
        bytes.push_back(scenes::exact_tree(shapes::box(1, 2, 0.5f)).bytes);
        bytes.push_back(scenes::exact_tree(shapes::sheet(2, 2, 12), {.closed = false}).bytes);
        bytes.push_back(scenes::tree(random, scenes::cloud(random, 400), {.degree = 8, .levels = 3}).bytes);
        for (const auto& b : bytes) trees.push_back(*TreeView::open(b));
    }
};

HalfSpace ground(Random& random) {
    const Point n = random.direction();
    const double length = random.log_in(0.1, 10);
    return {scenes::to_float({length * n[0], length * n[1], length * n[2]}), static_cast<float>(random.in(-1.5, 1.5))};
}

TEST(HalfSpace, DistancesAgainstAllCorners) {
    const Bodies bodies;
    targets::for_each([&](const char* target) {
        SCOPED_TRACE(target);
        Random random(1);
        const auto context = std::make_unique<QueryContext>();
        int separated = 0;
        for (int i = 0; i < 600; ++i) {
            const TreeView& tree = bodies.trees[static_cast<size_t>(i) % bodies.trees.size()];
            const Pose pose = scenes::pose_at(random, random.in(0, 3));
            const HalfSpace half_space = ground(random);
            const std::vector<Real> all = heights(tree, pose, plane_of(half_space));
            const Real truth = std::max(*std::min_element(all.begin(), all.end()), Real{0});
            const DistanceResult got = distance(tree, pose, half_space, *context);
            EXPECT_EQ(got.verdict, overlap(tree, pose, half_space, *context).verdict);
            EXPECT_LE(got.lower, truth + 1e-17L);
            EXPECT_GE(got.upper, truth - 1e-17L);
            EXPECT_LE(got.upper - got.lower, 1e-11);
            separated += got.verdict == Verdict::separated;
            const Real apart = reference::length(reference::vector(got.point_a) - reference::vector(got.point_b));
            EXPECT_NEAR(static_cast<double>(apart), static_cast<double>(truth), 2e-6);
            const DistanceResult near = distance(tree, pose, half_space, *context, {.max_distance = 0.25});
            EXPECT_EQ(near.verdict, got.verdict);
            EXPECT_LE(near.lower, got.lower);
            EXPECT_GE(near.lower, std::min(got.lower, 0.25));
        }
        EXPECT_GT(separated, 100);
        EXPECT_LT(separated, 500);
    });
}

void check_contacts(const TreeView& tree, const Pose& pose, const HalfSpace& half_space, float margin,
                    QueryContext& context) {
    const Plane plane = plane_of(half_space);
    const std::vector<Real> all = heights(tree, pose, plane);
    const Real lowest = *std::min_element(all.begin(), all.end());
    ContactManifolds manifolds;
    const ContactResult got = contacts(tree, pose, half_space, manifolds, context, {.margin = margin});
    EXPECT_EQ(got.verdict, overlap(tree, pose, half_space, context, {.margin = margin}).verdict);
    ASSERT_EQ(manifolds.count, got.verdict == Verdict::overlapping ? 1u : 0u);
    if (manifolds.count == 0) return;
    const Manifold& m = manifolds.manifolds[0];
    ASSERT_GT(m.count, 0u);
    Real deepest = -HUGE_VALL;
    for (uint32_t k = 0; k < m.count; ++k) {
        const ContactPoint& p = m.points[k];
        deepest = std::max(deepest, Real{p.depth});
        EXPECT_GE(p.depth, -margin - 1e-6f);
        EXPECT_NEAR(static_cast<double>(plane.height(reference::vector(p.point_a))), -p.depth, 2e-6);
        EXPECT_NEAR(static_cast<double>(plane.height(reference::vector(p.point_b))), 0, 2e-6);
    }
    EXPECT_NEAR(static_cast<double>(deepest), static_cast<double>(-lowest),
                0.011 * std::abs(static_cast<double>(lowest)) + 2e-4);
    EXPECT_NEAR(static_cast<double>(reference::dot(plane.normal, reference::vector(m.normal))), -1, 1e-6);
}

TEST(HalfSpace, ContactsAgainstAllCorners) {
    const Bodies bodies;
    targets::for_each([&](const char* target) {
        SCOPED_TRACE(target);
        Random random(2);
        const auto context = std::make_unique<QueryContext>();
        for (int i = 0; i < 600; ++i) {
            const TreeView& tree = bodies.trees[static_cast<size_t>(i) % bodies.trees.size()];
            check_contacts(tree, scenes::pose_at(random, random.in(0, 2)), ground(random), i % 3 == 0 ? 0.1f : 0,
                           *context);
        }
    });
}

// What lies flat touches with its corners, however fine its bottom is meshed.
TEST(HalfSpace, WhatLiesFlatSpansItsBottom) {
    const scenes::ExactScene sheet = scenes::exact_tree(shapes::sheet(2, 1, 40), {.closed = false});
    const auto context = std::make_unique<QueryContext>();
    ContactManifolds manifolds;
    const ContactResult got =
        contacts(*TreeView::open(sheet.bytes), {{0, 0, -0.01f}, {}}, {{0, 0, 1}, 0}, manifolds, *context);
    ASSERT_EQ(manifolds.count, 1u);
    const Manifold& m = manifolds.manifolds[0];
    ASSERT_EQ(m.count, 4u);
    for (const ContactPoint& p : m.points) {
        EXPECT_TRUE(p.point_a.x == 0 || p.point_a.x == 2);
        EXPECT_TRUE(p.point_a.y == 0 || p.point_a.y == 1);
        EXPECT_NEAR(p.depth, 0.01, 1e-6);
    }
    EXPECT_LT(got.stats.triangle_tests, 3200u / 3); // of 3200 triangles
}

// Area of the convex hull of points, seen along z.
double hull_area(std::vector<Point> points) {
    std::sort(points.begin(), points.end());
    std::vector<Point> hull;
    const auto left = [](const Point& a, const Point& b, const Point& c) {
        return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) > 0;
    };
    double area = 0;
    for (int half = 0; half < 2; ++half, std::reverse(points.begin(), points.end())) {
        hull.clear();
        for (const Point& p : points) {
            while (hull.size() > 1 && !left(hull[hull.size() - 2], hull.back(), p)) hull.pop_back();
            hull.push_back(p);
        }
        for (size_t i = 1; i < hull.size(); ++i)
            area += 0.5 * (hull[i - 1][0] * hull[i][1] - hull[i - 1][1] * hull[i][0]);
    }
    return area;
}

// Four points have at least half the area of what touches if the first two are the farthest apart, and the others the
// farthest from their line. That is asked of what is about level with the lowest corner. Here one of them is the
// deepest, which costs area. From step to step a body tilts and turns, so that other corners touch than those of the
// last step, which the search begins with.
TEST(HalfSpace, ManifoldsSpanWhatTouches) {
    Mesh pad = shapes::icosphere(4), plate = shapes::sheet(2, 0.3f, 24);
    for (Vec3& v : pad.vertices) v = {v.x, 0.15f * v.y, 0.3f * v.z};
    for (Vec3& v : plate.vertices) v = {0.6f * v.x - 0.8f * v.y, 0.8f * v.x + 0.6f * v.y, v.z};
    const scenes::ExactScene all[] = {scenes::exact_tree(pad), scenes::exact_tree(plate, {.closed = false}),
                                      scenes::exact_tree(shapes::torus(1, 0.3f, 50, 50))};
    Random random(31);
    const auto context = std::make_unique<QueryContext>();
    const HalfSpace ground{{0, 0, 1}, 0};
    double least = 1, sum = 0;
    int count = 0;
    for (int i = 0; i < 60; ++i) {
        const TreeView tree = *TreeView::open(all[i % 3].bytes);
        const double turn = random.in(-3, 3), tilt = random.in(0, i % 3 == 0 ? 0.05 : 0.002);
        ContactManifolds manifolds;
        for (int step = 0; step < 20; ++step) {
            const double angle = turn + 0.01 * step, x = tilt * std::cos(0.3 * step), y = tilt * std::sin(0.3 * step);
            Pose pose{{},
                      {static_cast<float>(x), static_cast<float>(y), static_cast<float>(std::sin(angle / 2)),
                       static_cast<float>(std::cos(angle / 2))}};
            std::vector<Real> over = heights(tree, pose, plane_of(ground));
            const float margin = 0.02f;
            pose.translation.z = -static_cast<float>(*std::min_element(over.begin(), over.end())) - 0.004f;
            contacts(tree, pose, ground, manifolds, *context, {.margin = margin});
            ASSERT_EQ(manifolds.count, 1u);
            over = heights(tree, pose, plane_of(ground));
            std::vector<Point> touching, kept;
            for (uint32_t v = 0; v < tree.vertex_count(); ++v) {
                const Vector p = to_world(pose, reference::vector(tree.vertex(v)));
                if (over[v] <= -0.002) touching.push_back({static_cast<double>(p[0]), static_cast<double>(p[1]), 0});
            }
            double deepest = -1;
            const Manifold& m = manifolds.manifolds[0];
            for (uint32_t k = 0; k < m.count; ++k) {
                kept.push_back({m.points[k].point_a.x, m.points[k].point_a.y, 0});
                deepest = std::max(deepest, double{m.points[k].depth});
            }
            EXPECT_NEAR(deepest, 0.004, 2.5e-4); // 1e-4 of the bodies' size, which is about 2
            const double whole = hull_area(touching);
            if (whole < 1e-3 || i % 3 == 0) continue; // the pad stands on a ridge
            const double share = hull_area(kept) / whole;
            least = std::min(least, share), sum += share, ++count;
        }
    }
    EXPECT_GT(count, 600);
    EXPECT_GT(least, 0.4);
    EXPECT_GT(sum / count, 0.8); // and of what is higher
}

// With a large margin, points that are far away and high above do not take the places of those that a tilted ring rolls
// onto next.
TEST(HalfSpace, RoundBodiesTouchNearTheirLowestPoint) {
    const scenes::ExactScene scene = scenes::exact_tree(shapes::torus(1, 0.3f, 50, 50));
    const TreeView tree = *TreeView::open(scene.bytes);
    Random random(32);
    const auto context = std::make_unique<QueryContext>();
    const HalfSpace ground{{0, 0, 1}, 0};
    for (int i = 0; i < 50; ++i) {
        const double tilt = random.in(0.2, 1.2), turn = random.in(-3, 3);
        Pose pose{{},
                  {static_cast<float>(std::sin(tilt / 2) * std::cos(turn)),
                   static_cast<float>(std::sin(tilt / 2) * std::sin(turn)), 0, static_cast<float>(std::cos(tilt / 2))}};
        const std::vector<Real> over = heights(tree, pose, plane_of(ground));
        pose.translation.z = -static_cast<float>(*std::min_element(over.begin(), over.end()));
        ContactManifolds manifolds;
        contacts(tree, pose, ground, manifolds, *context, {.margin = 0.3f});
        ASSERT_EQ(manifolds.count, 1u);
        const Manifold& m = manifolds.manifolds[0];
        EXPECT_GE(m.count, 3u);
        for (uint32_t k = 0; k < m.count; ++k) EXPECT_GT(m.points[k].depth, -0.05f);
    }
}

// A body of few corners is not searched, one of many is: a fine ball inside a box makes no difference to its contacts.
TEST(HalfSpace, FewCornersTouchAsManyDo) {
    const Mesh box = shapes::box(1, 2, 0.5f);
    Mesh filled = box;
    shapes::append(filled, shapes::moved(shapes::icosphere(2), {0.5f, 1, 0.25f}, 0.05f));
    const scenes::ExactScene few = scenes::exact_tree(box), many = scenes::exact_tree(filled);
    ASSERT_LE(few.mesh.vertices.size(), 64u);
    ASSERT_GT(many.mesh.vertices.size(), 64u);
    Random random(5);
    const auto context = std::make_unique<QueryContext>();
    uint32_t points = 0;
    for (int i = 0; i < 1000; ++i) {
        const HalfSpace half_space = ground(random);
        const Pose pose = scenes::pose_at(random, random.in(0, 2));
        const QueryOptions options{.margin = i % 2 == 0 ? 0.05f : 0};
        ContactManifolds a, b;
        const ContactResult of_few = contacts(*TreeView::open(few.bytes), pose, half_space, a, *context, options);
        const ContactResult of_many = contacts(*TreeView::open(many.bytes), pose, half_space, b, *context, options);
        ASSERT_EQ(of_few.verdict, of_many.verdict);
        ASSERT_EQ(a.count, b.count);
        if (a.count == 0) continue;
        const Manifold &m = a.manifolds[0], &n = b.manifolds[0];
        ASSERT_EQ(m.normal, n.normal);
        const bool ball_touches = plane_of(half_space).height(to_world(pose, {0.5L, 1, 0.25L})) < 0.11L;
        if (ball_touches) continue;
        const auto deepest = [](const Manifold& of) {
            float most = -1;
            for (uint32_t k = 0; k < of.count; ++k) most = std::max(most, of.points[k].depth);
            return most;
        };
        EXPECT_NEAR(deepest(m), deepest(n), 3e-4);
        for (uint32_t k = 0; k < n.count; ++k, ++points) // which of those that are higher are kept may differ
            EXPECT_GE(n.points[k].depth, -options.margin - 1e-6f);
        if (of_few.found == 1) {
            EXPECT_EQ(m.points[0].point_a, n.points[0].point_a);
        }
    }
    EXPECT_GT(points, 200u);
}

// Four corners or fewer that touch are the manifold, however high or near each other they are.
TEST(HalfSpace, FourCornersAreTheManifold) {
    const scenes::ExactScene scenes[] = {scenes::exact_tree(shapes::box(1, 2, 0.001f)),
                                         scenes::exact_tree(shapes::torus(1, 0.4f, 8, 6))};
    Random random(6);
    const auto context = std::make_unique<QueryContext>();
    int whole = 0, of_more = 0;
    for (int i = 0; i < 1000; ++i) {
        const TreeView tree = *TreeView::open(scenes[i % 2].bytes);
        const Pose pose = scenes::pose_at(random, 1);
        const HalfSpace half_space = ground(random);
        const float margin = i % 3 == 0 ? 0 : 0.2f;
        uint32_t touching = 0;
        for (const Real over : heights(tree, pose, plane_of(half_space))) touching += over <= margin;
        ContactManifolds manifolds;
        const ContactResult got = contacts(tree, pose, half_space, manifolds, *context, {.margin = margin});
        if (touching <= 2 * kManifoldPoints) {
            EXPECT_EQ(got.found, touching);
        }
        if (touching == 0) continue;
        ASSERT_EQ(manifolds.count, 1u);
        const Manifold& m = manifolds.manifolds[0];
        if (touching <= kManifoldPoints) {
            EXPECT_EQ(m.count, touching);
        }
        for (uint32_t k = 1; k < m.count; ++k) EXPECT_LT(m.points[k - 1].id, m.points[k].id);
        ++(touching <= kManifoldPoints ? whole : of_more);
    }
    EXPECT_GT(whole, 150);
    EXPECT_GT(of_more, 150);
}

TEST(HalfSpace, VerticesWithoutTrianglesDoNotTouch) {
    Mesh mesh = shapes::box();
    mesh.vertices.push_back({0.5f, 0.5f, -3});
    const scenes::ExactScene scene = scenes::exact_tree(mesh);
    const auto context = std::make_unique<QueryContext>();
    ContactManifolds manifolds;
    const TreeView tree = *TreeView::open(scene.bytes);
    EXPECT_EQ(contacts(tree, {{0, 0, 1}, {}}, {{0, 0, 1}, 0}, manifolds, *context).verdict, Verdict::separated);
    EXPECT_EQ(contacts(tree, {{0, 0, -0.1f}, {}}, {{0, 0, 1}, 0}, manifolds, *context).found, 4u);
}

TEST(HalfSpace, PointsKeepTheirAgeAndImpulse) {
    const Tree box = std::move(*box_tree({0.5f, 0.5f, 0.5f}));
    const auto context = std::make_unique<QueryContext>();
    ContactManifolds manifolds;
    for (uint32_t step = 0; step < 5; ++step) {
        const float x = 0.01f * static_cast<float>(step);
        contacts(box.view(), {{x, 0, 0.499f}, {0, 0, x, 1}}, {{0, 0, 1}, 0}, manifolds, *context);
        ASSERT_EQ(manifolds.count, 1u);
        ASSERT_EQ(manifolds.manifolds[0].count, 4u);
        for (ContactPoint& p : manifolds.manifolds[0].points) {
            EXPECT_EQ(p.age, step);
            EXPECT_EQ(p.impulse[0], static_cast<float>(step));
            p.impulse[0] += 1;
        }
    }
}

// Whatever the manifolds were of before: the last step, another body, pose, plane, margin, level or budget.
TEST(HalfSpace, WhatWasKnownBeforeNeverMisleads) {
    const Bodies bodies;
    Random random(41);
    const auto context = std::make_unique<QueryContext>();
    ContactManifolds manifolds;
    size_t which = 0;
    Pose pose;
    HalfSpace half_space{{0, 0, 1}, 0};
    float margin = 0;
    int touching = 0, apart = 0;
    const auto moved = [&random](const Vec3& v, double by) {
        const Point d = random.in_ball();
        return scenes::to_float({v.x + by * d[0], v.y + by * d[1], v.z + by * d[2]});
    };
    for (int i = 0; i < 3000; ++i) {
        const double choice = random.in(0, 1), step = random.log_in(1e-6, 0.1);
        if (choice < 0.05) which = static_cast<size_t>(i) % bodies.trees.size();
        if (choice < 0.2) {
            pose = scenes::pose_at(random, random.in(0, 2));
        } else if (choice < 0.3) {
            half_space = ground(random);
        } else if (choice < 0.4) {
            margin = i % 2 == 0 ? 0 : static_cast<float>(random.log_in(1e-4, 0.5));
        } else {
            pose.translation = moved(pose.translation, step);
            const Vec3 turned = moved({pose.rotation.x, pose.rotation.y, pose.rotation.z}, step);
            pose.rotation = {turned.x, turned.y, turned.z, pose.rotation.w};
        }
        const TreeView& tree = bodies.trees[which];
        const auto lowest = [&] {
            const std::vector<Real> all = heights(tree, pose, plane_of(half_space));
            return static_cast<double>(*std::min_element(all.begin(), all.end()));
        };
        if (choice > 0.5) half_space.offset += static_cast<float>(lowest() + (choice > 0.7 ? step : -step));
        QueryOptions options{.margin = margin};
        if (i % 10 == 0) options.max_pair_tests = static_cast<uint64_t>(random.log_in(1, 300));
        if (i % 10 == 5) options.max_level = static_cast<uint32_t>(i) % 4;
        const ContactResult got = contacts(tree, pose, half_space, manifolds, *context, options);
        const double least = lowest();
        if (got.verdict == Verdict::separated) {
            EXPECT_GT(least, margin - 1e-6) << i;
        }
        if (i % 5 == 0) continue;
        ASSERT_EQ(got.verdict, overlap(tree, pose, half_space, *context, options).verdict) << i;
        ASSERT_EQ(manifolds.count, got.verdict == Verdict::overlapping ? 1u : 0u) << i;
        ++(manifolds.count == 0 ? apart : touching);
        if (manifolds.count == 0) continue;
        const Manifold& m = manifolds.manifolds[0];
        float deepest = -HUGE_VALF;
        for (uint32_t k = 0; k < m.count; ++k) {
            const ContactPoint& p = m.points[k];
            deepest = std::max(deepest, p.depth);
            EXPECT_GE(p.depth, -margin - 1e-6f) << i;
            EXPECT_NEAR(static_cast<double>(plane_of(half_space).height(reference::vector(p.point_a))), -p.depth, 4e-6);
        }
        EXPECT_NEAR(deepest, -least, std::max(0.01 * std::abs(least), 2.5e-4) + 1e-6) << i; // sizes are about 2.5
    }
    EXPECT_GT(touching, 1000);
    EXPECT_GT(apart, 200);
}

TEST(HalfSpace, BudgetsOnlyWiden) {
    const Bodies bodies;
    Random random(3);
    const auto context = std::make_unique<QueryContext>();
    for (int i = 0; i < 100; ++i) {
        const TreeView& tree = bodies.trees[static_cast<size_t>(i) % bodies.trees.size()];
        const Pose pose = scenes::pose_at(random, random.in(0, 2));
        const HalfSpace half_space = ground(random);
        const DistanceResult whole = distance(tree, pose, half_space, *context);
        for (uint64_t budget = 0; budget < whole.stats.tests(); budget += 1 + budget / 2) {
            const DistanceResult got = distance(tree, pose, half_space, *context, {.max_pair_tests = budget});
            EXPECT_LE(got.stats.tests(), budget);
            EXPECT_LE(got.lower, whole.lower);
            EXPECT_GE(got.upper, whole.upper);
            EXPECT_TRUE(got.verdict == Verdict::undecided || got.verdict == whole.verdict);
            ContactManifolds manifolds;
            const ContactResult c = contacts(tree, pose, half_space, manifolds, *context, {.max_pair_tests = budget});
            EXPECT_LE(c.stats.tests(), budget);
            EXPECT_TRUE(c.verdict == Verdict::undecided || c.verdict == whole.verdict);
        }
    }
}

TEST(HalfSpace, WhatIsNotFiniteIsNeverSeparated) {
    const Tree box = std::move(*box_tree({0.5f, 0.5f, 0.5f}));
    const auto context = std::make_unique<QueryContext>();
    const float nan = std::numeric_limits<float>::quiet_NaN(), infinite = std::numeric_limits<float>::infinity();
    const HalfSpace bad[] = {{{0, 0, 0}, -9}, {{0, nan, 1}, -9}, {{0, infinite, 1}, -9}, {{0, 0, 1}, nan}};
    for (const HalfSpace& h : bad) {
        ContactManifolds manifolds;
        EXPECT_NE(contacts(box.view(), {}, h, manifolds, *context).verdict, Verdict::separated);
        EXPECT_EQ(manifolds.count, 0u);
        EXPECT_EQ(distance(box.view(), {}, h, *context).verdict, Verdict::undecided);
    }
    const Pose poses[] = {{{nan, 0, 0}, {}}, {{}, {0, 0, 0, 0}}};
    for (const Pose& pose : poses) {
        ContactManifolds manifolds;
        EXPECT_NE(contacts(box.view(), pose, {{0, 0, 1}, -9}, manifolds, *context).verdict, Verdict::separated);
        EXPECT_EQ(distance(box.view(), pose, {{0, 0, 1}, -9}, *context).verdict, Verdict::undecided);
    }
}

// At sampled times before time_lower no corner is in the half-space, and at time_upper one is as near as the tolerance.
TEST(HalfSpace, SweepsAgainstAllCornersAtManyTimes) {
    const Bodies bodies;
    Random random(21);
    const auto context = std::make_unique<QueryContext>();
    uint32_t hits = 0, misses = 0, at_start = 0;
    uint64_t tests = 0;
    for (uint32_t i = 0; i < 400; ++i) {
        const TreeView tree = bodies.trees[i % bodies.trees.size()];
        const HalfSpace shape = ground(random);
        const Plane plane = plane_of(shape);
        const double far = i % 7 == 0 ? 1e4 : 1;
        Motion motion;
        motion.start = scenes::pose_at(random, far * random.in(0, 4));
        const Point v = random.in_ball(), w = random.in_ball(), c = random.in_ball();
        motion.linear = scenes::to_float({5 * v[0], 5 * v[1], 5 * v[2]});
        motion.angular = scenes::to_float({6 * w[0], 6 * w[1], 6 * w[2]});
        motion.center = scenes::to_float(c);
        if (far > 1) { // level with the plane again
            const Real height = plane.height(reference::vector(motion.start.translation)) - 3;
            motion.start.translation.x -= static_cast<float>(height * plane.normal[0]);
            motion.start.translation.y -= static_cast<float>(height * plane.normal[1]);
            motion.start.translation.z -= static_cast<float>(height * plane.normal[2]);
        }
        const float margin = i % 3 == 0 ? 0.1f : 0;
        const double tolerance = i % 2 == 0 ? 0.01 : 1e-5;
        const SweepResult r = sweep(tree, motion, shape, *context, {.tolerance = tolerance, .margin = margin});
        tests += r.stats.tests();
        // pose_at() rounds to floats once: what that moves a corner by.
        const Real rounding = 4e-7L * (far * 5 + 10);
        const auto lowest = [&](double t) {
            const std::vector<Real> h = heights(tree, pose_at(motion, t), plane);
            return *std::min_element(h.begin(), h.end());
        };
        for (int k = 0; k < 50 && r.time_lower > 0; ++k)
            EXPECT_GT(lowest(r.time_lower * k / 50), margin - rounding) << i;
        if (r.verdict == Verdict::separated) {
            EXPECT_EQ(r.time_lower, 1);
            EXPECT_TRUE(std::isinf(r.time_upper));
            EXPECT_GT(lowest(1), margin - rounding);
            ++misses;
            continue;
        }
        ASSERT_EQ(r.verdict, Verdict::overlapping) << i;
        EXPECT_EQ(r.time_lower, r.time_upper);
        EXPECT_LT(lowest(r.time_upper), margin + static_cast<Real>(tolerance) + rounding);
        EXPECT_LT(r.distance, double{margin} + tolerance + 1e-6 * far);
        EXPECT_NEAR(static_cast<double>(plane.height(reference::vector(r.point_a))),
                    r.time_upper == 0 ? static_cast<double>(lowest(0)) : r.distance, 1e-5 * far + 1e-6);
        ++(r.time_upper > 0 ? hits : at_start);
    }
    EXPECT_GT(hits, 50u);
    EXPECT_GT(misses, 80u);
    EXPECT_GT(at_start, 20u);
    EXPECT_LT(tests / 400, 3000u);
}

TEST(HalfSpace, SweepsKeepTheirWordOnABudget) {
    const Bodies bodies;
    const auto context = std::make_unique<QueryContext>();
    Motion motion;
    motion.start.translation = {0, 0, 5}, motion.linear = {0, 0, -8}, motion.angular = {1, 2, 3};
    const HalfSpace floor{{0, 0, 1}, 0};
    for (const TreeView& tree : bodies.trees) {
        const SweepResult whole = sweep(tree, motion, floor, *context);
        ASSERT_EQ(whole.verdict, Verdict::overlapping);
        double lower = 0;
        for (uint64_t budget = 0; budget < whole.stats.tests() + 10; ++budget) {
            const SweepResult r = sweep(tree, motion, floor, *context, {.max_pair_tests = budget});
            EXPECT_LE(r.stats.tests(), budget);
            EXPECT_GE(r.time_lower, lower);
            EXPECT_LE(r.time_lower, whole.time_upper);
            EXPECT_TRUE(r.verdict == Verdict::overlapping || r.verdict == Verdict::undecided);
            lower = r.time_lower;
        }
        EXPECT_EQ(lower, whole.time_lower);
    }
    const float nan = std::numeric_limits<float>::quiet_NaN();
    for (const HalfSpace& odd : {HalfSpace{{0, 0, 0}, 0}, HalfSpace{{0, 0, nan}, 0}, HalfSpace{{0, 0, 1}, nan}}) {
        const SweepResult r = sweep(bodies.trees[0], motion, odd, *context);
        EXPECT_EQ(r.verdict, Verdict::undecided);
        EXPECT_EQ(r.time_lower, 0);
    }
    for (Motion odd : {motion, motion, motion}) {
        static int which = 0;
        if (which == 0) odd.linear.y = nan;
        if (which == 1) odd.start.rotation = {0, 0, 0, 0};
        if (which++ == 2) odd.angular.x = 2e6f;
        EXPECT_EQ(sweep(bodies.trees[0], odd, floor, *context).verdict, Verdict::undecided);
    }
}

} // namespace
} // namespace prolate
