// Balls, capsules and other rounded bodies: beside formulas in long double, and beside their cores with a margin.
#include "tests/exact_scenes.hpp"
#include "tests/reference.hpp"
#include "tests/scenes.hpp"
#include "tests/shapes.hpp"
#include "tests/targets.hpp"
#include "tests/threads.hpp"

#include <prolate/bounds.hpp>
#include <prolate/half_space.hpp>
#include <prolate/points.hpp>
#include <prolate/primitives.hpp>
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
using reference::operator-;
using scenes::Point;
using scenes::Random;

struct Segment {
    Vector a, b;
};
Vector on(const Segment& s, Real t) {
    return {s.a[0] + t * (s.b[0] - s.a[0]), s.a[1] + t * (s.b[1] - s.a[1]), s.a[2] + t * (s.b[2] - s.a[2])};
}
Real point_distance(const Segment& s, const Vector& p) {
    const Vector d = s.b - s.a, r = p - s.a;
    const Real square = reference::dot(d, d);
    const Real t = square > 0 ? std::clamp(reference::dot(r, d) / square, 0.0L, 1.0L) : 0;
    return reference::length(p - on(s, t));
}
// Convex in the parameter: golden sections.
template <class F> Real least(F&& f) {
    Real low = 0, high = 1;
    for (int i = 0; i < 120; ++i) {
        const Real x = low + 0.382L * (high - low), y = low + 0.618L * (high - low);
        (f(x) < f(y) ? high : low) = f(x) < f(y) ? y : x;
    }
    return std::min({f(0), f(1), f(low)});
}
Real segment_distance(const Segment& s, const Segment& t) {
    return least([&](Real x) { return point_distance(t, on(s, x)); });
}
Real box_distance(const Vec3& half, const Vector& p) { // of a point outside or inside, in the box's frame
    const Real q[] = {std::abs(p[0]) - half.x, std::abs(p[1]) - half.y, std::abs(p[2]) - half.z};
    const Vector out{std::max(q[0], 0.0L), std::max(q[1], 0.0L), std::max(q[2], 0.0L)};
    return reference::length(out);
}
Segment placed(const Pose& pose, const Vec3& a, const Vec3& b) {
    const auto at = [&](const Vec3& p) {
        const Vector r = reference::rotation(pose.rotation) * reference::vector(p);
        const Vector t = reference::vector(pose.translation);
        return Vector{r[0] + t[0], r[1] + t[1], r[2] + t[2]};
    };
    return {at(a), at(b)};
}

struct Capsules {
    struct Made {
        Vec3 a, b;
        float radius;
        Tree tree;
    };
    std::vector<Made> all;
    Capsules() {
        Random random(1);
        for (int i = 0; i < 12; ++i) {
            const Vec3 a = scenes::to_float(random.in_ball()), b = i % 3 == 0 ? a : scenes::to_float(random.in_ball());
            const auto radius = static_cast<float>(random.log_in(0.05, 2));
            all.push_back({a, b, radius, *capsule_tree(a, b, radius)});
        }
    }
};
const Capsules& capsules() {
    static const Capsules made;
    return made;
}

TEST(Rounded, CapsulesAreAsFarApartAsTheirSegmentsLessTheRadii) {
    targets::for_each([&](const char* target) {
        SCOPED_TRACE(target);
        Random random(2);
        const auto context = std::make_unique<QueryContext>();
        uint32_t meeting = 0, apart = 0;
        for (uint32_t i = 0; i < 1500; ++i) {
            const auto &x = capsules().all[i % 12], &y = capsules().all[random.below(12)];
            const Pose p = scenes::pose_at(random, random.in(0, 2)), q = scenes::pose_at(random, random.in(0, 4));
            const Real truth =
                segment_distance(placed(p, x.a, x.b), placed(q, y.a, y.b)) - Real{x.radius} - Real{y.radius};
            const Real rounding = 3e-7L * (x.radius + y.radius);
            const TreeView a = x.tree.view(), b = y.tree.view();
            const DistanceResult d = distance(a, p, b, q, *context);
            EXPECT_LE(static_cast<Real>(d.lower), std::max(0.0L, truth) + 1e-12L);
            EXPECT_GE(static_cast<Real>(d.upper), truth - 1e-12L);
            EXPECT_EQ(d.verdict, collide(a, p, b, q, *context).verdict);
            if (truth > rounding) {
                EXPECT_EQ(d.verdict, Verdict::separated) << static_cast<double>(truth);
                EXPECT_LE(d.upper - d.lower, 1.1e-6 * d.upper + 1e-12);
                const Vec3 m = d.point_a, n = d.point_b;
                const Real between = reference::length(reference::vector(m) - reference::vector(n));
                EXPECT_NEAR(static_cast<double>(between), d.upper, 3e-6);
                EXPECT_NEAR(static_cast<double>(point_distance(placed(p, x.a, x.b), reference::vector(m))), x.radius,
                            2e-6);
                ++apart;
            } else {
                EXPECT_EQ(d.verdict, Verdict::overlapping);
                ++meeting;
            }
            const DistanceResult e = distance(b, q, a, p, *context);
            EXPECT_EQ(d.verdict, e.verdict);
            EXPECT_EQ(d.upper, e.upper);
            // On a budget, what is certified holds.
            const DistanceResult poor = distance(a, p, b, q, *context, {.max_pair_tests = random.below(4)});
            EXPECT_LE(static_cast<Real>(poor.lower), std::max(0.0L, truth) + 1e-12L);
            EXPECT_GE(static_cast<Real>(poor.upper), truth - 1e-12L);
            EXPECT_TRUE(poor.verdict == Verdict::undecided || poor.verdict == d.verdict);
        }
        EXPECT_GT(meeting, 200u);
        EXPECT_GT(apart, 300u);
    });
}

TEST(Rounded, BudgetsOfDistancesAreKept) {
    Random random(7);
    const auto context = std::make_unique<QueryContext>();
    const Tree prism = *cylinder_tree(0.5f, 1, 128);
    const TreeView round = *prism.view().rounded(0.2f);
    for (uint32_t i = 0; i < 2000; ++i) {
        const Pose p = scenes::pose_at(random, 0), q = scenes::pose_at(random, random.in(1, 3));
        const uint64_t budget = random.below(400);
        const DistanceResult d =
            distance(round, p, prism.view(), q, *context, {.max_level = random.below(4), .max_pair_tests = budget});
        ASSERT_LE(d.stats.tests(), budget);
    }
}

TEST(Rounded, BallsAndBoxes) {
    const Vec3 half{0.5f, 0.7f, 0.4f};
    const auto box = *box_tree(half);
    Random random(3);
    const auto context = std::make_unique<QueryContext>();
    uint32_t touching = 0;
    for (uint32_t i = 0; i < 2000; ++i) {
        const auto r = static_cast<float>(random.log_in(0.1, 1));
        const auto ball = *capsule_tree({}, {}, r);
        const Vec3 c = scenes::to_float({random.in(-2, 2), random.in(-2, 2), random.in(-2, 2)});
        const Real core = box_distance(half, reference::vector(c)), truth = core - Real{r};
        const DistanceResult d = distance(box.view(), {}, ball.view(), {c, random.rotation()}, *context);
        EXPECT_EQ(d.verdict == Verdict::overlapping, truth <= 2e-7L * r) << static_cast<double>(truth);
        if (d.verdict == Verdict::separated) {
            EXPECT_NEAR(d.upper, static_cast<double>(truth), 1e-6 * d.upper + 1e-9);
        }
        // Contacts: along the shortest way out, as deep as that.
        ContactManifolds m;
        const ContactResult k = contacts(box.view(), {}, ball.view(), {c, {}}, m, *context);
        EXPECT_EQ(k.verdict, d.verdict);
        if (d.verdict != Verdict::overlapping || !(core > 1e-3L)) continue;
        ASSERT_GE(m.count, 1u);
        double deepest = -1;
        for (uint32_t j = 0; j < m.count; ++j)
            for (uint32_t n = 0; n < m.manifolds[j].count; ++n) {
                const ContactPoint& p = m.manifolds[j].points[n];
                deepest = std::max(deepest, double{p.depth});
                // On the ball.
                const Real away = reference::length(reference::vector(p.point_b) - reference::vector(c));
                EXPECT_NEAR(static_cast<double>(away), r, 0.05 * r); // points of a manifold share a mean normal
            }
        EXPECT_NEAR(deepest, static_cast<double>(-truth), 2e-6);
        ++touching;
    }
    EXPECT_GT(touching, 100u);
}

TEST(Rounded, ACapsuleLiesOnTwoPoints) {
    const auto floor = *box_tree({10, 10, 1});
    const auto capsule = *capsule_tree({-1, 0, 0}, {1, 0, 0}, 0.25f);
    QueryContext context;
    for (const HalfSpace* ground :
         {static_cast<const HalfSpace*>(nullptr), &std::as_const(*new HalfSpace{{0, 0, 1}, 1})}) {
        ContactManifolds m;
        const Pose pose{{0.3f, 0.2f, 1.24f}, {}};
        for (uint32_t step = 0; step < 3; ++step) {
            const ContactResult r = ground ? contacts(capsule.view(), pose, *ground, m, context)
                                           : contacts(capsule.view(), pose, floor.view(), {}, m, context);
            EXPECT_EQ(r.verdict, Verdict::overlapping);
            ASSERT_EQ(m.count, 1u);
            EXPECT_NEAR(m.manifolds[0].normal.z, -1, 1e-6);
            ASSERT_EQ(m.manifolds[0].count, 2u);
            for (uint32_t k = 0; k < 2; ++k) {
                const ContactPoint& p = m.manifolds[0].points[k];
                EXPECT_NEAR(p.depth, 0.01, 1e-6);
                EXPECT_NEAR(p.point_a.z, 0.99, 1e-6);
                EXPECT_NEAR(p.point_b.z, 1, 1e-6);
                EXPECT_NEAR(std::abs(p.point_a.x - 0.3f), 1, 1e-5);
                EXPECT_EQ(p.age, step);
            }
        }
        delete ground;
    }
}

TEST(Rounded, WhateverIsRoundedAnswersAsItsCoreWithAMargin) {
    Random random(4);
    std::vector<std::vector<std::byte>> bytes;
    bytes.push_back(scenes::exact_tree(shapes::torus(1, 0.3f, 24, 12)).bytes);
    bytes.push_back(scenes::tree(random, scenes::cloud(random, 200), {.degree = 8, .levels = 3}).bytes);
    std::vector<TreeView> cores;
    cores.reserve(bytes.size());
    for (const auto& b : bytes) cores.push_back(*TreeView::open(b));
    const auto context = std::make_unique<QueryContext>();
    uint32_t hits = 0, meeting = 0;
    for (uint32_t i = 0; i < 400; ++i) {
        const TreeView core = cores[i % 2], other = cores[i / 2 % 2];
        const float r = static_cast<float>(random.log_in(0.01, 0.5)), r2 = i % 3 == 0 ? 0 : 0.1f;
        const TreeView body = *core.rounded(r), second = *other.rounded(r2);
        const Pose p = scenes::pose_at(random, 0.5), q = scenes::pose_at(random, random.in(0, 3));
        const float margin = i % 4 == 0 ? 0.2f : 0;
        const float sum = std::nextafter(static_cast<float>(double{margin} + (double{r} + r2)), 9.0f);
        EXPECT_EQ(collide(body, p, second, q, *context, {.margin = margin}).verdict,
                  collide(core, p, other, q, *context, {.margin = sum}).verdict);
        PairCache cache;
        for (int k = 0; k < 2; ++k)
            EXPECT_EQ(collide(body, p, second, q, *context, {.margin = margin}, &cache).verdict,
                      collide(core, p, other, q, *context, {.margin = sum}).verdict);
        meeting += collide(body, p, second, q, *context).verdict == Verdict::overlapping;
        const DistanceResult d = distance(body, p, second, q, *context), e = distance(core, p, other, q, *context);
        if (d.verdict == Verdict::separated) {
            EXPECT_NEAR(d.upper, e.upper - (double{r} + r2), 3e-6 * e.upper);
        }
        const Ray ray{scenes::to_float({5, 5 * random.in(-1, 1), 0}),
                      {-1, static_cast<float>(random.in(-0.3, 0.3)), 0}};
        const RaycastResult x = raycast(body, p, ray, *context), y = raycast(core, p, ray, *context, {.margin = r});
        EXPECT_EQ(x.verdict, y.verdict);
        if (x.verdict == Verdict::overlapping) {
            EXPECT_NEAR(x.t, y.t, 1e-5);
        }
        hits += x.verdict == Verdict::overlapping;
        EXPECT_EQ(overlap(body, p, Sphere{q.translation, 0.1f}, *context).verdict,
                  overlap(core, p, Sphere{q.translation, 0.1f}, *context, {.margin = std::nextafter(r, 9.0f)}).verdict);
        Motion rest, flight;
        rest.start = p, flight.start = q, flight.start.translation.x += 6, flight.linear = {-12, 0, 0};
        const SweepResult s = sweep(body, rest, second, flight, *context, {.tolerance = 1e-4}),
                          t = sweep(core, rest, other, flight, *context,
                                    {.tolerance = 1e-4, .margin = static_cast<float>(double{r} + r2)});
        EXPECT_EQ(s.verdict, t.verdict);
        EXPECT_NEAR(s.time_lower, t.time_lower, 1e-5);
        const Bounds box = bounds(body, p), inner = bounds(core, p);
        EXPECT_NEAR(box.lower.x, inner.lower.x - r, 1e-6);
        EXPECT_NEAR(box.upper.z, inner.upper.z + r, 1e-6);
        const SignedDistance far = signed_distance(body, p, q.translation, *context),
                             near = signed_distance(core, p, q.translation, *context);
        EXPECT_EQ(far.verdict == Verdict::separated, near.lower > double{r});
        EXPECT_EQ(contains(body, p, q.translation, *context), far.verdict);
        if (far.verdict == Verdict::separated) {
            EXPECT_NEAR(far.lower, near.lower - double{r}, 1e-6);
        }
        EXPECT_GE(far.upper, near.upper - double{r} - 1e-12);
        const HalfSpace ground{{0, 1, 1}, -1.5f};
        const DistanceResult above = distance(body, p, ground, *context), of_core = distance(core, p, ground, *context);
        EXPECT_EQ(above.verdict, overlap(body, p, ground, *context).verdict);
        if (above.verdict == Verdict::separated) {
            EXPECT_NEAR(above.upper, of_core.upper - double{r}, 1e-7);
        }
        const SweepResult falls = sweep(body, flight, HalfSpace{{1, 0, 0}, -2}, *context);
        const SweepResult core_falls = sweep(core, flight, HalfSpace{{1, 0, 0}, -2 + r}, *context);
        EXPECT_EQ(falls.verdict, core_falls.verdict);
        EXPECT_NEAR(falls.time_lower, core_falls.time_lower, 1e-3);
    }
    EXPECT_GT(hits, 30u);
    EXPECT_GT(meeting, 80u);
}

TEST(Rounded, DistancesLookNoDeeperThanVerdicts) {
    Random random(12);
    const auto torus = scenes::exact_tree(shapes::torus(1, 0.3f, 24, 12));
    const TreeView tree = *TreeView::open(torus.bytes)->rounded(0.05f);
    const auto context = std::make_unique<QueryContext>();
    const HalfSpace ground{{0, 0, 1}, 0};
    uint32_t not_separated = 0, seldom = 0;
    // Apart by the bound on the distance, or because the coarse verdict says so.
    const auto looked_deeper = [](const DistanceResult& d) {
        return d.verdict == Verdict::separated && d.lower <= std::numeric_limits<double>::min();
    };
    for (int i = 0; i < 600; ++i) {
        const Pose p = scenes::pose_at(random, 0.5), q = scenes::pose_at(random, random.in(1.5, 3));
        for (const uint32_t level : {0u, 1u}) {
            const QueryOptions coarse{.max_level = level};
            const DistanceOptions as_coarse{.max_level = level};
            if (collide(tree, p, tree, q, *context, coarse).verdict != Verdict::separated) {
                ++not_separated;
                seldom += collide(tree, p, tree, q, *context).verdict == Verdict::separated;
                EXPECT_FALSE(looked_deeper(distance(tree, p, tree, q, *context, as_coarse)));
            }
            if (overlap(tree, q, ground, *context, coarse).verdict != Verdict::separated) {
                ++not_separated;
                seldom += overlap(tree, q, ground, *context).verdict == Verdict::separated;
                EXPECT_FALSE(looked_deeper(distance(tree, q, ground, *context, as_coarse)));
            }
        }
    }
    EXPECT_GT(not_separated, 100u);
    EXPECT_GT(seldom, 20u); // where a deeper look would have said more
}

// The tolerance is a share of what the radii leave of the distance of the cores; and what a level says holds at all.
TEST(Rounded, DistancesAreAsTightAsAsked) {
    Random random(21);
    const auto torus = scenes::exact_tree(shapes::torus(1, 0.3f, 24, 12)),
               ball = scenes::exact_tree(shapes::icosphere(2));
    const TreeView a = *TreeView::open(torus.bytes)->rounded(0.3f), b = *TreeView::open(ball.bytes)->rounded(0.2f);
    const auto context = std::make_unique<QueryContext>();
    uint32_t apart = 0, limited = 0;
    for (int i = 0; i < 600; ++i) {
        const Pose p = scenes::pose_at(random, 0), q = scenes::pose_at(random, random.in(1.5, 4));
        const DistanceResult exact = distance(a, p, b, q, *context);
        if (exact.verdict != Verdict::separated) continue;
        ++apart;
        for (const double share : {0.5, 0.05, 1e-3, 1e-6}) {
            const DistanceResult d = distance(a, p, b, q, *context, {.tolerance_relative = share});
            EXPECT_EQ(d.verdict, Verdict::separated);
            EXPECT_LE(d.upper - d.lower, share * d.upper + 1e-8);
            EXPECT_LE(d.lower, exact.upper);
            EXPECT_GE(d.upper, exact.lower);
        }
        for (const uint32_t level : {0u, 1u, 2u}) {
            const DistanceResult d = distance(a, p, b, q, *context, {.max_level = level});
            EXPECT_NE(d.verdict, Verdict::overlapping);
            limited += d.verdict == Verdict::undecided;
        }
    }
    EXPECT_GT(apart, 100u);
    EXPECT_GT(limited, 20u);
}

TEST(Rounded, WorldsOfBallsAndCapsules) {
    Random random(5);
    World world = *World::create();
    std::vector<Pose> poses;
    for (uint32_t i = 0; i < 80; ++i) {
        poses.push_back(scenes::pose_at(random, random.in(0, 8)));
        ASSERT_TRUE(world.insert({.shape = capsules().all[i % 12].tree.view(), .pose = poses.back()}));
    }
    ASSERT_TRUE(world.insert({.shape = HalfSpace{{0, 0, 1}, -2}, .pose = {}}));
    ASSERT_TRUE(world.update_pairs());
    std::vector<QueryContext> contexts(2);
    std::vector<DistanceResult> results(world.pairs().size());
    ASSERT_TRUE(distance(world, world.pairs(), results, {contexts, thread_jobs(2)}));
    uint32_t meeting = 0, expected = 0;
    for (const DistanceResult& r : results) meeting += r.verdict == Verdict::overlapping;
    for (uint32_t i = 0; i < 80; ++i) {
        const auto& x = capsules().all[i % 12];
        const Segment s = placed(poses[i], x.a, x.b);
        expected += std::min(s.a[2], s.b[2]) - Real{x.radius} <= -2;
        for (uint32_t j = i + 1; j < 80; ++j) {
            const auto& y = capsules().all[j % 12];
            expected += segment_distance(s, placed(poses[j], y.a, y.b)) <= Real{x.radius} + Real{y.radius};
        }
    }
    EXPECT_EQ(meeting, expected);
    EXPECT_GT(meeting, 50u);
    // A ball flies through: it meets no earlier than its core within the radius, and a ray hits where the formula says.
    const Ray ray{{20, 0, 30}, {-0.5f, 0, -1}};
    RayHit hit;
    ASSERT_TRUE(raycast(world, {&ray, 1}, {&hit, 1}, {contexts}));
    ASSERT_EQ(hit.result.verdict, Verdict::overlapping);
    if (const TreeView* const tree = world.find(hit.body)->tree()) {
        const auto& x = capsules().all[hit.body.index % 12];
        EXPECT_EQ(tree->radius(), x.radius);
        const Real away = point_distance(placed(poses[hit.body.index], x.a, x.b), reference::vector(hit.result.point));
        EXPECT_NEAR(static_cast<double>(away), x.radius, 1e-5);
    }
}

TEST(Rounded, RefusesWhatIsNoRadius) {
    const auto box = *box_tree({1, 1, 1});
    const float infinity = std::numeric_limits<float>::infinity();
    for (const float bad : {-1.0f, infinity, std::numeric_limits<float>::quiet_NaN(), 0x1p80f})
        EXPECT_EQ(box.view().rounded(bad).error().code, ErrorCode::bad_options) << bad;
    for (const float bad : {0.0f, -1.0f, infinity, std::numeric_limits<float>::quiet_NaN()})
        EXPECT_EQ(capsule_tree({}, {1, 0, 0}, bad).error().code, ErrorCode::bad_options) << bad;
    EXPECT_FALSE(capsule_tree({infinity, 0, 0}, {1, 0, 0}, 1));
    EXPECT_EQ(box.view().rounded(2)->radius(), 2);
    EXPECT_EQ(box.view().rounded(2)->scaled(3)->radius(), 2);
    EXPECT_EQ(box.view().radius(), 0);
}

} // namespace
} // namespace prolate
