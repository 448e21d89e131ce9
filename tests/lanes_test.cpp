// The culling test: never separates what overlaps, and gives the same bits on every SIMD target as its scalar twin.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "tests/lanes_test.cpp"
#include "query/targets.hpp"

#include <hwy/foreach_target.h>

#include "query/lanes-inl.hpp"

#include "src/bytes.hpp"
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
    const LaneTag d;
    uint32_t bits = 0;
    for (size_t i = 0; i < kBlockLanes; i += hn::Lanes(d)) {
        const LaneTerms t = evaluate(load_nodes(block, i, step_exponent), single);
        bits |= bits_of(separated<false>(t, hn::Zero(d)), i);
        alignas(32) float gap[kBlockLanes], square[kBlockLanes], depth[kBlockLanes], size[kBlockLanes];
        hn::StoreU(t.gap, d, gap), hn::StoreU(sum_of_squares(t.x, t.y, t.z), d, square);
        hn::StoreU(hn::Div(t.p, t.sum), d, depth), hn::StoreU(t.size, d, size);
        for (size_t k = 0; k < hn::Lanes(d); ++k) out[i + k] = {gap[k], square[k], depth[k], size[k]};
    }
    return bits;
}

} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace prolate::query {
HWY_EXPORT(lane_gaps);

namespace {

using scenes::Point;
using scenes::Random;

// One node in a block of its own, and what it decodes to.
struct Node {
    std::array<std::byte, kBlockBytes> block{};
    LatticeInfo lattice{};
    Ellipsoid ellipsoid;
};

void store(Node& node, uint32_t lane, const format::PackedNode& packed) {
    const auto at = [&](size_t offset, size_t row) {
        return node.block.data() + offset + 2 * (kBlockLanes * row + lane);
    };
    for (size_t i = 0; i < 3; ++i) {
        store_le(at(kBlockCenter, i), packed.center[i]);
        store_le(at(kBlockDiagonal, i), packed.diagonal[i]);
        store_le(at(kBlockOffDiagonal, i), packed.off_diagonal[i]);
    }
    store_le(node.block.data() + kBlockExponent + lane, packed.exponent);
}

struct Family {
    double ratio;      // largest axis ratio
    double node;       // smallest node, of the body's size
    double offset;     // largest distance of the body from its own origin, body sizes
    double body_ratio; // largest ratio of the bodies' sizes
};

// A node of a body of size `body` (metres) that is `offset` away from its frame's origin.
Node node(Random& random, uint32_t lane, double body, const Family& family) {
    Node out;
    const Point away = random.direction();
    const double shift = random.in(0, family.offset) * body;
    double low[3], high[3], center[3];
    for (size_t i = 0; i < 3; ++i) low[i] = shift * away[i] - body / 2, high[i] = low[i] + body;
    const format::Lattice lattice = format::lattice_for(low, high);
    std::copy(lattice.origin, lattice.origin + 3, out.lattice.origin);
    out.lattice.step_exponent = lattice.step_exponent;
    for (size_t i = 0; i < 3; ++i) center[i] = random.in(low[i], high[i]);
    const Point radii = scenes::radii(random, family.ratio);
    const double size = body * random.log_in(family.node, 0.5);
    const Ellipsoid e = scenes::ellipsoid({}, {size * radii[0], size * radii[1], size * radii[2]}, random.rotation());
    const double factor[6] = {e.l11, e.l21, e.l22, e.l31, e.l32, e.l33};
    format::PackedNode packed;
    format::quantise(packed, lattice, center, factor);
    out.ellipsoid = format::decode(packed, lattice);
    store(out, lane, packed);
    return out;
}

struct Counts {
    uint32_t apart = 0, overlapping = 0, separated = 0, wrong = 0;
};

// Pairs within `spread` of contact, by the reference; `shrink` < 1 plants a fault: singles that are too small.
Counts hunt(uint64_t seed, uint32_t pairs, const Family& family, float shrink = 1, double least_spread = 1e-7) {
    Random random(seed);
    Counts counts;
    for (uint32_t n = 0; n < pairs; ++n) {
        const uint32_t lane = random.below(kBlockLanes), other = random.below(kBlockLanes);
        const double body = random.log_in(1e-3, 1e6);
        const Node a = node(random, lane, body, family);
        const Node b = node(random, other, body * random.log_in(1 / family.body_ratio, family.body_ratio), family);
        Pose pose_a, pose_b;
        pose_a.rotation = random.rotation(), pose_b.rotation = random.rotation();
        const Point d = random.direction();
        const auto center_of = [](const Node& x, const Quat& q) {
            return scenes::rotate(q, {x.ellipsoid.center.x, x.ellipsoid.center.y, x.ellipsoid.center.z});
        };
        const Point ca = center_of(a, pose_a.rotation), cb = center_of(b, pose_b.rotation);
        const auto at = [&](double t) {
            pose_b.translation =
                scenes::to_float({ca[0] - cb[0] + t * d[0], ca[1] - cb[1] + t * d[1], ca[2] - cb[2] + t * d[2]});
            return static_cast<double>(reference::contact({a.ellipsoid, pose_a, b.ellipsoid, pose_b}));
        };
        const double spread = random.log_in(least_spread, 0.3);
        const double start = body, now = at(start);
        const double contact = at(start / now * (1 + random.in(-spread, spread)));

        const RelativePose b_to_a = relative_pose(pose_a, pose_b);
        Single single = place(b.block.data(), other, lattice_pose(b_to_a, b.lattice, a.lattice));
        for (auto& column : single.factor)
            for (float& x : column) x *= shrink;
        LaneGap out[kBlockLanes];
        const uint32_t bits = HWY_DYNAMIC_DISPATCH(lane_gaps)(a.block.data(), a.lattice.step_exponent, single, out);
        const bool separated = (bits >> lane & 1) != 0;
        ++(contact > 1 ? counts.apart : counts.overlapping);
        counts.separated += separated;
        counts.wrong += separated && contact < 1;
        EXPECT_EQ(separated, out[lane].gap > 0);
    }
    return counts;
}

const Family kFamilies[] = {
    {5, 1e-3, 1, 1}, {100, 1e-3, 10, 10}, {1000, 1e-2, 1, 1}, {1000, 1e-3, 1e4, 1e3}, {30, 1e-4, 0, 1e6},
};

TEST(Lanes, NeverSeparateWhatOverlaps) {
    uint32_t seed = 0;
    for (const Family& family : kFamilies) {
        const Counts c = hunt(++seed, 20000, family);
        EXPECT_EQ(c.wrong, 0u) << "family " << seed;
        EXPECT_GT(c.apart, 20000u * 3 / 10);
        EXPECT_GT(c.overlapping, 20000u * 3 / 10);
        RecordProperty("separated" + std::to_string(seed), static_cast<int>(100.0 * c.separated / c.apart));
    }
}

TEST(Lanes, SeparateMostOfWhatIsApart) {
    const Counts c = hunt(1, 20000, {5, 1e-2, 0, 1}, 1, 0.1);
    EXPECT_GT(c.separated, c.apart * 6 / 10);
}

TEST(LanesHarness, CatchesASingleThatIsTooSmall) {
    EXPECT_GT(hunt(3, 20000, kFamilies[0], 1 - 1e-3f).wrong, 0u);
}

bool same(float x, float y) {
    return std::bit_cast<uint32_t>(x) == std::bit_cast<uint32_t>(y) || (std::isnan(x) && std::isnan(y));
}

TEST(Lanes, AllTargetsGiveTheBitsOfTheScalarTwin) {
    Random random(7);
    for (uint32_t n = 0; n < 4000; ++n) {
        Node a{};
        for (auto& byte : a.block) byte = static_cast<std::byte>(random.below(256)); // any bytes at all
        const Node b = node(random, 3, 1, kFamilies[0]);
        if (n % 2 == 0) { // and sensible ones
            a.lattice = b.lattice;
            for (uint32_t lane = 0; lane < kBlockLanes; ++lane) {
                const Node one = node(random, lane, 1, kFamilies[1]);
                for (size_t i = 0; i < kBlockBytes; ++i)
                    a.block[i] = lane == 0 ? one.block[i] : a.block[i] | one.block[i];
            }
        }
        Pose pose;
        pose.rotation = random.rotation(), pose.translation = scenes::to_float(random.in_ball());
        const Single single = place(b.block.data(), 3, lattice_pose(relative_pose({}, pose), b.lattice, a.lattice));
        targets::for_each([&](const char* target) {
            LaneGap out[kBlockLanes];
            const uint32_t bits = HWY_DYNAMIC_DISPATCH(lane_gaps)(a.block.data(), a.lattice.step_exponent, single, out);
            for (uint32_t lane = 0; lane < kBlockLanes; ++lane) {
                const LaneGap twin = lane_gap(a.block.data(), lane, a.lattice.step_exponent, single);
                ASSERT_EQ((bits >> lane & 1) != 0, twin.gap > 0) << target;
                ASSERT_TRUE(same(twin.square, out[lane].square) && same(twin.depth, out[lane].depth) &&
                            same(twin.size, out[lane].size) && (twin.gap == 0 || same(twin.gap, out[lane].gap)))
                    << target << " lane " << lane;
            }
        });
    }
}

} // namespace
} // namespace prolate::query
#endif // HWY_ONCE
