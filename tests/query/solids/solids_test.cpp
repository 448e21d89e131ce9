// Solids by their covers from outside and inside, against exact trees of the same meshes.
#include "tests/builder/bakes.hpp"
#include "tests/scenes.hpp"
#include "tests/shapes.hpp"

#include <prolate/collide.hpp>
#include <prolate/primitives.hpp>
#include <prolate/solids.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>

namespace prolate {
namespace {

using scenes::Random;

// A solid three times: covers, triangles, and triangles with an inner cover.
struct Solid {
    explicit Solid(const Mesh& mesh)
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
const Solid& torus() {
    static const Solid solid(shapes::torus(1, 0.3f, 24, 12));
    return solid;
}
const Solid& crossed() {
    static const Solid solid(cross());
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

static_assert(noexcept(collide_solids(std::declval<TreeView>(), Pose{}, std::declval<TreeView>(), Pose{},
                                      std::declval<QueryContext&>())));

TEST_F(Solids, CoversNeverContradictTriangles) {
    Random random(1);
    uint32_t counts[3] = {};
    for (int i = 0; i < 3000; ++i) {
        const Pose a{{}, random.rotation()}, b = near_pose(random);
        const auto exact = collide(torus().exact.view(), a, crossed().exact.view(), b, context()).verdict;
        const SolidsOptions options{.max_level = i % 4u == 3 ? kMaxLevels : static_cast<uint32_t>(i) % 4u};
        const TreeView x = torus().covers.view(), y = crossed().covers.view();
        const SolidsResult found = collide_solids(x, a, y, b, context(), options);
        if (found.verdict != Verdict::undecided) {
            ASSERT_EQ(found.verdict, exact) << i;
        }
        EXPECT_FALSE(found.out_of_budget);
        if (options.max_level == kMaxLevels) ++counts[static_cast<int>(found.verdict)];
        EXPECT_EQ(collide_solids(y, b, x, a, context(), options).verdict, found.verdict);
        // Triangles decide everything, with inner covers or without, and against covers as far as these do.
        const TreeView with_inner = torus().exact_with_inner.view();
        EXPECT_EQ(collide_solids(with_inner, a, crossed().exact_with_inner.view(), b, context()).verdict, exact);
        EXPECT_EQ(collide_solids(torus().exact.view(), a, crossed().exact.view(), b, context()).verdict, exact);
        const Verdict mixed = collide_solids(torus().exact.view(), a, y, b, context()).verdict;
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
        const TreeView x = torus().covers.view(), y = crossed().covers.view();
        for (const uint32_t level : {0u, 1u, kMaxLevels}) {
            const SolidsDistance found =
                distance_solids(x, a, y, b, context(), {.tolerance_relative = 1e-3, .max_level = level});
            ASSERT_LE(found.lower, exact.upper + 1e-6) << i;
            ASSERT_GE(found.upper, exact.lower - 1e-6) << i;
            ASSERT_LE(found.lower, found.upper);
            EXPECT_EQ(found.verdict == Verdict::separated, found.lower > 0);
            EXPECT_EQ(found.verdict == Verdict::overlapping, found.upper == 0);
            if (level == 0) coarse_width += found.upper - found.lower;
            if (level == kMaxLevels) width += found.upper - found.lower;
        }
        const SolidsDistance both = distance_solids(torus().exact.view(), a, crossed().exact.view(), b, context());
        EXPECT_EQ(both.lower, exact.lower);
        EXPECT_EQ(both.upper, exact.upper);
        const SolidsDistance far = distance_solids(x, a, y, b, context(), {.max_distance = 0.01});
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
        const auto found =
            collide_solids(changed(torus().covers), a, crossed().covers.view(), b, context(), {.margin = margin});
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
        const TreeView x = torus().covers.view(), y = crossed().covers.view();
        const auto found = collide_solids(x, a, y, b, context(), {.margin = margin, .uncertainty = off});
        if (found.verdict == Verdict::undecided) {
            fewer += collide_solids(x, a, y, b, context(), {.margin = margin}).verdict != Verdict::undecided;
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
    for (const TreeView& other : {plain.tree.view(), torus().covers.view()}) {
        EXPECT_EQ(collide_solids(plain.tree.view(), here, other, here, context()).verdict, Verdict::undecided);
        const SolidsDistance d = distance_solids(plain.tree.view(), here, other, here, context());
        EXPECT_EQ(d.verdict, Verdict::undecided);
        EXPECT_EQ(d.lower, 0);
        EXPECT_EQ(d.upper, std::numeric_limits<double>::infinity());
    }
    const Pose far{{10, 0, 0}, {}};
    EXPECT_EQ(collide_solids(plain.tree.view(), here, plain.tree.view(), far, context()).verdict, Verdict::separated);
}

TEST_F(Solids, PrefixesOfExactTreesAreNoSolids) {
    const TreeView prefix = torus().exact.view().coarser(1);
    const Pose here, far{{100, 0, 0}, {}};
    EXPECT_EQ(collide_solids(prefix, here, crossed().covers.view(), far, context()).verdict, Verdict::undecided);
    EXPECT_EQ(distance_solids(prefix, here, crossed().covers.view(), far, context()).verdict, Verdict::undecided);
}

TEST_F(Solids, BudgetsAndBadPosesClaimNothingWrong) {
    Random random(4);
    const TreeView x = torus().covers.view(), y = crossed().covers.view();
    for (int i = 0; i < 300; ++i) {
        const Pose a{{}, random.rotation()}, b = near_pose(random);
        const SolidsResult whole = collide_solids(x, a, y, b, context());
        for (const uint64_t budget : {0u, 1u, 20u, 60u, 200u}) {
            const SolidsResult part = collide_solids(x, a, y, b, context(), {.max_pair_tests = budget});
            EXPECT_LE(part.stats.tests(), budget);
            EXPECT_TRUE(part.verdict == whole.verdict || part.verdict == Verdict::undecided);
            if (part.verdict != whole.verdict) {
                EXPECT_TRUE(part.out_of_budget);
            }
            const SolidsDistance d = distance_solids(x, a, y, b, context(), {.max_pair_tests = budget});
            EXPECT_LE(d.stats.tests(), budget);
            EXPECT_LE(d.lower, d.upper);
        }
    }
    const float nan = std::numeric_limits<float>::quiet_NaN();
    for (const Pose& bad : {Pose{{nan, 0, 0}, {}}, Pose{{}, {0, 0, 0, 0}}})
        for (const TreeView& other : {y, crossed().exact.view()}) {
            EXPECT_EQ(collide_solids(x, bad, other, {}, context()).verdict, Verdict::undecided);
            EXPECT_EQ(collide_solids(other, {}, x, bad, context()).verdict, Verdict::undecided);
            const SolidsDistance d = distance_solids(x, bad, other, {}, context());
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
            if (collide_solids(corner.view(), {}, tiny, pose, context()).verdict != Verdict::overlapping) continue;
            ++meet;
            ASSERT_NE(collide(corner.view(), {}, exact, pose, context()).verdict, Verdict::separated) << size;
        }
        EXPECT_GT(meet, 150) << size;
    }
}

TEST_F(Solids, CoversWithinTrianglesMeetThemUnlessTheyMayBeDisplacedBeyondThem) {
    const TreeView tiny = *torus().covers.view().scaled(0.05f), around = crossed().exact.view();
    const auto verdict = [&](float uncertainty) {
        return collide_solids(tiny, {}, around, {}, context(), {.uncertainty = uncertainty}).verdict;
    };
    EXPECT_EQ(verdict(0), Verdict::overlapping);
    EXPECT_EQ(verdict(1e-6f), Verdict::overlapping);
    EXPECT_EQ(verdict(1), Verdict::undecided);
}

TEST_F(Solids, LargerMarginsStayCertain) {
    Random random(6);
    const TreeView x = torus().covers.view(), y = crossed().covers.view();
    for (int i = 0; i < 1000; ++i) {
        const Pose a{{}, random.rotation()}, b = near_pose(random);
        const auto uncertainty = static_cast<float>(random.log_in(1e-3, 0.1));
        const auto verdict = [&](float margin) {
            return collide_solids(x, a, y, b, context(), {.margin = margin, .uncertainty = uncertainty}).verdict;
        };
        const float margin = uncertainty * static_cast<float>(random.in(1, 3));
        ASSERT_TRUE(verdict(0) != Verdict::overlapping || verdict(margin) == Verdict::overlapping) << i;
    }
}

TEST_F(Solids, ScratchOfTheSizeThatIsNamedSuffices) {
    const TreeView x = torus().covers.view(), y = crossed().covers.view();
    std::vector<std::byte> memory(scratch_size(x, y));
    const Pose here, off{{0.8f, 0, 0}, {}};
    EXPECT_EQ(collide_solids(x, here, y, off, Scratch(memory)).verdict,
              collide_solids(x, here, y, off, context()).verdict);
    EXPECT_EQ(collide_solids(x, here, y, off, Scratch(std::span(memory).first(64))).verdict, Verdict::undecided);
}

} // namespace
} // namespace prolate
