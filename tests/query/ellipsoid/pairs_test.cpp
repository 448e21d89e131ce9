// Batches of pairs, and single ones: a hunt for wrong answers near contact, and what else the header promises.
#include "query/simd/targets.hpp"

#include "query/ellipsoid/gap.hpp"
#include "tests/query/hunt.hpp"
#include "tests/reference.hpp"
#include "tests/scenes.hpp"

#include <prolate/pairs.hpp>

#include <gtest/gtest.h>

#include <hwy/highway.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

namespace prolate {
namespace {

using hunt::gap_along;
using hunt::length;
using reference::Real;
using scenes::Point;
using scenes::Random;

struct Bodies {
    std::vector<Ellipsoid> shapes;
    std::vector<Pose> poses;
    std::vector<WorldEllipsoid> world;
    std::vector<IndexPair> pairs;           // 2 i and 2 i + 1
    std::vector<reference::Vector> normals; // along which they were made
    EllipsoidBodies view() const { return {shapes, poses, world}; }
    void place() {
        world.resize(shapes.size());
        prolate::place(shapes, poses, world);
    }
};

struct Family {
    double least_gap = 1e-7, most_gap = 1; // of the pair's size, of both signs
    double offset = 0;                     // both bodies away from the origin, of their size
    double own_center = 0;                 // bodies away from their own origin
    double least_unit = 1, most_unit = 1;  // metres
    double ratio = hunt::kLargestRatio;    // of axes
};
const Family kFamilies[] = {
    {},
    {.least_gap = 1e-7, .most_gap = 1e-5},
    {.least_unit = 1e-3, .most_unit = 1e6},
    {.offset = 1e4},
    {.offset = 100, .least_unit = 1e-3, .most_unit = 1e6},
    {.least_gap = 1e-5, .offset = 1e4, .least_unit = 1e-3, .most_unit = 1e6},
    {.least_gap = 1e-6, .own_center = 10},
};

// Appends a pair, so far apart beside the margin.
void add_pair(Random& random, const Family& family, double margin, Bodies& out) {
    const double unit = random.log_in(family.least_unit, family.most_unit), ratio = random.log_in(0.1, 10);
    const auto shape = [&](double size) {
        const Point r = hunt::radii(random, family.ratio), d = random.direction();
        const double far = family.own_center * random.unit() * unit;
        const Point center{far * d[0], far * d[1], far * d[2]};
        return scenes::ellipsoid(center, {size * r[0], size * r[1], size * r[2]}, random.rotation());
    };
    const Ellipsoid a = shape(unit), b = shape(unit * ratio);
    Pose pose_a, pose_b;
    pose_a.rotation = random.rotation(), pose_b.rotation = random.rotation();
    const Point n = random.direction(), away = random.direction();
    const double far = family.offset > 0 ? unit * random.log_in(1, family.offset) : 0;
    pose_a.translation = scenes::to_float({far * away[0], far * away[1], far * away[2]});
    const double gap = unit * (1 + ratio) * random.log_in(family.least_gap, family.most_gap);
    const reference::Vector normal{n[0], n[1], n[2]};
    hunt::part(a, pose_a, b, pose_b, normal, random.below(2) ? margin + gap : margin - gap);

    const auto first = static_cast<uint32_t>(out.shapes.size());
    out.shapes.push_back(a), out.shapes.push_back(b);
    out.poses.push_back(pose_a), out.poses.push_back(pose_b);
    out.pairs.push_back({first, first + 1});
    out.normals.push_back(normal);
}

Bodies make(uint64_t seed, const Family& family, size_t count, double margin = 0) {
    Random random(seed);
    Bodies out;
    for (size_t i = 0; i < count; ++i) add_pair(random, family, margin, out);
    out.place();
    return out;
}

reference::Pair exact(const Bodies& bodies, size_t i) {
    return {bodies.shapes[2 * i], bodies.poses[2 * i], bodies.shapes[2 * i + 1], bodies.poses[2 * i + 1]};
}

struct Tally {
    uint64_t pairs = 0, separated = 0, false_separated = 0, false_overlapping = 0, unlike_single = 0, in_double = 0;
    uint64_t very_near = 0; // within 1e-6 of the size of where the verdict changes
    void add(const Bodies& bodies, std::span<const Verdict> verdicts, float margin = 0) {
        for (size_t i = 0; i < verdicts.size(); ++i) {
            const reference::Pair pair = exact(bodies, i);
            const reference::Vector& n = bodies.normals[i];
            const Real gap = gap_along(pair, n) - margin, size = length(pair.l1[0]) + length(pair.r);
            const bool apart = verdicts[i] == Verdict::separated;
            if (apart && gap <= 0 && hunt::within(pair, n, margin)) ++false_separated;
            // Nearer than what rounding costs, or with a margin the search for the distance, nothing is promised.
            if (!apart && gap > (margin > 0 ? 1e-4L : 1e-9L) * size) ++false_overlapping;
            unlike_single += verdicts[i] != collide(bodies.shapes[2 * i], bodies.poses[2 * i], bodies.shapes[2 * i + 1],
                                                    bodies.poses[2 * i + 1], margin);
            very_near += std::abs(gap) < 1e-6L * size;
            separated += apart;
        }
        pairs += verdicts.size();
    }
};

TEST(Pairs, HuntForWrongVerdicts) {
    constexpr size_t kBatch = 4096;
    const hunt::Length length;
    Tally tally;
    std::vector<Verdict> verdicts(kBatch);
    for (uint64_t seed = 0; length.more(tally.pairs); ++seed) {
        const Family& family = kFamilies[seed % std::size(kFamilies)];
        const float margin = seed % 5 == 4 ? static_cast<float>(0.1 * family.least_unit) : 0;
        const Bodies bodies = make(seed, family, kBatch, double{margin});
        tally.in_double += collide(bodies.view(), bodies.pairs, verdicts, margin).in_double;
        tally.add(bodies, verdicts, margin);
        ASSERT_EQ(tally.false_separated, 0u) << "seed " << seed;
        ASSERT_EQ(tally.false_overlapping, 0u) << "seed " << seed;
        ASSERT_EQ(tally.unlike_single, 0u) << "seed " << seed;
    }
    const auto share = [&](uint64_t n) { return static_cast<double>(n) / static_cast<double>(tally.pairs); };
    EXPECT_GT(share(tally.separated), 0.4);
    EXPECT_LT(share(tally.separated), 0.6);
    EXPECT_GT(share(tally.very_near), 0.05); // the hunt is where the game is
    EXPECT_LT(share(tally.in_double), 0.5);  // most is decided in lanes
    RecordProperty("in_double", std::to_string(share(tally.in_double)));
    RecordProperty("pairs", std::to_string(tally.pairs));
}

// The harness itself: faults that are planted are seen. (Without margins lanes are hardly ever wrong: worst cases of
// rounding do not come together. So the margins have the wrong sign here, and factors are a little wrong.)
TEST(Pairs, WrongMarginsAreCaught) {
    Bodies bodies = make(7, kFamilies[1], 20'000);
    std::vector<Verdict> verdicts(bodies.pairs.size());
    const auto tally_with = [&](auto&& fault) {
        bodies.place();
        for (WorldEllipsoid& e : bodies.world) fault(e);
        collide(bodies.view(), bodies.pairs, verdicts);
        Tally out;
        out.add(bodies, verdicts);
        return out;
    };
    const auto scale = [](WorldEllipsoid& e, float by) {
        for (float& l : e.factor) l *= by;
    };
    const Tally bare = tally_with([](WorldEllipsoid& e) { e.slack = -e.slack; });
    EXPECT_GT(bare.false_separated, 1000u);
    EXPECT_GT(bare.unlike_single, 1000u);
    EXPECT_GT(tally_with([](WorldEllipsoid& e) { e.thinness = -e.thinness; }).false_overlapping, 100u);
    EXPECT_GT(tally_with([&](WorldEllipsoid& e) { scale(e, 1 - 0x1p-18f); }).false_separated, 100u);
    EXPECT_GT(tally_with([&](WorldEllipsoid& e) { scale(e, 1 + 0x1p-12f); }).false_overlapping, 100u);
    const Tally right = tally_with([](WorldEllipsoid&) {});
    EXPECT_EQ(right.false_separated + right.false_overlapping + right.unlike_single, 0u);
}

// What is certified of distances, for both signs.
TEST(Pairs, DistancesAreBounds) {
    uint64_t pairs = 0, apart = 0, inside = 0, loose = 0, in_double = 0;
    for (uint64_t seed = 0; seed < 24; ++seed) {
        Family family = kFamilies[seed % std::size(kFamilies)];
        family.least_gap = 1e-6;
        family.ratio = 1000; // of thinner bodies the bounds hold, but the points are off by more than is allowed below
        const Bodies bodies = make(100 + seed, family, 500);
        // Both tolerances: one that lanes reach and one that they do not.
        const float tolerance =
            static_cast<float>((seed % 4 ? 1e-3 : 1e-6) * std::sqrt(family.least_unit * family.most_unit));
        std::vector<PairDistance> distances(bodies.pairs.size());
        in_double += distance(bodies.view(), bodies.pairs, distances, tolerance).in_double;
        for (size_t i = 0; i < distances.size(); ++i) {
            const PairDistance& d = distances[i];
            const reference::Pair pair = exact(bodies, i);
            const PairDistance best =
                distance(bodies.shapes[2 * i], bodies.poses[2 * i], bodies.shapes[2 * i + 1], bodies.poses[2 * i + 1]);
            const reference::Vector n{d.normal.x, d.normal.y, d.normal.z};
            ASSERT_NEAR(static_cast<double>(length(n)), 1, 1e-6);
            ASSERT_LE(d.lower, d.upper);
            ASSERT_LE(d.lower, best.upper) << seed << ' ' << i;
            ASSERT_GE(d.upper, best.lower) << seed << ' ' << i;
            // Duality: the gap along the reported normal proves the lower bound, and that along the normal of the scene
            // refutes an upper one that is too low. The single pair's normal is rounded to floats, hence the allowance.
            const Real allowance =
                0x1p-22L * (length(pair.r) + length(pair.l1[0]) + length(pair.l1[1]) + length(pair.l1[2]) +
                            length(pair.l2[0]) + length(pair.l2[1]) + length(pair.l2[2]));
            ASSERT_LE(d.lower, gap_along(pair, n) + (in_double ? allowance : 0)) << seed << ' ' << i;
            ASSERT_GE(d.upper, gap_along(pair, bodies.normals[i])) << seed << ' ' << i;
            if (d.lower > 0) {
                ++apart;
                const Vec3 between{d.point_b.x - d.point_a.x, d.point_b.y - d.point_a.y, d.point_b.z - d.point_a.z};
                const double rounding = 1e-6 * (std::abs(d.point_a.x) + std::abs(d.point_a.y) + std::abs(d.point_a.z)) +
                                        static_cast<double>(16 * allowance);
                ASSERT_NEAR(std::hypot(between.x, between.y, between.z), d.upper, rounding);
                loose += d.upper - d.lower > 1.01f * tolerance + static_cast<float>(rounding);
            }
            inside += d.upper < 0;
        }
        pairs += distances.size();
    }
    EXPECT_GT(apart, pairs * 2 / 5);
    EXPECT_GT(inside, pairs / 4);   // a gap far below 0 lets thin bodies come out on the other side
    EXPECT_LE(loose, pairs / 1000); // rounding of thin bodies in single precision
    EXPECT_LT(in_double, pairs / 2);
}

// Bounds that are none are caught: with slack of the wrong sign, they lie above the gaps that should prove them.
TEST(Pairs, WrongMarginsOfDistancesAreCaught) {
    Bodies bodies = make(8, {.least_gap = 1e-3}, 20'000);
    for (WorldEllipsoid& e : bodies.world) e.slack = -e.slack;
    std::vector<PairDistance> distances(bodies.pairs.size());
    distance(bodies.view(), bodies.pairs, distances, 1e-3f);
    uint32_t caught = 0;
    for (size_t i = 0; i < distances.size(); ++i) {
        const Vec3& n = distances[i].normal;
        caught += distances[i].lower > gap_along(exact(bodies, i), {n.x, n.y, n.z});
    }
    EXPECT_GT(caught, 1000u);
}

template <class T> bool same_bits(const std::vector<T>& a, const std::vector<T>& b) {
    return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0;
}

// Highway's scalar target, one lane at a time, is the reference of the others.
TEST(Pairs, EveryInstructionSetGivesTheSameBits) {
    const std::vector<int64_t> targets = hwy::SupportedAndGeneratedTargets();
    for (const Family& family : kFamilies) {
        const Bodies bodies = make(9, family, 3001);
        std::vector<Verdict> first_verdicts;
        std::vector<PairDistance> first_distances;
        PairStats first, first_of_distances;
        for (const int64_t target : targets) {
            hwy::SetSupportedTargetsForTest(target);
            hwy::GetChosenTarget().Update(hwy::SupportedTargets());
            std::vector<Verdict> verdicts(bodies.pairs.size());
            std::vector<PairDistance> distances(bodies.pairs.size());
            const PairStats stats = collide(bodies.view(), bodies.pairs, verdicts);
            const PairStats stats_of_distances = distance(bodies.view(), bodies.pairs, distances, 1e-4f);
            if (target == targets.front()) {
                first_verdicts = verdicts, first_distances = distances;
                first = stats, first_of_distances = stats_of_distances;
            }
            EXPECT_TRUE(same_bits(verdicts, first_verdicts)) << hwy::TargetName(target);
            EXPECT_TRUE(same_bits(distances, first_distances)) << hwy::TargetName(target);
            EXPECT_EQ(stats.evaluations, first.evaluations) << hwy::TargetName(target);
            EXPECT_EQ(stats.in_double, first.in_double) << hwy::TargetName(target);
            EXPECT_EQ(stats_of_distances.evaluations, first_of_distances.evaluations) << hwy::TargetName(target);
            EXPECT_EQ(stats_of_distances.in_double, first_of_distances.in_double) << hwy::TargetName(target);
        }
        hwy::SetSupportedTargetsForTest(0);
        hwy::GetChosenTarget().Update(hwy::SupportedTargets());
    }
    EXPECT_GE(targets.size(), 2u) << "nothing was compared";
}

// A pair's answer depends on neither its neighbours nor its place, and nothing is written beyond the end.
TEST(Pairs, AnswersDoNotDependOnNeighbours) {
    const Bodies bodies = make(10, kFamilies[0], 2000);
    std::vector<Verdict> all(2000);
    std::vector<PairDistance> all_distances(2000);
    collide(bodies.view(), bodies.pairs, all);
    distance(bodies.view(), bodies.pairs, all_distances, 1e-4f);
    for (size_t count = 0; count < 40; ++count) {
        const auto pairs = std::span(bodies.pairs).subspan(37 * count, count);
        std::vector<Verdict> verdicts(count + 1, Verdict::undecided);
        std::vector<PairDistance> distances(count + 1);
        collide(bodies.view(), pairs, std::span(verdicts).first(count));
        distance(bodies.view(), pairs, std::span(distances).first(count), 1e-4f);
        for (size_t i = 0; i < count; ++i) {
            ASSERT_EQ(verdicts[i], all[37 * count + i]);
            ASSERT_EQ(std::memcmp(&distances[i], &all_distances[37 * count + i], sizeof(PairDistance)), 0);
        }
        ASSERT_EQ(verdicts[count], Verdict::undecided);
        ASSERT_EQ(distances[count].normal, Vec3{});
    }
}

TEST(Pairs, AMarginIsADistance) {
    const Bodies bodies = make(11, {.least_gap = 1e-4}, 4000);
    std::vector<Verdict> verdicts(bodies.pairs.size());
    uint32_t separated = 0, between = 0;
    for (const float margin : {1e-3f, 0.05f, 0.5f}) {
        collide(bodies.view(), bodies.pairs, verdicts, margin);
        for (size_t i = 0; i < verdicts.size(); ++i) {
            const auto& [a, b] = bodies.pairs[i];
            const PairDistance d = distance(bodies.shapes[a], bodies.poses[a], bodies.shapes[b], bodies.poses[b]);
            if (d.lower > 1.00001f * margin) {
                ASSERT_EQ(verdicts[i], Verdict::separated) << i;
            } else if (d.upper < 0.99999f * margin) {
                ASSERT_EQ(verdicts[i], Verdict::overlapping) << i;
                between += d.lower > 0;
            }
            ASSERT_EQ(verdicts[i],
                      collide(bodies.shapes[a], bodies.poses[a], bodies.shapes[b], bodies.poses[b], margin));
            separated += verdicts[i] == Verdict::separated;
        }
    }
    EXPECT_GT(separated, 1000u);
    EXPECT_GT(between, 1000u);
}

TEST(Pairs, SingleDistancesAreSymmetric) {
    const Bodies bodies = make(12, kFamilies[2], 2000);
    for (const auto& [a, b] : bodies.pairs) {
        const PairDistance d = distance(bodies.shapes[a], bodies.poses[a], bodies.shapes[b], bodies.poses[b]);
        const PairDistance e = distance(bodies.shapes[b], bodies.poses[b], bodies.shapes[a], bodies.poses[a]);
        ASSERT_EQ(d.lower, e.lower);
        ASSERT_EQ(d.upper, e.upper);
        ASSERT_EQ(d.point_a, e.point_b);
        ASSERT_EQ(d.normal.x, -e.normal.x);
    }
}

TEST(Pairs, BadInputNeverSeparatesAndSpoilsItsOwnPairsOnly) {
    constexpr float kNan = std::numeric_limits<float>::quiet_NaN(), kInf = std::numeric_limits<float>::infinity();
    for (const float bad : {kNan, kInf, -kInf, 3e38f}) {
        Bodies bodies;
        bodies.shapes.resize(48), bodies.poses.resize(48);
        for (uint32_t i = 0; i < 24; ++i) {
            bodies.poses[2 * i + 1].translation.x = 100;
            bodies.pairs.push_back({2 * i, 2 * i + 1});
        }
        bodies.poses[2].translation.y = bad;
        bodies.poses[7].rotation.x = bad, bodies.poses[7].rotation.y = bad;
        bodies.shapes[13].center.z = bad;
        bodies.shapes[18].l22 = bad;
        bodies.poses[24].rotation = {0, 0, 0, 0};
        bodies.place();
        std::vector<Verdict> verdicts(24);
        std::vector<PairDistance> distances(24);
        collide(bodies.view(), bodies.pairs, verdicts);
        distance(bodies.view(), bodies.pairs, distances, 1e-3f);
        for (size_t i = 0; i < 24; ++i) {
            const bool spoilt = i == 1 || i == 3 || i == 6 || i == 9 || i == 12;
            if (spoilt && std::isfinite(bad)) continue; // far away is a good answer
            EXPECT_EQ(verdicts[i] == Verdict::separated, !spoilt) << i << ' ' << bad;
            EXPECT_EQ(distances[i].lower > 0, !spoilt) << i << ' ' << bad;
            EXPECT_FALSE(spoilt && distances[i].upper < 0) << i;
        }
    }
}

// Far outside of the range of lanes, double precision answers.
TEST(Pairs, ExtremeSizesStayHonest) {
    for (const float unit : {0x1p-120f, 0x1p-80f, 0x1p-60f, 0x1p-40f, 0x1p40f, 0x1p60f, 0x1p90f}) {
        Bodies bodies;
        const Ellipsoid ball{{}, unit, 0, unit, 0, 0, unit};
        for (uint32_t i = 0; i < 16; ++i) {
            bodies.shapes.push_back(ball), bodies.shapes.push_back(ball);
            bodies.poses.push_back({}), bodies.poses.push_back({{(i % 2 ? 2.1f : 1.9f) * unit, 0, 0}, {}});
            bodies.pairs.push_back({2 * i, 2 * i + 1});
        }
        bodies.place();
        std::vector<Verdict> verdicts(16);
        std::vector<PairDistance> distances(16);
        collide(bodies.view(), bodies.pairs, verdicts);
        distance(bodies.view(), bodies.pairs, distances, 1e-3f * unit);
        for (size_t i = 0; i < 16; ++i) {
            EXPECT_EQ(verdicts[i], i % 2 ? Verdict::separated : Verdict::overlapping) << unit;
            EXPECT_LE(distances[i].lower, (i % 2 ? 0.1001f : -0.0999f) * unit) << unit;
            EXPECT_GE(distances[i].upper, (i % 2 ? 0.0999f : -0.1001f) * unit) << unit;
        }
    }
}

} // namespace
} // namespace prolate
