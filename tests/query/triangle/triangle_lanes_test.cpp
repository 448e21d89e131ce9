// The float kernels for triangles of two leaves: against long double, against the scalar test, and against themselves
// on every instruction set.
#include "query/simd/targets.hpp"

#include "query/triangle/leaves.hpp"
#include "tests/query/triangle/triangle_pairs.hpp"

#include <hwy/highway.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <limits>
#include <optional>

namespace prolate {
namespace {

using query::LaneMarginFactors;
using query::LeafResult;
using scenes::Point;
using scenes::Random;
using namespace triangle_pairs;
using reference::Real;

struct Leaf {
    std::vector<std::byte> bytes;
    TreeView tree;
    explicit Leaf(const std::vector<Corners>& triangles) : bytes(encode(triangles)), tree(*TreeView::open(bytes)) {}

    static std::vector<std::byte> encode(const std::vector<Corners>& triangles) {
        std::vector<Vec3> vertices;
        std::vector<Triangle> indices;
        for (const Corners& t : triangles) {
            const auto n = static_cast<uint32_t>(vertices.size());
            indices.push_back({n, n + 1, n + 2});
            vertices.insert(vertices.end(), t.begin(), t.end());
        }
        return leaf_of(vertices, indices);
    }
};

LeafResult test(const Pair& p, double distance = 0, const LaneMarginFactors& factors = {}) {
    const Leaf a({p.a}), b({p.b});
    return query::test_leaves(a.tree, {0, 1}, b.tree, {0, 1}, query::relative_pose(p.pose_a, p.pose_b), distance,
                              factors);
}

// ---- one pair: is what the floats claim true? ----

struct Tally {
    uint32_t falsely_apart = 0, falsely_meeting = 0, missed = 0;
    uint32_t apart = 0, meeting = 0, open = 0; // as the floats have it
};
Tally tally(const Family& family, uint32_t count, double scale, const LaneMarginFactors& factors = {}) {
    Random random(31);
    Tally out;
    for (uint32_t i = 0; i < count; ++i) {
        const Pair p = scaled(near_contact(random, family), scale);
        const LeafResult result = test(p, 0, factors);
        const Real truth = distance(p);
        EXPECT_EQ(result.pair_tests, 1u);
        out.falsely_apart += !result.meet && truth == 0;
        out.falsely_meeting += result.meet && result.exact_tests == 0 && truth > 0;
        out.missed += result.meet && truth > 1e-9 * size(p);
        (result.exact_tests ? out.open : result.meet ? out.meeting : out.apart) += 1;
    }
    return out;
}

class LaneFamily : public testing::TestWithParam<Family> {};

TEST_P(LaneFamily, ClaimsNothingFalse) {
    for (const double scale : {1e-3, 1.0, 1e6}) {
        const uint32_t count = 10'000;
        const Tally result = tally(GetParam(), count, scale);
        EXPECT_EQ(result.falsely_apart, 0u);
        EXPECT_EQ(result.falsely_meeting, 0u);
        EXPECT_EQ(result.missed, 0u);
        EXPECT_GT(result.apart, count / 12);
        EXPECT_TRUE(GetParam().coplanar || result.meeting > count / 100) << result.meeting;
    }
}
TEST_P(LaneFamily, TheHarnessNoticesWrongMargins) {
    EXPECT_GT(tally(GetParam(), 10'000, 1, {.direction = -1e-4f}).falsely_apart, 0u);
    if (!GetParam().coplanar) {
        EXPECT_GT(tally(GetParam(), 10'000, 1, {.volume = -1e-3f}).falsely_meeting, 0u);
    }
}
INSTANTIATE_TEST_SUITE_P(All, LaneFamily, testing::ValuesIn(kFamilies),
                         [](const auto& family) { return std::string(family.param.name); });

// Pairs as they come up in queries: their nearest points are 1e-3 to 1 of their size apart, or they cross.
TEST(TriangleLanes, LeaveFewPairsOpen) {
    Random random(32);
    uint32_t open = 0, apart = 0;
    const uint32_t count = 20'000;
    for (uint32_t i = 0; i < count; ++i) {
        Pair p{random_triangle(random, kFamilies[0]), random_triangle(random, kFamilies[0]), {}, {}};
        p.pose_b = {scenes::to_float(random.in_ball()), random.rotation()};
        const LeafResult result = test(p);
        open += result.exact_tests, apart += !result.meet;
    }
    EXPECT_GT(apart, count / 10);
    EXPECT_LT(apart, count * 19 / 20);
    EXPECT_LT(open, count / 100);
}

TEST(TriangleLanes, DemandADistance) {
    Random random(33);
    uint32_t apart = 0, certified = 0;
    const uint32_t count = 20'000;
    for (uint32_t i = 0; i < count; ++i) {
        const Pair p = near_contact(random, kFamilies[i % 4]);
        const Real truth = distance(p);
        const double asked = i % 5 ? static_cast<double>(truth) * random.in(0.5, 1.5) : random.log_in(1e-6, 1);
        const LeafResult result = test(p, asked);
        ASSERT_FALSE(!result.meet && truth <= asked) << i;
        ASSERT_FALSE(result.meet && truth > asked + 2e-9 * size(p)) << i;
        apart += !result.meet, certified += !result.meet && result.exact_tests == 0;
    }
    EXPECT_GT(apart, count / 8);
    EXPECT_LT(apart, count * 4 / 5);
    EXPECT_GT(certified, apart / 4);
}

TEST(TriangleLanes, ABadPoseNeverSeparates) {
    const Corners t{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}};
    constexpr float kNan = std::numeric_limits<float>::quiet_NaN(), kInf = std::numeric_limits<float>::infinity();
    for (const Pose& pose : {Pose{{9, 0, kNan}, {}}, Pose{{kInf, 0, 0}, {}}, Pose{{9, 0, 0}, {0, 0, 0, 0}}}) {
        EXPECT_TRUE(test({t, t, {}, pose}).meet);
        EXPECT_TRUE(test({t, t, pose, {}}).meet);
    }
    EXPECT_FALSE(test({t, t, {}, {{9, 0, 0}, {}}}).meet);
    for (const float size : {1e-38f, 1e-30f, 1e20f, kLargestCoordinate}) { // where squares and cubes leave the floats
        const Corners small{{{0, 0, 0}, {size, 0, 0}, {0, size, 0}}};
        const Corners cross{{{size / 4, size / 8, -size / 2}, {size / 4, size / 8, size / 2}, {size, size, size / 4}}};
        EXPECT_FALSE(test({small, small, {}, {{0, 0, size / 2}, {}}}).meet) << size;
        EXPECT_TRUE(test({small, cross, {}, {}}).meet) << size;
        if (size > 1e-37f) {
            EXPECT_EQ(test({small, cross, {}, {}}).exact_tests, 0u) << size;
        }
    }
    const Corners point{};
    EXPECT_TRUE(test({point, point, {}, {}}).meet);
}

// ---- leaves ----

// Triangles of a patch of surface, about 1 long.
std::vector<Corners> patch(Random& random, uint32_t count) {
    std::vector<Corners> out(count);
    for (Corners& t : out) {
        const Point at = random.in_ball();
        for (Vec3& v : t) {
            const Point p = random.in_ball();
            v = scenes::to_float({at[0] + 0.7 * p[0], at[1] + 0.7 * p[1], 0.1 * at[2] + 0.3 * p[2]});
        }
    }
    return out;
}
// What test_leaves() says it does, pair by pair with the scalar test.
LeafResult one_by_one(const TreeView& a, TriangleRange in_a, const TreeView& b, TriangleRange in_b,
                      const query::RelativePose& b_to_a, double distance) {
    LeafResult out;
    const auto end = [](uint32_t begin, TriangleRange range) { return std::min(begin + 4, range.first + range.count); };
    for (uint32_t four_a = in_a.first; four_a < in_a.first + in_a.count; four_a += 4)
        for (uint32_t four_b = in_b.first; four_b < in_b.first + in_b.count; four_b += 4)
            for (uint32_t j = four_b; j < end(four_b, in_b); ++j)
                for (uint32_t i = four_a; i < end(four_a, in_a); ++i) {
                    ++out.pair_tests;
                    if (query::separated(query::place(a, i), query::place(b, j, b_to_a), distance)) continue;
                    out.meet = true, out.triangle_a = i, out.triangle_b = j;
                    return out;
                }
    return out;
}

TEST(TriangleLeaves, FindTheFirstPairThatMeets) {
    Random random(34);
    uint32_t meeting = 0, late = 0, open = 0, pairs = 0;
    const uint32_t count = 3'000;
    for (uint32_t i = 0; i < count; ++i) {
        const uint32_t largest = i % 50 == 0 ? kMaxLeafTriangles : i % 5 == 0 ? 20 : 4;
        const uint32_t skip_a = random.below(3), skip_b = random.below(3); // the ranges need not begin at 0
        const uint32_t count_a = 1 + random.below(largest - 2), count_b = 1 + random.below(largest - 2);
        const Leaf a(patch(random, skip_a + count_a)), b(patch(random, skip_b + count_b));
        const Pose pose_a{scenes::to_float(random.in_ball()), random.rotation()};
        Pose pose_b{pose_a.translation, random.rotation()};
        pose_b.translation.z += static_cast<float>(random.in(0, 0.3));
        const auto b_to_a = query::relative_pose(pose_a, pose_b);
        const TriangleRange in_a{skip_a, count_a}, in_b{skip_b, count_b};
        const double distance = i % 3 ? 0 : random.log_in(1e-3, 0.1);
        const LeafResult result = query::test_leaves(a.tree, in_a, b.tree, in_b, b_to_a, distance);
        const LeafResult truth = one_by_one(a.tree, in_a, b.tree, in_b, b_to_a, distance);
        ASSERT_EQ(result.meet, truth.meet) << i;
        ASSERT_EQ(result.triangle_a, truth.triangle_a) << i;
        ASSERT_EQ(result.triangle_b, truth.triangle_b) << i;
        ASSERT_EQ(result.pair_tests, truth.pair_tests) << i;
        meeting += result.meet, late += result.meet && result.pair_tests > 8;
        if (distance == 0) open += result.exact_tests, pairs += result.pair_tests;
    }
    EXPECT_GT(meeting, count / 10);
    EXPECT_LT(meeting, count * 9 / 10);
    EXPECT_GT(late, 20u);
    EXPECT_LT(open, pairs / 200);
}

// ---- distances ----

// How often the bounds are above the distance, or far below it.
struct DistanceTally {
    uint32_t wrong = 0, apart = 0, loose = 0;
};
DistanceTally distance_tally(const Family& family, uint32_t count, const LaneMarginFactors& factors = {}) {
    Random random(36);
    DistanceTally out;
    for (uint32_t i = 0; i < count; ++i) {
        const Pair p = near_contact(random, family);
        query::TriangleRows rows[2];
        const auto a = reference_a(p), b = reference_b(p);
        double largest = 0;
        for (size_t k = 0; k < 9; ++k)
            largest = std::max({largest, std::abs(static_cast<double>(a[k / 3][k % 3] - a[0][k % 3])),
                                std::abs(static_cast<double>(b[k / 3][k % 3] - a[0][k % 3]))});
        for (size_t k = 0; k < 9; ++k)
            for (size_t lane = 0; lane < query::kLanes; ++lane) {
                rows[0].row[k][lane] = static_cast<float>((a[k / 3][k % 3] - a[0][k % 3]) / largest);
                rows[1].row[k][lane] = static_cast<float>((b[k / 3][k % 3] - a[0][k % 3]) / largest);
            }
        const query::LaneMargins margins{factors.direction, query::kPlacementError, 0};
        const auto bounds = query::bound_lanes(rows[0], rows[1], margins, query::kFarLimit);
        const auto truth = static_cast<double>(distance(p)) / largest;
        out.wrong += !(bounds.lower[3] <= truth);
        out.apart += bounds.lower[3] > 0;
        out.loose += bounds.lower[3] < 0.98 * truth - 1e-4;
    }
    return out;
}
TEST_P(LaneFamily, BoundsDistances) {
    const uint32_t count = 20'000;
    const DistanceTally result = distance_tally(GetParam(), count);
    EXPECT_EQ(result.wrong, 0u);
    EXPECT_GT(result.apart, count / 20);
    EXPECT_LT(result.loose, count / 50);
    EXPECT_GT(distance_tally(GetParam(), 5'000, {.direction = -1e-5f}).wrong, 10u);
}

TEST(TriangleLeaves, FindTheNearestPair) {
    Random random(37);
    uint32_t apart = 0, cut = 0, exact = 0, pairs = 0;
    const uint32_t count = 1'500;
    for (uint32_t i = 0; i < count; ++i) {
        const uint32_t largest = i % 50 == 0 ? kMaxLeafTriangles : i % 5 == 0 ? 20 : 4;
        const uint32_t count_a = 1 + random.below(largest), count_b = 1 + random.below(largest);
        const Leaf a(patch(random, count_a)), b(patch(random, count_b));
        Pose pose_b{{}, random.rotation()};
        pose_b.translation.z = static_cast<float>(random.in(0, 3));
        const auto b_to_a = query::relative_pose({}, pose_b);
        double lower = HUGE_VAL, upper = HUGE_VAL;
        for (uint32_t k = 0; k < count_a; ++k)
            for (uint32_t j = 0; j < count_b; ++j) {
                const auto d = query::distance(query::place(a.tree, k), query::place(b.tree, j, b_to_a));
                lower = std::min(lower, d.lower), upper = std::min(upper, d.upper);
            }
        const auto result = query::distance_of_leaves(a.tree, {0, count_a}, b.tree, {0, count_b}, b_to_a);
        ASSERT_LE(result.lower, upper) << i; // true bounds of the same distance
        ASSERT_GE(result.nearest.upper, lower) << i;
        ASSERT_LE(result.nearest.upper - result.lower, 1e-9) << i;
        const auto near =
            query::distance(query::place(a.tree, result.triangle_a), query::place(b.tree, result.triangle_b, b_to_a));
        ASSERT_EQ(near.upper, result.nearest.upper) << i;
        apart += lower > 0;
        if (lower > 0) exact += result.exact_tests, pairs += result.pair_tests;
        // A direction, right or not, changes nothing.
        const Point d = random.direction();
        const glm::dvec3 ways[] = {near.on_b - near.on_a, {d[0], d[1], d[2]}};
        for (const glm::dvec3& way : ways) {
            if (way == glm::dvec3(0)) continue;
            const auto again = query::distance_of_leaves(a.tree, {0, count_a}, b.tree, {0, count_b}, b_to_a, {},
                                                         way / glm::length(way));
            ASSERT_LE(again.lower, upper) << i;
            ASSERT_GE(again.nearest.upper, lower) << i;
            ASSERT_LE(again.nearest.upper - again.lower, 1e-9) << i;
        }
        const double limit = random.in(0, 3);
        const auto near_ones = query::distance_of_leaves(a.tree, {0, count_a}, b.tree, {0, count_b}, b_to_a, {limit});
        ASSERT_LE(near_ones.lower, upper) << i;
        if (limit > upper) {
            ASSERT_LE(near_ones.nearest.upper - near_ones.lower, 1e-9) << i;
        } else {
            ASSERT_GE(near_ones.lower, std::min(limit, lower) - 1e-9) << i;
            ++cut;
        }
    }
    EXPECT_GT(apart, count / 2);
    EXPECT_GT(cut, count / 10);
    EXPECT_LT(cut, count * 9 / 10);
    EXPECT_LT(exact, pairs / 10);
}
TEST(TriangleLeaves, NoDistanceFromABadPose) {
    const Corners t{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}};
    const Leaf a({t}), b({t});
    constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
    const auto d =
        query::distance_of_leaves(a.tree, {0, 1}, b.tree, {0, 1}, query::relative_pose({}, {{9, 0, kNan}, {}}));
    EXPECT_EQ(d.lower, 0);
    EXPECT_EQ(d.nearest.upper, std::numeric_limits<double>::infinity());
}

// ---- the same bits from every instruction set ----

std::vector<uint64_t> all_verdicts() {
    Random random(35);
    const query::LaneMargins margins[] = {{0x1p-19f, 0x1p-24f, 0}, {0x1p-19f, 0x1p-24f, 0.01f}};
    std::vector<uint64_t> out;
    for (int i = 0; i < 20'000; ++i) {
        query::TriangleRows t[2];
        for (size_t lane = 0; lane < query::kLanes; ++lane)
            for (query::TriangleRows& side : t)
                for (size_t k = 0; k < 3; ++k) {
                    const Point p = random.in_ball();
                    const bool whole = i % 4 == 0; // many touch, are coplanar or degenerate
                    for (size_t j = 0; j < 3; ++j)
                        side.row[3 * k + j][lane] = static_cast<float>(whole ? std::floor(4 * p[j]) / 8 : p[j]);
                }
        for (const query::LaneMargins& m : margins) {
            const auto v = query::test_lanes(t[0], t[1], m, {});
            EXPECT_EQ(v.apart & v.meet, 0u);
            out.push_back(uint64_t{v.apart} << 32 | v.meet);
        }
        const auto bounds = query::bound_lanes(t[0], t[1], margins[0], i % 2 ? query::kFarLimit : 0.2f);
        for (const float lower : bounds.lower) out.push_back(std::bit_cast<uint32_t>(lower));
    }
    return out;
}
TEST(TriangleLanes, AreTheSameOnEveryTarget) {
    std::optional<std::vector<uint64_t>> first;
    uint32_t targets = 0;
    for (const int64_t target : hwy::SupportedAndGeneratedTargets()) {
        hwy::SetSupportedTargetsForTest(target);
        hwy::GetChosenTarget().Update(hwy::SupportedTargets());
        const auto verdicts = all_verdicts();
        if (!first) first = verdicts;
        EXPECT_EQ(verdicts, *first) << hwy::TargetName(target);
        ++targets;
    }
    hwy::SetSupportedTargetsForTest(0);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
    EXPECT_GT(targets, 0u);
}

} // namespace
} // namespace prolate
