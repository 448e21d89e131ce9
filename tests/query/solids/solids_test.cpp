// Solids by their covers from outside and inside, against exact trees of the same meshes.
#include "tests/builder/bakes.hpp"
#include "tests/scenes.hpp"
#include "tests/shapes.hpp"

#include <prolate/collide.hpp>
#include <prolate/primitives.hpp>
#include <prolate/solids.hpp>
#include <prolate/world_queries.hpp>

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <vector>

namespace prolate {
namespace {

using scenes::Random;

// A solid three times: covers, triangles, and triangles with an inner cover.
struct Baked {
    explicit Baked(const Mesh& mesh)
        : covers(bake(mesh, false, 24)), exact(bake(mesh, true, 0)), exact_with_inner(bake(mesh, true, 24)) {}
    static Tree bake(const Mesh& mesh, bool exact, uint32_t inner) {
        BuildOptions options = quick(0);
        options.exact = exact, options.inner = inner;
        if (!exact) options.ellipsoids = 24;
        return std::move(must_build(mesh, options).tree);
    }
    Tree covers, exact, exact_with_inner;
};
Mesh cross() {
    Mesh mesh = shapes::box(1, 0.2f, 0.3f);
    shapes::append(mesh, shapes::moved(shapes::box(0.25f, 0.9f, 0.2f), {0.4f, 0, 0.1f}));
    return mesh;
}
const Baked& torus() {
    static const Baked solid(shapes::torus(1, 0.3f, 24, 12));
    return solid;
}
const Baked& crossed() {
    static const Baked solid(cross());
    return solid;
}

Pose near_pose(Random& random) {
    const auto d = random.direction();
    const double r = random.in(0.2, 2.2);
    return {{static_cast<float>(r * d[0]), static_cast<float>(r * d[1]), static_cast<float>(r * d[2])},
            random.rotation()};
}

class Solids : public testing::Test {
protected:
    std::unique_ptr<QueryContext> context_ = std::make_unique<QueryContext>();
    QueryContext& context() { return *context_; }
};

static_assert(noexcept(collide(std::declval<Solid>(), Pose{}, std::declval<Solid>(), Pose{},
                               std::declval<QueryContext&>())));

TEST_F(Solids, CoversNeverContradictTriangles) {
    Random random(1);
    uint32_t counts[3] = {};
    for (int i = 0; i < 3000; ++i) {
        const Pose a{{}, random.rotation()}, b = near_pose(random);
        const auto exact = collide(torus().exact.view(), a, crossed().exact.view(), b, context()).verdict;
        const uint32_t level = i % 4u == 3 ? kMaxLevels : static_cast<uint32_t>(i) % 4u;
        const Solid x(torus().covers.view(), level), y(crossed().covers.view(), level);
        const SolidsResult found = collide(x, a, y, b, context());
        if (found.verdict != Verdict::undecided) {
            ASSERT_EQ(found.verdict, exact) << i;
        }
        EXPECT_FALSE(found.out_of_budget);
        if (level == kMaxLevels) ++counts[static_cast<int>(found.verdict)];
        EXPECT_EQ(collide(y, b, x, a, context()).verdict, found.verdict);
        // Triangles decide everything, with inner covers or without, and against covers as far as these do.
        const Solid with_inner(torus().exact_with_inner.view()), other_with_inner(crossed().exact_with_inner.view());
        EXPECT_EQ(collide(with_inner, a, other_with_inner, b, context()).verdict, exact);
        const Solid without(torus().exact.view()), other_without(crossed().exact.view());
        EXPECT_EQ(collide(without, a, other_without, b, context()).verdict, exact);
        const Verdict mixed = collide(without, a, y, b, context()).verdict;
        if (mixed != Verdict::undecided) {
            ASSERT_EQ(mixed, exact) << i;
        }
    }
    EXPECT_GT(counts[0], 100u); // all three happen
    EXPECT_GT(counts[1], 100u);
    EXPECT_GT(counts[2], 20u);
    EXPECT_LT(counts[2], 350u);
}

TEST_F(Solids, DistancesOfTrianglesLieBetweenTheBounds) {
    Random random(2);
    double width = 0, coarse_width = 0;
    for (int i = 0; i < 600; ++i) {
        const Pose a{{}, random.rotation()}, b = near_pose(random);
        const DistanceResult exact = distance(torus().exact.view(), a, crossed().exact.view(), b, context());
        const Solid x(torus().covers.view()), y(crossed().covers.view());
        for (const uint32_t level : {0u, 1u, kMaxLevels}) {
            const Solid coarse_x(torus().covers.view(), level), coarse_y(crossed().covers.view(), level);
            const SolidsDistance found = distance(coarse_x, a, coarse_y, b, context(), {.tolerance_relative = 1e-3});
            ASSERT_LE(found.lower, exact.upper + 1e-6) << i;
            ASSERT_GE(found.upper, exact.lower - 1e-6) << i;
            ASSERT_LE(found.lower, found.upper);
            EXPECT_EQ(found.verdict == Verdict::separated, found.lower > 0);
            EXPECT_EQ(found.verdict == Verdict::overlapping, found.upper == 0);
            if (found.upper > 0) {
                const auto apart = [](float p, float q) { return double{p} - double{q}; };
                const Vec3 p = found.point_a, q = found.point_b;
                EXPECT_NEAR(std::hypot(apart(p.x, q.x), apart(p.y, q.y), apart(p.z, q.z)), found.upper, 1e-5);
            }
            if (level == 0) coarse_width += found.upper - found.lower;
            if (level == kMaxLevels) width += found.upper - found.lower;
        }
        const SolidsDistance both =
            distance(Solid(torus().exact.view()), a, Solid(crossed().exact.view()), b, context());
        EXPECT_EQ(both.lower, exact.lower);
        EXPECT_EQ(both.upper, exact.upper);
        const SolidsDistance far = distance(x, a, y, b, context(), {.max_distance = 0.01});
        ASSERT_LE(far.lower, exact.upper + 1e-6);
        ASSERT_GE(far.upper, exact.lower - 1e-6);
    }
    EXPECT_LT(width, 0.5 * coarse_width);
}

TEST_F(Solids, MarginsScalesAndRadii) {
    Random random(3);
    uint32_t decided = 0;
    for (int i = 0; i < 600; ++i) {
        const Pose a{{}, random.rotation()};
        Pose b = near_pose(random);
        const float margin = static_cast<float>(random.in(0, 0.3)), scale = static_cast<float>(random.in(0.5, 2));
        const float radius = static_cast<float>(random.in(0, 0.2));
        const auto changed = [&](const Tree& tree) { return *tree.view().scaled(scale)->rounded(radius); };
        for (float* x : {&b.translation.x, &b.translation.y, &b.translation.z}) *x *= scale;
        const auto exact = collide(changed(torus().exact), a, crossed().exact.view(), b, context(), {.margin = margin});
        const auto found = collide(Solid(changed(torus().covers)), a, Solid(crossed().covers.view()), b, context(),
                                   {.margin = margin});
        if (found.verdict == Verdict::undecided) continue;
        ++decided;
        ASSERT_EQ(found.verdict, exact.verdict) << i;
    }
    EXPECT_GT(decided, 400u);
}

TEST_F(Solids, UncertainPosesMayBeOffByThatMuch) {
    Random random(5);
    uint32_t decided = 0, fewer = 0;
    for (int i = 0; i < 600; ++i) {
        const Pose a{{}, random.rotation()}, b = near_pose(random);
        const float off = static_cast<float>(random.in(0, 0.02)), margin = i % 2 ? 0.0f : 0.03f;
        const Solid x(torus().covers.view()), y(crossed().covers.view());
        const auto found = collide(x, a, y, b, context(), {.margin = margin, .uncertainty = off});
        if (found.verdict == Verdict::undecided) {
            fewer += collide(x, a, y, b, context(), {.margin = margin}).verdict != Verdict::undecided;
            continue;
        }
        ++decided;
        Pose moved = b;
        const auto d = random.direction();
        moved.translation.x += off * static_cast<float>(0.999 * d[0]);
        moved.translation.y += off * static_cast<float>(0.999 * d[1]);
        moved.translation.z += off * static_cast<float>(0.999 * d[2]);
        ASSERT_EQ(
            found.verdict,
            collide(torus().exact.view(), a, crossed().exact.view(), moved, context(), {.margin = margin}).verdict)
            << i;
    }
    EXPECT_GT(decided, 300u);
    EXPECT_GT(fewer, 5u);
}

TEST_F(Solids, WithoutInnerCoversNothingCertainlyMeets) {
    BuildOptions options = quick(0);
    options.ellipsoids = 24;
    const Build plain = must_build(shapes::torus(1, 0.3f, 24, 12), options);
    const Pose here;
    const Solid without(plain.tree.view());
    for (const Solid& other : {without, Solid(torus().covers.view())}) {
        EXPECT_EQ(collide(without, here, other, here, context()).verdict, Verdict::undecided);
        const SolidsDistance d = distance(without, here, other, here, context());
        EXPECT_EQ(d.verdict, Verdict::undecided);
        EXPECT_EQ(d.lower, 0);
        EXPECT_EQ(d.upper, std::numeric_limits<double>::infinity());
    }
    const Pose far{{10, 0, 0}, {}};
    EXPECT_EQ(collide(without, here, without, far, context()).verdict, Verdict::separated);
}

TEST_F(Solids, PrefixesOfExactTreesAreNoSolids) {
    const Solid prefix(torus().exact.view().coarser(1)), other(crossed().covers.view());
    const Pose here, far{{100, 0, 0}, {}};
    EXPECT_EQ(collide(prefix, here, other, far, context()).verdict, Verdict::undecided);
    EXPECT_EQ(distance(prefix, here, other, far, context()).verdict, Verdict::undecided);
}

TEST_F(Solids, BudgetsAndBadPosesClaimNothingWrong) {
    Random random(4);
    const Solid x(torus().covers.view()), y(crossed().covers.view());
    int with_both = 0;
    for (int i = 0; i < 300; ++i) {
        const Pose a{{}, random.rotation()}, b = near_pose(random);
        const SolidsResult whole = collide(x, a, y, b, context());
        SolidsDistance before;
        for (const uint64_t budget : {0u, 1u, 20u, 60u, 200u, 1000u}) {
            const SolidsResult part = collide(x, a, y, b, context(), {.max_pair_tests = budget});
            EXPECT_LE(part.stats.tests(), budget);
            EXPECT_TRUE(part.verdict == whole.verdict || part.verdict == Verdict::undecided);
            if (part.verdict != whole.verdict) {
                EXPECT_TRUE(part.out_of_budget);
            }
            const SolidsDistance d = distance(x, a, y, b, context(), {.max_pair_tests = budget});
            EXPECT_LE(d.stats.tests(), budget);
            EXPECT_LE(d.lower, d.upper);
            EXPECT_GE(d.lower, before.lower); // more only narrows the bounds
            EXPECT_LE(d.upper, before.upper);
            EXPECT_TRUE(before.verdict == Verdict::undecided || d.verdict == before.verdict);
            with_both += budget == 60 && d.upper < HUGE_VAL && (d.lower > 0 || d.upper == 0);
            before = d;
        }
    }
    EXPECT_GT(with_both, 100);
    const float nan = std::numeric_limits<float>::quiet_NaN();
    for (const Pose& bad : {Pose{{nan, 0, 0}, {}}, Pose{{}, {0, 0, 0, 0}}})
        for (const Solid& other : {y, Solid(crossed().exact.view())}) {
            EXPECT_EQ(collide(x, bad, other, {}, context()).verdict, Verdict::undecided);
            EXPECT_EQ(collide(other, {}, x, bad, context()).verdict, Verdict::undecided);
            const SolidsDistance d = distance(x, bad, other, {}, context());
            EXPECT_EQ(d.verdict, Verdict::undecided);
            EXPECT_EQ(d.lower, 0);
            EXPECT_EQ(d.upper, std::numeric_limits<double>::infinity());
        }
}

// collide() of triangles and ellipsoids 1e-8 of their size cannot tell gaps of a quarter of the ellipsoid: these meet,
// but not certainly.
TEST_F(Solids, TinyCoversMeetTrianglesOnlyWhereThatIsCertain) {
    Random random(5);
    const Vec3 corners[] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    const Triangle faces[] = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2}};
    const Tree corner = *convex_tree(corners, faces);
    for (const float size : {1e-2f, 1e-8f, 1e-11f}) {
        const TreeView tiny = *torus().covers.view().scaled(size), exact = *torus().exact.view().scaled(size);
        int meet = 0;
        for (int i = 0; i < 300; ++i) {
            const Pose pose{{}, random.rotation()};
            if (collide(Solid(corner.view()), {}, Solid(tiny), pose, context()).verdict != Verdict::overlapping)
                continue;
            ++meet;
            ASSERT_NE(collide(corner.view(), {}, exact, pose, context()).verdict, Verdict::separated) << size;
        }
        EXPECT_GT(meet, 150) << size;
    }
}

TEST_F(Solids, CoversWithinTrianglesMeetThemUnlessTheyMayBeDisplacedBeyondThem) {
    const Solid tiny(*torus().covers.view().scaled(0.05f)), around(crossed().exact.view());
    const auto verdict = [&](float uncertainty) {
        return collide(tiny, {}, around, {}, context(), {.uncertainty = uncertainty}).verdict;
    };
    EXPECT_EQ(verdict(0), Verdict::overlapping);
    EXPECT_EQ(verdict(1e-6f), Verdict::overlapping);
    EXPECT_EQ(verdict(1), Verdict::undecided);
}

TEST_F(Solids, LargerMarginsStayCertain) {
    Random random(6);
    const Solid x(torus().covers.view()), y(crossed().covers.view());
    for (int i = 0; i < 1000; ++i) {
        const Pose a{{}, random.rotation()}, b = near_pose(random);
        const auto uncertainty = static_cast<float>(random.log_in(1e-3, 0.1));
        const auto verdict = [&](float margin) {
            return collide(x, a, y, b, context(), {.margin = margin, .uncertainty = uncertainty}).verdict;
        };
        const float margin = uncertainty * static_cast<float>(random.in(1, 3));
        ASSERT_TRUE(verdict(0) != Verdict::overlapping || verdict(margin) == Verdict::overlapping) << i;
    }
}

TEST_F(Solids, ScratchOfTheSizeThatIsNamedSuffices) {
    const Solid x(torus().covers.view()), y(crossed().covers.view());
    std::vector<std::byte> memory(scratch_size(torus().covers.view(), crossed().covers.view()));
    const Pose here, off{{0.8f, 0, 0}, {}};
    EXPECT_EQ(collide(x, here, y, off, Scratch(memory)).verdict, collide(x, here, y, off, context()).verdict);
    EXPECT_EQ(collide(x, here, y, off, Scratch(std::span(memory).first(64))).verdict, Verdict::undecided);
}

// Sizes of 1 : 1e23: the order of the bodies must not decide what rounding leaves open.
TEST_F(Solids, ChangingPlacesChangesNothing) {
    Random random(7);
    uint32_t decided = 0;
    for (int i = 0; i < 4000; ++i) {
        const auto scale = static_cast<float>(random.log_in(1e-11, 1e11)), other_scale = i % 2 ? scale : 1 / scale;
        const auto radius = static_cast<float>(i % 3 == 0 ? random.in(0, 0.2) * double{scale} : 0);
        const Solid x(*torus().covers.view().scaled(scale)->rounded(radius)),
            y(*crossed().covers.view().scaled(other_scale));
        const Pose a{{}, random.rotation()};
        Pose b = near_pose(random);
        for (float* t : {&b.translation.x, &b.translation.y, &b.translation.z}) *t *= std::max(scale, other_scale);
        const SolidsOptions options{.margin = i % 5 == 0 ? 0.1f * scale : 0,
                                    .uncertainty = i % 7 == 0 ? 1e-3f * scale : 0};
        const Verdict verdict = collide(x, a, y, b, context(), options).verdict;
        ASSERT_EQ(collide(y, b, x, a, context(), options).verdict, verdict) << i;
        decided += verdict != Verdict::undecided;
        const SolidsDistance d = distance(x, a, y, b, context()), back = distance(y, b, x, a, context());
        ASSERT_EQ(d.verdict, back.verdict) << i;
        ASSERT_EQ(d.lower, back.lower) << i;
        ASSERT_EQ(d.upper, back.upper) << i;
    }
    EXPECT_GT(decided, 2000u);
}

TEST_F(Solids, DeeperLevelsNarrowTheBand) {
    Random random(8);
    double widths[3] = {};
    for (int i = 0; i < 400; ++i) {
        const Pose a{{}, random.rotation()}, b = near_pose(random);
        SolidsDistance before;
        for (uint32_t level = 0; level < 3; ++level) {
            const Solid x(torus().covers.view(), level), y(crossed().covers.view(), level);
            const SolidsDistance d = distance(x, a, y, b, context());
            // Inner covers hold those of higher levels; outer ones need not lie in them.
            ASSERT_LE(d.upper, before.upper * (1 + 1e-5)) << i;
            ASSERT_TRUE(before.verdict != Verdict::overlapping || d.verdict == Verdict::overlapping) << i;
            widths[level] += d.upper - d.lower;
            before = d;
        }
    }
    EXPECT_LT(widths[1], widths[0]);
    EXPECT_LT(widths[2], widths[1]);
}

// No translation shorter than the lower bound takes the triangles apart, and the way out does.
TEST_F(Solids, DepthsOfTrianglesLieBetweenTheBounds) {
    Random random(9);
    uint32_t deep = 0, ways = 0;
    double lower = 0, upper = 0;
    const Solid x(torus().covers.view()), y(crossed().covers.view());
    const auto exact = [&](const Pose& a, const Pose& b) {
        return collide(torus().exact.view(), a, crossed().exact.view(), b, context()).verdict;
    };
    const auto moved = [](Pose pose, const std::array<double, 3>& by) {
        pose.translation.x += static_cast<float>(by[0]);
        pose.translation.y += static_cast<float>(by[1]);
        pose.translation.z += static_cast<float>(by[2]);
        return pose;
    };
    for (int i = 0; i < 600; ++i) {
        const Pose a{{}, random.rotation()}, b = near_pose(random);
        ContactManifolds manifolds, of_covers;
        const SolidsContacts found = contacts(x, a, y, b, manifolds, context());
        ASSERT_EQ(found.verdict, collide(x, a, y, b, context()).verdict);
        contacts(torus().covers.view(), a, crossed().covers.view(), b, of_covers, context());
        ASSERT_EQ(manifolds.count, of_covers.count);
        ASSERT_LE(found.depth_lower, found.depth_upper) << i;
        EXPECT_EQ(found.depth_upper == 0, found.verdict == Verdict::separated);
        EXPECT_LT(found.depth_upper, 10);
        if (found.depth_lower > 0) {
            ++deep;
            ASSERT_EQ(found.verdict, Verdict::overlapping) << i;
            for (int k = 0; k < 8; ++k) {
                const auto d = random.direction();
                const double by = 0.999 * found.depth_lower;
                ASSERT_EQ(exact(a, moved(b, {by * d[0], by * d[1], by * d[2]})), Verdict::overlapping) << i;
            }
        }
        const double length = std::hypot(found.way_out.x, found.way_out.y, found.way_out.z);
        if (found.depth_upper > 0 && found.depth_upper < 1e9) {
            ++ways;
            EXPECT_NEAR(length, found.depth_upper, 1e-6);
            const Vec3 by = found.way_out;
            ASSERT_EQ(exact(a, moved(b, {by.x, by.y, by.z})), Verdict::separated) << i;
            if (found.depth_lower > 0) lower += found.depth_lower, upper += found.depth_upper;
        } else {
            EXPECT_EQ(length, 0);
        }
        for (const uint64_t budget : {0u, 5u, 50u, 300u}) {
            ContactManifolds some;
            const SolidsContacts part = contacts(x, a, y, b, some, context(), {.max_pair_tests = budget});
            EXPECT_LE(part.stats.tests(), budget);
            EXPECT_TRUE(part.verdict == found.verdict || part.verdict == Verdict::undecided);
            EXPECT_LE(part.depth_lower, found.depth_upper);
            EXPECT_GE(part.depth_upper, found.depth_lower);
        }
    }
    EXPECT_GT(deep, 100u);
    EXPECT_GT(ways, 100u);
    EXPECT_GT(lower, 0.1 * upper);
    RecordProperty("lower_of_upper", std::to_string(lower / upper));
    ContactManifolds manifolds;
    const float nan = std::numeric_limits<float>::quiet_NaN();
    const SolidsContacts bad = contacts(x, {{nan, 0, 0}, {}}, y, {}, manifolds, context());
    EXPECT_EQ(bad.verdict, Verdict::undecided);
    EXPECT_EQ(bad.depth_lower, 0);
    EXPECT_EQ(bad.depth_upper, std::numeric_limits<double>::infinity());
    EXPECT_EQ(manifolds.count, 0u);
}

// The same of scaled and rounded bodies, of poses that are uncertain, far from the origin, and with a margin, which
// depths know nothing of.
TEST_F(Solids, DepthsHoldForRoundedBodiesAndUncertainPoses) {
    Random random(11);
    uint32_t deep = 0, out = 0;
    for (int i = 0; i < 400; ++i) {
        const auto scale = static_cast<float>(random.log_in(0.3, 3)), radius = static_cast<float>(random.in(0, 0.2));
        const auto off = static_cast<float>(i % 3 == 0 ? 0 : random.in(0, 0.03));
        const auto changed = [&](const Tree& tree) { return *tree.view().scaled(scale)->rounded(radius); };
        const Solid x(changed(torus().covers)), y(crossed().covers.view());
        const TreeView exact_x = changed(torus().exact), exact_y = crossed().exact.view();
        const float far = i % 4 == 0 ? 1e4f : 0;
        const Pose a{{far, -far, far}, random.rotation()};
        Pose b = near_pose(random);
        b.translation = {b.translation.x * scale + far, b.translation.y * scale - far, b.translation.z * scale + far};
        ContactManifolds manifolds;
        const SolidsOptions options{.margin = i % 5 == 0 ? 0.1f : 0, .uncertainty = off};
        const SolidsContacts found = contacts(x, a, y, b, manifolds, context(), options);
        ASSERT_EQ(found.verdict, collide(x, a, y, b, context(), options).verdict) << i;
        const SolidsContacts back = contacts(y, b, x, a, manifolds, context(), options);
        EXPECT_EQ(back.depth_lower, found.depth_lower) << i;
        const auto moved = [&](double by, const Vec3& also) {
            const auto d = random.direction();
            Pose pose = b;
            pose.translation.x += static_cast<float>(by * d[0] + double{also.x});
            pose.translation.y += static_cast<float>(by * d[1] + double{also.y});
            pose.translation.z += static_cast<float>(by * d[2] + double{also.z});
            return collide(exact_x, a, exact_y, pose, context()).verdict;
        };
        const double rounding = 4e-3 * (far > 0); // of the poses that this test makes
        for (int k = 0; k < 6; ++k) {
            if (found.depth_lower > rounding) {
                ++deep;
                ASSERT_EQ(moved(0.999 * (found.depth_lower + double{off} - rounding), {}), Verdict::overlapping) << i;
            }
            if (double{off} >= rounding || rounding == 0) {
                ++out;
                ASSERT_EQ(moved(0.999 * (double{off} - rounding), found.way_out), Verdict::separated) << i;
            }
        }
    }
    EXPECT_GT(deep, 500u);
    EXPECT_GT(out, 1000u);
}

TEST_F(Solids, CachesSpareWorkAndChangeNoAnswer) {
    Random random(12);
    uint64_t tests = 0, cached_tests = 0;
    uint32_t counts[3] = {};
    const Solid x(torus().covers.view()), y(crossed().covers.view());
    for (int i = 0; i < 150; ++i) {
        const SolidsOptions options{.margin = i % 4 == 0 ? 0.05f : 0, .uncertainty = i % 3 == 0 ? 0.01f : 0};
        SolidsCache cache;
        if (i % 10 == 0) cache.inner = {true, {4000000000u, 7, 3, 5}}; // of other trees
        Pose a{{}, random.rotation()}, b = near_pose(random);
        const auto d = random.direction();
        for (int step = 0; step < 20; ++step) {
            const SolidsResult alone = collide(x, a, y, b, context(), options);
            const SolidsResult found = collide(x, a, y, b, context(), options, &cache);
            ASSERT_EQ(found.verdict, alone.verdict) << i << " " << step;
            ++counts[static_cast<int>(found.verdict)];
            tests += alone.stats.tests(), cached_tests += found.stats.tests();
            b.translation.x += static_cast<float>(0.002 * d[0]);
            b.translation.y += static_cast<float>(0.002 * d[1]);
            a.translation.z += static_cast<float>(0.002 * d[2]);
        }
        SolidsCache none;
        EXPECT_LE(collide(x, a, y, b, context(), {.max_pair_tests = 5}, &none).stats.tests(), 5u);
        EXPECT_EQ(collide(x, a, y, b, context(), {.max_pair_tests = 0}, &cache).stats.tests(), 0u);
    }
    for (const uint32_t count : counts) EXPECT_GT(count, 100u);
    EXPECT_LT(cached_tests, tests / 2);
}

TEST_F(Solids, PairsOfAWorldAreAnsweredAsTwoSolids) {
    Random random(10);
    constexpr HalfSpace kFloor{{0, 0, 3}, -1.2f};
    World covers = *World::create(), exact = *World::create();
    ASSERT_TRUE(covers.insert({.shape = kFloor, .pose = {}}));
    ASSERT_TRUE(exact.insert({.shape = kFloor, .pose = {}}));
    for (uint32_t i = 0; i < 60; ++i) {
        const Baked& baked = i % 2 == 0 ? torus() : crossed();
        Pose pose = near_pose(random);
        for (float* t : {&pose.translation.x, &pose.translation.y}) *t *= 3;
        ASSERT_TRUE(covers.insert({.shape = baked.covers.view(), .pose = pose}));
        ASSERT_TRUE(exact.insert({.shape = baked.exact.view(), .pose = pose}));
    }
    ASSERT_TRUE(covers.update_pairs());
    ASSERT_TRUE(exact.update_pairs());
    const auto pairs = covers.pairs();
    std::vector<QueryContext> contexts(1);
    const Workers workers{contexts};
    std::vector<SolidsResult> found(pairs.size()), with_margin(pairs.size());
    std::vector<SolidsDistance> apart(pairs.size());
    std::vector<DistanceResult> wanted(pairs.size());
    std::vector<CollideResult> wanted_with_margin(pairs.size());
    ASSERT_TRUE(collide(covers, pairs, found, workers));
    std::vector<OfPair<SolidsCache>> caches(covers.slot_count());
    for (int round = 0; round < 2; ++round) {
        std::vector<SolidsResult> cached(pairs.size());
        ASSERT_TRUE(collide(covers, pairs, cached, workers, {}, caches));
        for (size_t i = 0; i < pairs.size(); ++i) EXPECT_EQ(cached[i].verdict, found[i].verdict) << i;
    }
    ASSERT_TRUE(collide(covers, pairs, with_margin, workers, {.margin = 0.2f, .uncertainty = 1e-4f}));
    ASSERT_TRUE(distance(covers, pairs, apart, workers));
    ASSERT_TRUE(distance(exact, pairs, wanted, workers)); // ids are the same in both
    ASSERT_TRUE(collide(exact, pairs, wanted_with_margin, workers, {.margin = 0.2f}));
    EXPECT_FALSE(collide(covers, pairs, std::span(found).first(1), workers));
    uint32_t on_ground[3] = {}, others[3] = {};
    for (size_t i = 0; i < pairs.size(); ++i) {
        const Body &a = *covers.find(pairs[i].a), &b = *covers.find(pairs[i].b);
        const bool ground = a.tree() == nullptr || b.tree() == nullptr;
        ++(ground ? on_ground : others)[static_cast<int>(found[i].verdict)];
        if (found[i].verdict != Verdict::undecided) {
            ASSERT_EQ(found[i].verdict, wanted[i].verdict) << i;
        }
        if (with_margin[i].verdict != Verdict::undecided) {
            ASSERT_EQ(with_margin[i].verdict, wanted_with_margin[i].verdict) << i;
        }
        EXPECT_EQ(apart[i].verdict, found[i].verdict) << i;
        ASSERT_LE(apart[i].lower, wanted[i].upper + 1e-6) << i;
        ASSERT_GE(apart[i].upper, wanted[i].lower - 1e-6) << i;
        if (!ground) {
            EXPECT_EQ(collide(Solid(*a.tree()), a.pose, Solid(*b.tree()), b.pose, context()).verdict, found[i].verdict);
        }
    }
    for (const uint32_t verdict : {0u, 1u}) {
        EXPECT_GT(on_ground[verdict], 5u);
        EXPECT_GT(others[verdict], 20u);
    }
}

} // namespace
} // namespace prolate
