// The culling test, of ellipsoids and of boxes: never separates what overlaps, and gives the same bits on every SIMD
// target as its scalar reference.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "tests/query/node/lanes_test.cpp"
#include "query/simd/targets.hpp"

#include <hwy/foreach_target.h>

#include "query/node/hull_lanes-inl.hpp"

#include "src/bytes.hpp"
#include "tests/query/hunt.hpp"
#include "tests/query/lane_references.hpp"
#include "tests/reference.hpp"
#include "tests/scenes.hpp"
#include "tests/targets.hpp"

#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cmath>
#include <cstring>

HWY_BEFORE_NAMESPACE();
namespace prolate::query::HWY_NAMESPACE {

// All eight lanes as lane_gap() gives one; bit i of the result: lane i is separated.
uint32_t lane_gaps(const std::byte* block, int32_t step_exponent, const Single& single, LaneGap out[kBlockLanes]) {
    uint32_t separated_lanes = 0;
    for (size_t i = 0; i < kBlockLanes; i += kFloatLanes) {
        const LaneTerms t = evaluate(load_nodes(block, i, step_exponent), single);
        separated_lanes |= bits(separated<false>(t, set(0))) << i;
        alignas(32) float gap[kBlockLanes], square[kBlockLanes], depth[kBlockLanes], size[kBlockLanes];
        store(t.gap, gap), store(dot(t.n, t.n), square);
        store(t.p / t.sum, depth), store(t.size, size);
        for (size_t k = 0; k < kFloatLanes; ++k) out[i + k] = {gap[k], square[k], depth[k], size[k]};
    }
    return separated_lanes;
}

// Bit i: lane i certainly overlaps.
uint32_t overlap_bits(const std::byte* block, int32_t step_exponent, const Single& single) {
    uint32_t out = 0;
    for (size_t i = 0; i < kBlockLanes; i += kFloatLanes) {
        const LaneNodes e = load_nodes(block, i, step_exponent);
        out |= bits(overlapping(e, single, evaluate(e, single))) << i;
    }
    return out;
}

uint32_t box_bits(const std::byte* block, const Single& single, float margin) {
    return boxes_meet(block, single, margin);
}

void place_blocks(const std::byte* block, const LatticePose& pose, Single out[kBlockLanes]) {
    PlacedBlock placed;
    place_block(block, pose, placed);
    for (size_t lane = 0; lane < kBlockLanes; ++lane) out[lane] = placed[lane];
}

float reach_here(const std::byte* hull, float x, float y, float z, float width) {
    return hull_reach(hull, x, y, z, width);
}

} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace prolate::query {
HWY_EXPORT(lane_gaps);
HWY_EXPORT(box_bits);
HWY_EXPORT(overlap_bits);
HWY_EXPORT(place_blocks);
HWY_EXPORT(reach_here);

namespace {

using reference::Real;
using scenes::Point;
using scenes::Random;

// A full block, and what its nodes decode to.
struct Block {
    std::array<std::byte, kBlockBytes> bytes{};
    LatticeInfo lattice{};
    std::array<Ellipsoid, kBlockLanes> ellipsoids;
};

struct Family {
    double ratio;      // largest axis ratio
    double node;       // smallest node, of the body's size
    double offset;     // largest distance of the body from its own origin, body sizes
    double body_ratio; // largest ratio of the bodies' sizes
};

// Nodes of a body of size `body` (metres) that is `offset` away from its frame's origin.
Block block(Random& random, double body, const Family& family) {
    Block out;
    const Point away = random.direction();
    const double shift = random.in(0, family.offset) * body;
    double low[3], high[3];
    for (size_t i = 0; i < 3; ++i) low[i] = shift * away[i] - body / 2, high[i] = low[i] + body;
    out.lattice = format::lattice_for(low, high);
    std::array<format::PackedNode, kBlockLanes> nodes;
    for (uint32_t lane = 0; lane < kBlockLanes; ++lane) {
        double center[3];
        for (size_t i = 0; i < 3; ++i) center[i] = random.in(low[i], high[i]);
        const Point radii =
            family.ratio < hunt::kLargestRatio ? scenes::radii(random, family.ratio) : hunt::radii(random);
        const double size = body * random.log_in(family.node, 0.5);
        const Ellipsoid e =
            scenes::ellipsoid({}, {size * radii[0], size * radii[1], size * radii[2]}, random.rotation());
        const double factor[6] = {e.l11, e.l21, e.l22, e.l31, e.l32, e.l33};
        format::PackedNode& node = nodes[lane];
        format::quantise(node, out.lattice, center, factor);
        out.ellipsoids[lane] = format::decode(node, out.lattice);
        format::store_node(out.bytes.data(), lane, node);
    }
    format::store_boxes(out.bytes.data(), nodes, out.lattice);
    return out;
}

// What is planted to show that the hunt notices: singles whose factors, or boxes, are too small.
struct Fault {
    float factor = 1, box = 1;
};

struct Counts {
    uint64_t pairs = 0, apart = 0, separated = 0, boxes_apart = 0, very_near = 0, wrong = 0, boxes_wrong = 0;
    uint64_t overlapping = 0, overlaps_wrong = 0;
};

// Pairs of gaps between `least_gap` and 0.3 of their size, of both signs, added to `counts`.
void hunt_blocks(Random& random, const Family& family, double least_gap, const Fault& fault, Counts& counts) {
    constexpr uint32_t kPairs = 64; // of two blocks
    const double body = random.log_in(1e-3, 1e6);
    const Block a = block(random, body, family);
    const Block b = block(random, body * random.log_in(1 / family.body_ratio, family.body_ratio), family);
    for (uint32_t k = 0; k < kPairs; ++k) {
        const uint32_t lane = random.below(kBlockLanes), other = random.below(kBlockLanes);
        const Ellipsoid &e = a.ellipsoids[lane], &f = b.ellipsoids[other];
        Pose pose_a, pose_b;
        pose_a.rotation = random.rotation(), pose_b.rotation = random.rotation();
        // Every other normal is an axis of the boxes, which else hardly ever tell.
        Point n = random.direction();
        if (k % 2 == 0) n = {0, 0, 0}, n[k % 3] = 1, n = scenes::rotate(pose_a.rotation, n);
        const reference::Vector normal{n[0], n[1], n[2]};
        const reference::Pair before(e, pose_a, f, pose_b);
        Real size = 0;
        for (size_t i = 0; i < 3; ++i) size += hunt::length(before.l1[i]) + hunt::length(before.l2[i]);
        const double gap = random.log_in(least_gap, 0.3);
        hunt::part(e, pose_a, f, pose_b, normal, random.below(2) ? size * gap : -size * gap);

        const LatticePose pose = lattice_pose(relative_pose(pose_a, pose_b), b.lattice, a.lattice);
        Single single = place(b.bytes.data(), other, pose);
        if (k / 2 % 2 == 0) { // placed with its block
            Single all[kBlockLanes];
            HWY_DYNAMIC_DISPATCH(place_blocks)(b.bytes.data(), pose, all);
            single = all[other];
        }
        for (auto& column : single.factor)
            for (float& x : column) x *= fault.factor;
        for (size_t i = 0; i < 3; ++i) {
            const float middle = (single.low[i] + single.high[i]) / 2;
            single.low[i] = middle + fault.box * (single.low[i] - middle);
            single.high[i] = middle + fault.box * (single.high[i] - middle);
        }
        LaneGap out[kBlockLanes];
        const uint32_t bits = HWY_DYNAMIC_DISPATCH(lane_gaps)(a.bytes.data(), a.lattice.step_exponent, single, out);
        const bool separated = (bits >> lane & 1) != 0;
        const bool boxes_apart = (HWY_DYNAMIC_DISPATCH(box_bits)(a.bytes.data(), single, 0) >> lane & 1) == 0;

        const reference::Pair pair(e, pose_a, f, pose_b);
        const Real truth = hunt::gap_along(pair, normal);
        const bool wrong = (separated || boxes_apart) && truth <= 0 && hunt::overlap(pair, normal);
        ++counts.pairs, counts.apart += truth > 0, counts.very_near += std::abs(truth) < 1e-6L * size;
        counts.separated += separated, counts.boxes_apart += boxes_apart;
        counts.wrong += separated && wrong, counts.boxes_wrong += boxes_apart && wrong;
        EXPECT_EQ(separated, out[lane].gap > 0);
        const uint32_t overlaps = HWY_DYNAMIC_DISPATCH(overlap_bits)(a.bytes.data(), a.lattice.step_exponent, single);
        if ((overlaps >> lane & 1) == 0) continue;
        ++counts.overlapping, counts.overlaps_wrong += truth > 0 || !hunt::overlap(pair, normal);
    }
}

Counts hunt_some(uint64_t seed, uint64_t pairs, const Family& family, double least_gap, const Fault& fault = {}) {
    Random random(seed);
    Counts counts;
    while (counts.pairs < pairs) hunt_blocks(random, family, least_gap, fault, counts);
    return counts;
}

const Family kFamilies[] = {
    {5, 1e-3, 1, 1},    {100, 1e-3, 10, 10}, {hunt::kLargestRatio, 1e-2, 1, 1}, {hunt::kLargestRatio, 1e-3, 1e4, 1e3},
    {30, 1e-4, 0, 1e6},
};

TEST(Lanes, HuntForWrongVerdicts) {
    const hunt::Length length;
    Random random(1);
    Counts counts;
    for (size_t i = 0; length.more(counts.pairs); ++i) {
        hunt_blocks(random, kFamilies[i % std::size(kFamilies)], 1e-7, {}, counts);
        ASSERT_EQ(counts.wrong, 0u) << "blocks " << i;
        ASSERT_EQ(counts.boxes_wrong, 0u) << "blocks " << i;
        ASSERT_EQ(counts.overlaps_wrong, 0u) << "blocks " << i;
    }
    EXPECT_GT(counts.apart, counts.pairs * 2 / 5);
    EXPECT_LT(counts.apart, counts.pairs * 3 / 5);
    EXPECT_GT(counts.very_near, counts.pairs / 20); // the hunt is where the game is
    EXPECT_GT(counts.separated, counts.apart / 5);
    EXPECT_GT(counts.boxes_apart, counts.apart / 20);
    RecordProperty("pairs", std::to_string(counts.pairs));
    RecordProperty("separated", std::to_string(counts.separated));
    RecordProperty("boxes_apart", std::to_string(counts.boxes_apart));
}

TEST(Lanes, SeparateMostOfWhatIsApart) {
    const Counts c = hunt_some(1, 20000, {5, 1e-2, 0, 1}, 0.1);
    EXPECT_GT(c.separated, c.apart * 6 / 10);
    EXPECT_GT(c.overlapping, (c.pairs - c.apart) * 6 / 10);
}

TEST(LanesHarness, CatchesASingleThatIsTooSmall) {
    EXPECT_GT(hunt_some(3, 20000, kFamilies[0], 1e-7, {.factor = 1 - 1e-3f}).wrong, 0u);
    EXPECT_GT(hunt_some(3, 20000, kFamilies[0], 1e-3, {.factor = 0.9f}).overlaps_wrong, 0u); // the shape is as it was
}

TEST(LanesHarness, CatchesABoxThatIsTooSmall) {
    EXPECT_GT(hunt_some(4, 20000, kFamilies[0], 1e-3, {.box = 0.9f}).boxes_wrong, 0u);
}

bool same(float x, float y) {
    return std::bit_cast<uint32_t>(x) == std::bit_cast<uint32_t>(y) || (std::isnan(x) && std::isnan(y));
}

// Blocks placed at once: the same bits on all targets, and within the slack of nodes placed one by one.
void expect_blocks_to_be_placed(const Block& block, const LatticePose& pose) {
    Single first[kBlockLanes];
    bool known = false;
    targets::for_each([&](const char* target) {
        Single here[kBlockLanes];
        HWY_DYNAMIC_DISPATCH(place_blocks)(block.bytes.data(), pose, here);
        for (uint32_t lane = 0; lane < kBlockLanes; ++lane) {
            const Single &s = here[lane], &f = known ? first[lane] : s;
            const Single alone = place(block.bytes.data(), lane, pose);
            for (size_t i = 0; i < 3; ++i) {
                ASSERT_TRUE(same(s.center[i], f.center[i]) && same(s.diagonal[i], f.diagonal[i]) &&
                            same(s.off_diagonal[i], f.off_diagonal[i]) && same(s.low[i], f.low[i]) &&
                            same(s.high[i], f.high[i]))
                    << target;
                for (size_t c = 0; c < 3; ++c) {
                    ASSERT_TRUE(same(s.factor[c][i], f.factor[c][i])) << target;
                    ASSERT_NEAR(s.factor[c][i], alone.factor[c][i], kLaneMargin * s.size);
                }
                ASSERT_NEAR(s.center[i], alone.center[i], s.slack / 2);
                ASSERT_LE(s.low[i], s.center[i] - std::sqrt(s.diagonal[i]));
                ASSERT_GE(s.high[i], s.center[i] + std::sqrt(s.diagonal[i]));
            }
            ASSERT_TRUE(same(s.size, f.size) && same(s.weight, f.weight) && same(s.slack, f.slack)) << target;
            ASSERT_GT(s.slack, alone.slack);
        }
        std::copy_n(here, kBlockLanes, first);
        known = true;
    });
}

TEST(Lanes, AllTargetsGiveTheBitsOfTheScalarReference) {
    Random random(7);
    for (uint32_t n = 0; n < 4000; ++n) {
        const Block b = block(random, 1, kFamilies[0]);
        Block a = block(random, 1, kFamilies[1]);
        if (n % 2 == 0) { // any bytes at all, but for the exponents of boxes, which readers check
            for (auto& byte : a.bytes) byte = static_cast<std::byte>(random.below(256));
            for (size_t i = 0; i < 3; ++i)
                store_le(a.bytes.data() + kBlockBoxExponent + i, static_cast<uint8_t>(random.below(kMaxBoxExponent)));
        }
        Pose pose;
        pose.rotation = random.rotation(), pose.translation = scenes::to_float(random.in_ball());
        const LatticePose lattice = lattice_pose(relative_pose({}, pose), b.lattice, a.lattice);
        const Single single = place(b.bytes.data(), 3, lattice);
        expect_blocks_to_be_placed(b, lattice);
        targets::for_each([&](const char* target) {
            LaneGap out[kBlockLanes];
            const uint32_t bits = HWY_DYNAMIC_DISPATCH(lane_gaps)(a.bytes.data(), a.lattice.step_exponent, single, out);
            const uint32_t boxes = HWY_DYNAMIC_DISPATCH(box_bits)(a.bytes.data(), single, 1);
            for (uint32_t lane = 0; lane < kBlockLanes; ++lane) {
                const LaneGap expected = lane_gap(a.bytes.data(), lane, a.lattice.step_exponent, single);
                ASSERT_EQ((bits >> lane & 1) != 0, expected.gap > 0) << target;
                ASSERT_EQ((boxes >> lane & 1) == 0, boxes_apart(a.bytes.data(), lane, single, 1)) << target;
                ASSERT_TRUE(same(expected.square, out[lane].square) && same(expected.depth, out[lane].depth) &&
                            same(expected.size, out[lane].size) &&
                            (expected.gap == 0 || same(expected.gap, out[lane].gap)))
                    << target << " lane " << lane;
            }
        });
    }
}

TEST(Lanes, AllTargetsGiveTheHullReachOfTheScalarReference) {
    Random random(8);
    for (uint32_t n = 0; n < 4000; ++n) {
        std::array<std::byte, kHullBytes> hull;
        for (auto& byte : hull) byte = static_cast<std::byte>(random.below(256));
        if (n % 4 == 0) hull[kHullShare] = std::byte{0};
        float v[3];
        for (float& x : v) x = static_cast<float>(random.in(-1, 1) * random.log_in(1e-6, 1e6));
        const auto width = static_cast<float>(hunt::length({v[0], v[1], v[2]}));
        const float expected = hull_reach(hull.data(), v, width);
        EXPECT_TRUE(n % 4 != 0 || expected == width);
        targets::for_each([&](const char* target) {
            const float reach = HWY_DYNAMIC_DISPATCH(reach_here)(hull.data(), v[0], v[1], v[2], width);
            ASSERT_EQ(std::bit_cast<uint32_t>(reach), std::bit_cast<uint32_t>(expected)) << target;
        });
    }
}

} // namespace
} // namespace prolate::query
#endif // HWY_ONCE
