// Batches of pairs: hunts for wrong answers near contact, and what else the header promises.
//
// Pairs are made around a known normal n: with r = Q1 n / a + Q2 n / b + gap n the bodies are exactly `gap` apart, or
// touch from inside. Truth is then proved in long double for the floats that are really tested: a gap along n above 0
// separates them, a point with radial coordinates of at most 1 in both is common to them. Where neither holds (floats
// that round to contact) the slow reference decides.
//
// PROLATE_SOAK_PAIRS sets how many pairs are hunted, 10^6 if it is not set; ./run soak hunts 10^8.
#include "query/targets.hpp"

#include "query/gap.hpp"
#include "tests/reference.hpp"
#include "tests/scenes.hpp"

#include <prolate/pairs.hpp>

#include <gtest/gtest.h>

#include <hwy/highway.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <vector>

namespace prolate {
namespace {

using reference::inverse;
using reference::operator*;
using reference::operator-;
using reference::Real;
using reference::transposed;
using scenes::Point;
using scenes::Random;

#if defined(__SANITIZE_ADDRESS__)
constexpr uint64_t kPairs = 50'000; // the sanitizers look for errors of another kind
#elif defined(__has_feature)
#if __has_feature(address_sanitizer)
constexpr uint64_t kPairs = 50'000;
#else
constexpr uint64_t kPairs = 1'000'000;
#endif
#else
constexpr uint64_t kPairs = 1'000'000;
#endif

uint64_t hunted_pairs() {
    const char* text = std::getenv("PROLATE_SOAK_PAIRS");
    return text ? std::strtoull(text, nullptr, 10) : kPairs;
}

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

Real length(const reference::Vector& v) {
    return std::sqrt(reference::dot(v, v));
}

// Radii with the largest 1: needles, discs and anything between, up to the axis ratio of 1000 that bakes keep.
Point radii(Random& random) {
    const double thin = 1 / random.log_in(1, 1000);
    Point r{};
    switch (random.below(3)) {
    case 0:
        r = {1, thin, thin * random.in(1, 1.5)};
        break;
    case 1:
        r = {1, random.in(0.5, 1), thin};
        break;
    default:
        r = scenes::radii(random, random.log_in(1, 1000));
        break;
    }
    for (double& x : r) x = std::clamp(x, 1e-3, 1.0);
    std::swap(r[0], r[random.below(3)]);
    return r;
}

struct Family {
    double least_gap = 1e-7, most_gap = 1; // of the pair's size, of both signs
    double offset = 0;                     // both bodies away from the origin, of their size
    double own_center = 0;                 // bodies away from their own origin
    double least_unit = 1, most_unit = 1;  // metres
};
const Family kFamilies[] = {
    {},
    {.least_gap = 1e-7, .most_gap = 1e-5},
    {.least_unit = 1e-3, .most_unit = 1e6},
    {.offset = 1e4},
    {.offset = 100, .least_unit = 1e-3, .most_unit = 1e6},
    {.least_gap = 1e-6, .own_center = 10},
};

// Appends a pair.
void add_pair(Random& random, const Family& family, Bodies& out) {
    const double unit = random.log_in(family.least_unit, family.most_unit), ratio = random.log_in(0.1, 10);
    const auto shape = [&](double size) {
        const Point r = radii(random), d = random.direction();
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
    const reference::Pair here(a, pose_a, b, pose_b);
    const reference::Vector normal{n[0], n[1], n[2]}, qa = here.q1 * normal, qb = here.q2 * normal;
    const Real ka = length(transposed(here.l1) * normal), kb = length(transposed(here.l2) * normal);
    const double size = unit * (1 + ratio);
    const double gap = (random.below(2) ? 1 : -1) * size * random.log_in(family.least_gap, family.most_gap);
    Point t{};
    const float* at[3] = {&pose_b.translation.x, &pose_b.translation.y, &pose_b.translation.z};
    for (size_t i = 0; i < 3; ++i)
        t[i] = static_cast<double>(*at[i] - here.r[i] + qa[i] / ka + qb[i] / kb + gap * normal[i]);
    pose_b.translation = scenes::to_float(t);

    const auto first = static_cast<uint32_t>(out.shapes.size());
    out.shapes.push_back(a), out.shapes.push_back(b);
    out.poses.push_back(pose_a), out.poses.push_back(pose_b);
    out.pairs.push_back({first, first + 1});
    out.normals.push_back(normal);
}

Bodies make(uint64_t seed, const Family& family, size_t count) {
    Random random(seed);
    Bodies out;
    for (size_t i = 0; i < count; ++i) add_pair(random, family, out);
    out.place();
    return out;
}

reference::Pair exact(const Bodies& bodies, size_t i) {
    return {bodies.shapes[2 * i], bodies.poses[2 * i], bodies.shapes[2 * i + 1], bodies.poses[2 * i + 1]};
}

Real gap_along(const reference::Pair& pair, const reference::Vector& n) {
    return (reference::dot(n, pair.r) - length(transposed(pair.l1) * n) - length(transposed(pair.l2) * n)) / length(n);
}

// Do the bodies share a point? Both ends of the least distance, or the point half-way, are tried before the reference.
bool overlap(const reference::Pair& pair, const reference::Vector& n) {
    if (gap_along(pair, n) > 0) return false;
    const reference::Vector qa = pair.q1 * n, qb = pair.q2 * n;
    const Real ka = length(transposed(pair.l1) * n), kb = length(transposed(pair.l2) * n);
    reference::Vector middle;
    for (size_t i = 0; i < 3; ++i) middle[i] = (qa[i] / ka + pair.r[i] - qb[i] / kb) / 2;
    if (length(inverse(pair.l1) * middle) <= 1 && length(inverse(pair.l2) * (middle - pair.r)) <= 1) return true;
    return reference::contact(pair) <= 1;
}

struct Tally {
    uint64_t pairs = 0, separated = 0, false_separated = 0, false_overlapping = 0, unlike_single = 0, in_double = 0;
    uint64_t very_near = 0; // gaps of at most 1e-6 of the size
    void add(const Bodies& bodies, std::span<const Verdict> verdicts) {
        for (size_t i = 0; i < verdicts.size(); ++i) {
            const reference::Pair pair = exact(bodies, i);
            const bool apart = verdicts[i] == Verdict::separated;
            // contact() is good to 1e-14: what is nearer is not claimed to be wrong.
            if (apart && overlap(pair, bodies.normals[i])) ++false_separated;
            if (!apart && gap_along(pair, bodies.normals[i]) > 1e-9 * (length(pair.l1[0]) + length(pair.r)))
                ++false_overlapping;
            unlike_single += verdicts[i] != collide(bodies.shapes[2 * i], bodies.poses[2 * i], bodies.shapes[2 * i + 1],
                                                    bodies.poses[2 * i + 1]);
            very_near += std::abs(gap_along(pair, bodies.normals[i])) <
                         1e-6 * (length(pair.l1[0]) + length(pair.l1[1]) + length(pair.l1[2]));
            separated += apart;
        }
        pairs += verdicts.size();
    }
};

TEST(Pairs, VerdictsAreTrueAndThoseOfSinglePairs) {
    constexpr size_t kBatch = 4096;
    Tally tally;
    std::vector<Verdict> verdicts(kBatch);
    for (uint64_t seed = 0; tally.pairs < hunted_pairs(); ++seed) {
        const Bodies bodies = make(seed, kFamilies[seed % std::size(kFamilies)], kBatch);
        tally.in_double += collide(bodies.view(), bodies.pairs, verdicts).in_double;
        tally.add(bodies, verdicts);
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
}

// The harness itself: with margins of the wrong sign the lanes are wrong, and that is seen. (Without margins they
// hardly ever are: worst cases of rounding do not come together.)
TEST(Pairs, WrongMarginsAreCaught) {
    Bodies bodies = make(7, kFamilies[1], 20'000);
    std::vector<Verdict> verdicts(bodies.pairs.size());
    for (WorldEllipsoid& e : bodies.world) e.slack = -e.slack, e.thinness = 0;
    collide(bodies.view(), bodies.pairs, verdicts);
    Tally bare;
    bare.add(bodies, verdicts);
    EXPECT_GT(bare.false_separated, 1000u);
    EXPECT_GT(bare.false_overlapping, 100u);
    EXPECT_GT(bare.unlike_single, 1000u);

    bodies.place();
    for (WorldEllipsoid& e : bodies.world)
        for (float& l : e.factor) l *= 1 - 0x1p-18f;
    collide(bodies.view(), bodies.pairs, verdicts);
    Tally shrunk;
    shrunk.add(bodies, verdicts);
    EXPECT_GT(shrunk.false_separated, 100u);
}

// What is certified of distances, for both signs.
TEST(Pairs, DistancesAreBounds) {
    uint64_t pairs = 0, apart = 0, inside = 0, loose = 0, in_double = 0;
    for (uint64_t seed = 0; seed < 24; ++seed) {
        Family family = kFamilies[seed % std::size(kFamilies)];
        family.least_gap = 1e-6;
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
