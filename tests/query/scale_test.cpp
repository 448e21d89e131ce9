// Scaled views: beside copies of the trees whose numbers were scaled, and beside all corners and ellipsoids in long
// double. Nothing that touches may be separated.
#include "tests/exact_scenes.hpp"
#include "tests/reference.hpp"
#include "tests/scenes.hpp"
#include "tests/shapes.hpp"
#include "tests/targets.hpp"
#include "tests/threads.hpp"

#include <prolate/bounds.hpp>
#include <prolate/half_space.hpp>
#include <prolate/points.hpp>
#include <prolate/world_queries.hpp>

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
using scenes::Point;
using scenes::Random;

struct Trees {
    std::vector<std::vector<std::byte>> bytes;
    std::vector<TreeView> all;
    Trees() {
        Random random(3);
        bytes.push_back(scenes::exact_tree(shapes::torus(1, 0.3f, 24, 12)).bytes);
        bytes.push_back(scenes::exact_tree(shapes::box(0.5f, 0.7f, 0.4f)).bytes);
        bytes.push_back(scenes::exact_tree(shapes::sheet(2, 2, 8), {.closed = false}).bytes);
        bytes.push_back(scenes::tree(random, scenes::cloud(random, 200), {.degree = 8, .levels = 3}).bytes);
        for (const auto& b : bytes) all.push_back(*TreeView::open(b));
    }
};
const Trees& trees() {
    static const Trees made;
    return made;
}
Vec3 times(float s, const Vec3& v) {
    return {s * v.x, s * v.y, s * v.z};
}
Pose times(float s, const Pose& pose) {
    return {times(s, pose.translation), pose.rotation};
}
constexpr float kScales[] = {0.3f, 0.7312345f, 1.9f, 17.77f, 1e-3f};

TEST(Scale, APowerOfTwoChangesLengthsAndNothingElse) {
    Random random(1);
    QueryContext context;
    uint32_t meeting = 0;
    for (uint32_t i = 0; i < 300; ++i) {
        const float s = i % 2 == 0 ? 8.0f : 0.125f;
        const TreeView a = trees().all[i % 4], b = trees().all[i / 4 % 4];
        const TreeView large_a = *a.scaled(s), large_b = *b.scaled(s);
        const Pose p, q = scenes::pose_at(random, random.in(0, 2.5));
        const auto small = collide(a, p, b, q, context);
        const auto large = collide(large_a, p, large_b, times(s, q), context);
        EXPECT_EQ(small.verdict, large.verdict);
        EXPECT_EQ(small.pair, large.pair);
        EXPECT_EQ(small.stats.tests(), large.stats.tests());
        meeting += small.verdict == Verdict::overlapping;
        const DistanceResult d = distance(a, p, b, q, context), e = distance(large_a, p, large_b, times(s, q), context);
        EXPECT_EQ(double{s} * d.lower, e.lower);
        EXPECT_EQ(double{s} * d.upper, e.upper);
        ContactManifolds m, n;
        (void)contacts(a, p, b, q, m, context), (void)contacts(large_a, p, large_b, times(s, q), n, context);
        ASSERT_EQ(m.count, n.count);
        for (uint32_t k = 0; k < m.count; ++k) {
            EXPECT_EQ(m.manifolds[k].normal, n.manifolds[k].normal);
            EXPECT_EQ(s * m.manifolds[k].points[0].depth, n.manifolds[k].points[0].depth);
        }
        const Bounds box = bounds(a, q), larger = bounds(large_a, times(s, q));
        EXPECT_EQ(times(s, box.lower), larger.lower);
        EXPECT_EQ(times(s, box.upper), larger.upper);
    }
    EXPECT_GT(meeting, 80u);
    EXPECT_LT(meeting, 220u);
}

// Corners of an exact tree in the world, or the deepest points of ellipsoids along n.
Vector in_world(const TreeView& tree, const Pose& pose, const Vector& stored) {
    const Real s = tree.scale();
    const Vector r = reference::rotation(pose.rotation) * Vector{s * stored[0], s * stored[1], s * stored[2]},
                 t = reference::vector(pose.translation);
    return {r[0] + t[0], r[1] + t[1], r[2] + t[2]};
}
std::vector<Vector> points_of(const TreeView& tree, const Pose& pose, Random& random, uint32_t count) {
    std::vector<Vector> out;
    std::vector<uint32_t> leaves;
    tree.for_each_in_cut(tree.level_count() - 1, [&](uint32_t slot) {
        if (tree.is_leaf(slot)) leaves.push_back(slot);
    });
    for (uint32_t i = 0; i < count; ++i) {
        if (tree.has_triangles()) { // a point of a triangle
            const Triangle t = tree.triangle(random.below(tree.triangle_count()));
            const Vector a = reference::vector(tree.vertex(t[0])), b = reference::vector(tree.vertex(t[1])),
                         c = reference::vector(tree.vertex(t[2]));
            Real u = random.unit(), v = random.unit();
            if (u + v > 1) u = 1 - u, v = 1 - v;
            const auto at = [&](size_t k) { return a[k] + u * (b[k] - a[k]) + v * (c[k] - a[k]); };
            out.push_back(in_world(tree, pose, {at(0), at(1), at(2)}));
        } else { // or inside an ellipsoid
            const Ellipsoid e = tree.ellipsoid(leaves[random.below(static_cast<uint32_t>(leaves.size()))]);
            const Point u = random.in_ball();
            out.push_back(
                in_world(tree, pose,
                         {e.center.x + Real{e.l11} * u[0], e.center.y + Real{e.l21} * u[0] + Real{e.l22} * u[1],
                          e.center.z + Real{e.l31} * u[0] + Real{e.l32} * u[1] + Real{e.l33} * u[2]}));
        }
    }
    return out;
}

TEST(Scale, BoundsPointsAndPlanesHoldAllThatIsScaled) {
    targets::for_each([&](const char* target) {
        SCOPED_TRACE(target);
        Random random(2);
        const auto context = std::make_unique<QueryContext>();
        for (uint32_t i = 0; i < 200; ++i) {
            const TreeView tree = *trees().all[i % 4].scaled(kScales[i % 5]);
            const double size = tree.scale();
            const Pose pose = scenes::pose_at(random, size * random.in(0, 20));
            const Bounds box = bounds(tree, pose);
            const Point n = random.direction();
            const HalfSpace ground{scenes::to_float(n), static_cast<float>(size * random.in(-25, 25))};
            const DistanceResult above = distance(tree, pose, ground, *context);
            const Real length = reference::length(reference::vector(ground.normal));
            const Vec3 from = scenes::to_float({pose.translation.x + 3 * size * random.in(-1, 1),
                                                pose.translation.y + 3 * size * random.in(-1, 1),
                                                pose.translation.z + 3 * size * random.in(-1, 1)});
            const SignedDistance away = signed_distance(tree, pose, from, *context);
            Real nearest = 1e30L;
            for (const Vector& p : points_of(tree, pose, random, 200)) {
                EXPECT_TRUE(p[0] >= box.lower.x && p[0] <= box.upper.x && p[1] >= box.lower.y && p[1] <= box.upper.y &&
                            p[2] >= box.lower.z && p[2] <= box.upper.z);
                const Real height = reference::dot(reference::vector(ground.normal), p) / length - Real{ground.offset};
                EXPECT_TRUE(above.lower == 0 || height >= static_cast<Real>(above.lower));
                const Real d[] = {p[0] - from.x, p[1] - from.y, p[2] - from.z};
                nearest = std::min(nearest, std::sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]));
            }
            if (away.verdict == Verdict::separated) {
                EXPECT_LE(static_cast<Real>(away.lower), nearest);
                EXPECT_LE(away.upper - away.lower, 1e-6 * size);
                EXPECT_LE(away.upper, static_cast<double>(nearest) * 1.5 + size);
            }
            // Within one percent of its size, as unscaled boxes are.
            const Bounds unscaled = bounds(trees().all[i % 4], {{}, pose.rotation});
            EXPECT_NEAR(box.upper.x - box.lower.x, size * (unscaled.upper.x - unscaled.lower.x),
                        0.02 * size * (unscaled.upper.x - unscaled.lower.x) + 1e-5 * std::abs(pose.translation.x));
        }
    });
}

// Bodies that share a point of their solids, one of each pair scaled otherwise than the other, are never separated.
TEST(Scale, WhatSharesAPointIsNeverSeparated) {
    targets::for_each([&](const char* target) {
        SCOPED_TRACE(target);
        Random random(3);
        const auto context = std::make_unique<QueryContext>();
        uint32_t decided = 0;
        for (uint32_t i = 0; i < 600; ++i) {
            const TreeView a = *trees().all[i % 4].scaled(kScales[random.below(4)]),
                           b = *trees().all[i / 4 % 4].scaled(kScales[random.below(4)]);
            Pose p{{}, random.rotation()}, q{{}, random.rotation()};
            const Vector at = points_of(a, p, random, 1)[0], to = points_of(b, q, random, 1)[0];
            q.translation = scenes::to_float({static_cast<double>(at[0] - to[0]), static_cast<double>(at[1] - to[1]),
                                              static_cast<double>(at[2] - to[2])});
            // What rounding the translation to floats has moved apart is within the margin.
            const float margin = 1e-6f * (a.scale() + b.scale());
            const QueryOptions options{.margin = margin};
            EXPECT_NE(collide(a, p, b, q, *context, options).verdict, Verdict::separated) << i;
            PairCache cache;
            EXPECT_NE(collide(a, p, b, q, *context, options, &cache).verdict, Verdict::separated);
            EXPECT_EQ(collide(a, p, b, q, *context, options).verdict, collide(b, q, a, p, *context, options).verdict);
            const DistanceResult d = distance(a, p, b, q, *context);
            EXPECT_LE(d.lower, double{margin});
            ContactManifolds m;
            EXPECT_NE(contacts(a, p, b, q, m, *context, options).verdict, Verdict::separated);
            const Vec3 point =
                scenes::to_float({static_cast<double>(at[0]), static_cast<double>(at[1]), static_cast<double>(at[2])});
            EXPECT_NE(overlap(a, p, Sphere{point, margin}, *context).verdict, Verdict::separated);
            const Point away = random.direction();
            const Vec3 start = scenes::to_float({point.x + 9 * away[0], point.y + 9 * away[1], point.z + 9 * away[2]});
            const Ray ray{start, {point.x - start.x, point.y - start.y, point.z - start.z}};
            EXPECT_NE(raycast(a, p, ray, *context, {.margin = 4e-6f * (1 + a.scale())}).verdict, Verdict::separated);
            Motion ma, mb;
            ma.start = p, mb.start = q, mb.start.translation.x += 50, mb.linear = {-100, 0, 0};
            EXPECT_NE(sweep(a, ma, b, mb, *context, {.margin = 1e-4f}).verdict, Verdict::separated);
            ++decided;
        }
        EXPECT_EQ(decided, 600u);
    });
}

// Beside a tree made of scaled numbers: the same mesh but for the rounding of its vertices.
TEST(Scale, AgreesWithTreesMadeOfScaledMeshes) {
    Random random(4);
    QueryContext context;
    for (const float s : kScales) {
        auto mesh = shapes::torus(1, 0.3f, 24, 12);
        for (Vec3& v : mesh.vertices) v = times(s, v);
        const auto made = scenes::exact_tree(mesh);
        const TreeView scaled = *trees().all[0].scaled(s), baked = *TreeView::open(made.bytes), other = trees().all[1];
        for (uint32_t i = 0; i < 100; ++i) {
            const Pose p = scenes::pose_at(random, random.in(0.5, 2) * std::max(1.0f, s)), q;
            const double lengths = 1 + 2 * double{s};
            const DistanceResult d = distance(scaled, p, other, q, context), e = distance(baked, p, other, q, context);
            EXPECT_LE(d.lower, e.upper + 1e-6 * lengths);
            EXPECT_LE(e.lower, d.upper + 1e-6 * lengths);
            EXPECT_LE(d.upper - d.lower, 2e-6 * d.upper + 1e-7 * lengths);
            const SignedDistance x = signed_distance(scaled, p, {0.1f, 0.2f, 0.3f}, context),
                                 y = signed_distance(baked, p, {0.1f, 0.2f, 0.3f}, context);
            EXPECT_EQ(x.verdict, y.verdict);
            EXPECT_NEAR(x.upper, y.upper, 1e-6 * lengths);
        }
    }
}

TEST(Scale, WorldsTakeScaledTreesAsTheyTakeOthers) {
    Random random(5);
    World world = *World::create();
    std::vector<BodyId> ids;
    for (uint32_t i = 0; i < 60; ++i) {
        const Part parts[] = {{*trees().all[(i + 1) % 4].scaled(kScales[i % 3]), scenes::pose_at(random, 1)}};
        ids.push_back(*world.insert({.shape = *trees().all[i % 4].scaled(kScales[(i + 1) % 3]),
                                     .pose = scenes::pose_at(random, random.in(0, 5))},
                                    i % 2 == 0 ? std::span<const Part>(parts) : std::span<const Part>()));
    }
    std::vector<QueryContext> contexts(3);
    uint32_t meeting = 0;
    for (uint32_t step = 0; step < 5; ++step) {
        for (const BodyId id : ids) ASSERT_TRUE(world.move(id, scenes::pose_at(random, random.in(0, 5))));
        ASSERT_TRUE(world.update_pairs());
        std::vector<Verdict> verdicts(world.pairs().size());
        ASSERT_TRUE(collide(world, world.pairs(), verdicts, {contexts, thread_jobs(3)}));
        uint32_t listed = 0, all = 0;
        for (size_t i = 0; i < verdicts.size(); ++i) listed += verdicts[i] == Verdict::overlapping;
        for (uint32_t i = 0; i < 90; ++i) // indices are given in order, and generations begin with 1
            for (uint32_t j = i + 1; j < 90; ++j) {
                const Body *a = world.find({i, 1}), *b = world.find({j, 1});
                ASSERT_TRUE(a && b);
                if (world.body_of({i, 1}) == world.body_of({j, 1})) continue;
                all += collide(*a->tree(), a->pose, *b->tree(), b->pose, contexts[0]).verdict == Verdict::overlapping;
            }
        EXPECT_EQ(listed, all);
        meeting += all;
    }
    EXPECT_GT(meeting, 100u);
}

TEST(Scale, RefusesWhatTheFormatCouldNotHold) {
    const TreeView tree = trees().all[0];
    const float infinity = std::numeric_limits<float>::infinity();
    for (const float bad :
         {0.0f, -1.0f, infinity, -infinity, std::numeric_limits<float>::quiet_NaN(), 0x1p80f, 0x1p-120f})
        EXPECT_EQ(tree.scaled(bad).error().code, ErrorCode::bad_options) << bad;
    EXPECT_EQ(tree.scaled(3)->scale(), 3);
    EXPECT_EQ(tree.scaled(3)->scaled(2)->scale(), 2); // of the tree as stored
    EXPECT_EQ(tree.scaled(3)->vertex(5), tree.vertex(5));
    EXPECT_EQ(tree.scale(), 1);
}

} // namespace
} // namespace prolate
