// The bounds of distance_lanes-inl.hpp: never above the distance, tight, and the same bits on every SIMD target as
// those of a scalar reference.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "tests/query/node/distance_lanes_test.cpp"
#include "query/simd/targets.hpp"

#include <hwy/foreach_target.h>

#include "query/node/distance_lanes-inl.hpp"
#include "query/node/place-inl.hpp"

#include "query/ellipsoid/gap.hpp"
#include "src/bytes.hpp"
#include "src/format.hpp"
#include "tests/reference.hpp"
#include "tests/scenes.hpp"
#include "tests/targets.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>

// What the kernel gives, for all targets.
#ifndef PROLATE_TESTS_DISTANCE_LANES
#define PROLATE_TESTS_DISTANCE_LANES
namespace prolate::query {
struct Placed {
    Single single;
    PlacedBox box;
};
struct Bounds {
    double lower[kBlockLanes];
    float size[kBlockLanes];
    uint32_t near;
};
} // namespace prolate::query
#endif

HWY_BEFORE_NAMESPACE();
namespace prolate::query::HWY_NAMESPACE {

void bounds_of_block(const std::byte* block, int32_t step_exponent, const Placed& one, double enough, Bounds& out) {
    LaneBounds bounds;
    bound_lanes(block, step_exponent, one.single, &one.box, enough, bounds);
    std::copy_n(bounds.lower, kBlockLanes, out.lower), std::copy_n(bounds.size, kBlockLanes, out.size);
    out.near = bounds.near;
}
void place_on_target(const std::byte* block, uint32_t lane, const LatticePose& pose, Placed& out) {
    out.single = place_here(block, lane, pose, &out.box);
}

} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace prolate::query {
HWY_EXPORT(bounds_of_block);
HWY_EXPORT(place_on_target);

namespace {

using reference::operator*;
using scenes::Point;
using scenes::Random;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct Block {
    std::array<std::byte, kBlockBytes> bytes{};
    LatticeInfo lattice{};
    Ellipsoid ellipsoids[kBlockLanes];
};

struct Family {
    double ratio;      // largest axis ratio
    double node;       // smallest node, of the body's size
    double offset;     // largest distance of the body from its own origin, body sizes
    double body_ratio; // largest ratio of the bodies' sizes
    double away;       // largest distance of the bodies, body sizes
};

// Boxes that hold everything.
void tell_nothing(Block& block) {
    for (size_t i = 0; i < 3 * kBlockLanes; ++i)
        block.bytes[kBlockBoxLow + i] = std::byte{0}, block.bytes[kBlockBoxHigh + i] = std::byte{255};
    for (size_t i = 0; i < 3; ++i) {
        store_le(block.bytes.data() + kBlockBoxOrigin + 4 * i, int32_t{-(1 << 27)});
        store_le(block.bytes.data() + kBlockBoxExponent + i, uint8_t{20});
    }
}

// Eight nodes of a body of size `body` (metres) that is `offset` away from its frame's origin, in boxes that tell
// nothing.
Block make(Random& random, double body, const Family& family) {
    Block out;
    const Point away = random.direction();
    const double shift = random.in(0, family.offset) * body;
    double low[3], high[3];
    for (size_t i = 0; i < 3; ++i) low[i] = shift * away[i] - body / 2, high[i] = low[i] + body;
    out.lattice = format::lattice_for(low, high);
    tell_nothing(out);
    for (uint32_t lane = 0; lane < kBlockLanes; ++lane) {
        double center[3];
        for (size_t i = 0; i < 3; ++i) center[i] = random.in(low[i], high[i]);
        const Point r = scenes::radii(random, family.ratio);
        const double size = body * random.log_in(family.node, 0.5);
        const Ellipsoid e = scenes::ellipsoid({}, {size * r[0], size * r[1], size * r[2]}, random.rotation());
        const double factor[6] = {e.l11, e.l21, e.l22, e.l31, e.l32, e.l33};
        format::PackedNode packed;
        format::quantise(packed, out.lattice, center, factor);
        out.ellipsoids[lane] = format::decode(packed, out.lattice);
        format::store_node(out.bytes.data(), lane, packed);
    }
    return out;
}

Bounds bounds_of(const Block& block, const Placed& one, double enough = kInfinity) {
    Bounds out;
    HWY_DYNAMIC_DISPATCH(bounds_of_block)(block.bytes.data(), block.lattice.step_exponent, one, enough, out);
    return out;
}
Placed placed(const Block& block, uint32_t lane, const LatticePose& pose) {
    Placed out;
    out.single = place(block.bytes.data(), lane, pose, &out.box);
    return out;
}

struct Pair {
    Block a, b;
    uint32_t lane; // of b
    Pose pose_a, pose_b;
    RelativePose b_to_a;
    LatticePose lattice_b_to_a;
};
// Two blocks, around the place where the centers of the nodes in `lane` meet.
Pair pair(Random& random, const Family& family) {
    const double body = random.log_in(1e-3, 1e6);
    Pair p{make(random, body, family),
           make(random, body * random.log_in(1 / family.body_ratio, family.body_ratio), family),
           random.below(kBlockLanes),
           {},
           {},
           {},
           {}};
    p.pose_a.rotation = random.rotation(), p.pose_b.rotation = random.rotation();
    const auto turned = [&](const Block& block, const Quat& q) {
        const Vec3& c = block.ellipsoids[p.lane].center;
        return scenes::rotate(q, {c.x, c.y, c.z});
    };
    const Point ca = turned(p.a, p.pose_a.rotation), cb = turned(p.b, p.pose_b.rotation), d = random.direction();
    const double t = body * random.log_in(1e-3, family.away);
    p.pose_b.translation =
        scenes::to_float({ca[0] - cb[0] + t * d[0], ca[1] - cb[1] + t * d[1], ca[2] - cb[2] + t * d[2]});
    p.b_to_a = relative_pose(p.pose_a, p.pose_b);
    p.lattice_b_to_a = lattice_pose(p.b_to_a, p.b.lattice, p.a.lattice);
    return p;
}

const Family kFamilies[] = {
    {5, 1e-3, 1, 1, 2},        {100, 1e-3, 10, 10, 2}, {1000, 1e-2, 1, 1, 2},
    {1000, 1e-3, 1e4, 1e3, 2}, {30, 1e-4, 0, 1e6, 10}, {10, 1e-3, 1, 1, 1e12},
};

// ---- ellipsoids, in boxes that tell nothing ----

struct Counts {
    uint32_t apart = 0, positive = 0, tight = 0, wrong = 0;
};

// `shrink` < 1 plants a fault: singles that are too small.
Counts hunt(uint64_t seed, uint32_t blocks, const Family& family, float shrink = 1) {
    Random random(seed);
    Counts counts;
    for (uint32_t n = 0; n < blocks; ++n) {
        const Pair p = pair(random, family);
        Placed one = placed(p.b, p.lane, p.lattice_b_to_a);
        for (auto& column : one.single.factor)
            for (float& x : column) x *= shrink;
        const Bounds bounds = bounds_of(p.a, one);
        const PlacedEllipsoid other = place(p.b.ellipsoids[p.lane], p.b_to_a);
        for (uint32_t i = 0; i < kBlockLanes; ++i) {
            const PlacedEllipsoid node = place(p.a.ellipsoids[i]);
            const Gap gap = distance_of(node, other, 0);
            const double bound = std::ldexp(bounds.lower[i], p.a.lattice.step_exponent);
            counts.wrong += bound > 0 && bound > gap.upper;
            if (!(gap.lower > 0)) continue;
            ++counts.apart;
            counts.positive += bound > 0;
            counts.tight += gap.lower - bound < 0.05 * gap.lower + 0.05 * std::min(node.size, other.size);
        }
    }
    return counts;
}

TEST(DistanceLanes, NeverExceedTheDistance) {
    uint64_t seed = 0;
    for (const Family& family : kFamilies) {
        const Counts c = hunt(++seed, 2000, family);
        EXPECT_EQ(c.wrong, 0u) << "family " << seed;
        EXPECT_GT(c.apart, 2000u) << "family " << seed;
        RecordProperty("positive" + std::to_string(seed), static_cast<int>(100.0 * c.positive / c.apart));
        RecordProperty("tight" + std::to_string(seed), static_cast<int>(100.0 * c.tight / c.apart));
    }
}

TEST(DistanceLanes, AreTight) {
    const Counts near = hunt(7, 2000, {5, 1e-2, 0, 1, 2}), far = hunt(8, 2000, {5, 1e-2, 0, 1, 1e9});
    EXPECT_GT(near.tight, near.apart * 8 / 10);
    EXPECT_GT(far.tight, far.apart * 98 / 100);
}

TEST(DistanceLanesHarness, CatchesASingleThatIsTooSmall) {
    EXPECT_GT(hunt(1, 2000, kFamilies[0], 1 - 1e-2f).wrong, 0u);
}

// ---- boxes ----

using Corners = std::array<std::array<double, 3>, 8>;

// Puts a box that lies in its ellipsoid, and is often flat or a point, into each lane; its corners, metres.
std::array<Corners, kBlockLanes> box_in(Random& random, Block& block) {
    std::array<Corners, kBlockLanes> out;
    const double step = std::ldexp(1, block.lattice.step_exponent);
    for (size_t i = 0; i < 3; ++i) {
        store_le(block.bytes.data() + kBlockBoxOrigin + 4 * i, int32_t{-30500});
        store_le(block.bytes.data() + kBlockBoxExponent + i, uint8_t{9});
    }
    for (uint32_t lane = 0; lane < kBlockLanes; ++lane) {
        // A cube of 0.5 within the unit ball, off its center; its axes are those of the ellipsoid only if it is a ball.
        const Point off = random.in_ball();
        const Ellipsoid& e = block.ellipsoids[lane];
        const PlacedEllipsoid placed_one = place(e);
        const double width = least_width(placed_one.factor, placed_one.size);
        for (size_t i = 0; i < 3; ++i) {
            const auto g = static_cast<glm::length_t>(i);
            const double half = random.below(3) == 0 ? 0 : 0.25 * width,
                         at = placed_one.center[g] + 0.5 * width * off[i];
            for (size_t corner = 0; corner < 8; ++corner)
                out[lane][corner][i] = (corner >> i & 1) != 0 ? at + half : at - half;
            const auto stored = [&](double x) { return (x / step - block.lattice.origin[i] + 30500) / 512; };
            store_le(block.bytes.data() + kBlockBoxLow + 8 * i + lane,
                     static_cast<uint8_t>(std::floor(stored(at - half))));
            store_le(block.bytes.data() + kBlockBoxHigh + 8 * i + lane,
                     static_cast<uint8_t>(std::ceil(stored(at + half))));
        }
    }
    return out;
}

struct BoxCounts {
    uint32_t apart = 0, better = 0, wrong = 0;
};
// `shrink` < 1 plants a fault: boxes that are too small.
BoxCounts hunt_boxes(uint64_t seed, uint32_t blocks, const Family& family, float shrink = 1) {
    Random random(seed);
    BoxCounts counts;
    for (uint32_t n = 0; n < blocks; ++n) {
        Pair p = pair(random, family);
        const Bounds without = bounds_of(p.a, placed(p.b, p.lane, p.lattice_b_to_a));
        const auto corners_a = box_in(random, p.a), corners_b = box_in(random, p.b);
        Placed one = placed(p.b, p.lane, p.lattice_b_to_a);
        for (auto& axis : one.box.axis)
            for (float& x : axis) x *= shrink;
        const Bounds bounds = bounds_of(p.a, one);
        const reference::Matrix ra = reference::rotation(p.pose_a.rotation),
                                rb = reference::rotation(p.pose_b.rotation);
        for (uint32_t lane = 0; lane < kBlockLanes; ++lane) {
            reference::Real least = HUGE_VALL;
            for (const auto& x : corners_a[lane])
                for (const auto& y : corners_b[p.lane]) {
                    const reference::Vector u = ra * reference::Vector{x[0], x[1], x[2]},
                                            v = rb * reference::Vector{y[0], y[1], y[2]};
                    const Vec3 &ta = p.pose_a.translation, &tb = p.pose_b.translation;
                    const reference::Vector d{v[0] + tb.x - u[0] - ta.x, v[1] + tb.y - u[1] - ta.y,
                                              v[2] + tb.z - u[2] - ta.z};
                    least = std::min(least, std::sqrt(reference::dot(d, d)));
                }
            const double bound = std::ldexp(bounds.lower[lane], p.a.lattice.step_exponent);
            ++counts.apart;
            counts.wrong += bound > static_cast<double>(least);
            counts.better += bounds.lower[lane] > without.lower[lane];
            EXPECT_GE(bounds.lower[lane], without.lower[lane]);
        }
    }
    return counts;
}

TEST(DistanceLanes, NeverExceedTheDistanceOfBoxes) {
    uint64_t seed = 10;
    for (const Family& family : {Family{1.5, 1e-1, 0, 1, 2}, Family{5, 1e-1, 1, 2, 2}, Family{1.1, 0.2, 0, 1, 20}}) {
        const BoxCounts c = hunt_boxes(++seed, 3000, family);
        EXPECT_EQ(c.wrong, 0u) << "family " << seed;
        EXPECT_GT(c.better, c.apart / 4) << "family " << seed;
    }
}
TEST(DistanceLanesHarness, CatchesABoxThatIsTooSmall) {
    EXPECT_GT(hunt_boxes(11, 3000, {1.1, 0.2, 0, 1, 20}, 0.5f).wrong, 0u);
}

// ---- bits ----

// A lane of bound_block(), the same operations in the same order.
struct Bound {
    double lower;
    float size;
};
Bound scalar_reference(const std::byte* block, uint32_t lane, int32_t step_exponent, const Placed& placed_one) {
    const Single& s = placed_one.single;
    const PlacedBox& box = placed_one.box;
    const LaneNode e = load_node(block, lane, step_exponent);
    const auto dot = [](float x, float y, float z, float u, float v, float w) { return (x * u + y * v) + z * w; };
    const float xx = e.l11 * e.l11, xy = e.l21 * e.l11, xz = e.l31 * e.l11;
    const float yy = e.l21 * e.l21 + e.l22 * e.l22, yz = e.l31 * e.l21 + e.l32 * e.l22;
    const float zz = dot(e.l31, e.l32, e.l33, e.l31, e.l32, e.l33);
    const float size = std::sqrt((xx + yy) + zz);
    const float rx = e.center[0] - s.center[0], ry = e.center[1] - s.center[1], rz = e.center[2] - s.center[2];
    const float sizes = size + s.size, beyond = 1.7320508f * std::sqrt(dot(rx, ry, rz, rx, ry, rz)) - sizes;
    const float excess = beyond > 0 ? beyond : 0;
    const float w2 = 1 / (size * (sizes + excess)), w1 = size * w2, round = 0.33333334f * (excess * w1);
    const float weight = w1 * s.weight;
    const auto mix = [&](float q1, float q2) { return weight * q1 + w2 * q2; };
    const float qxx = mix(s.diagonal[0], xx) + round, qyy = mix(s.diagonal[1], yy) + round;
    const float qzz = mix(s.diagonal[2], zz) + round;
    const float qyz = mix(s.off_diagonal[1], yz), qxz = mix(s.off_diagonal[2], xz), qxy = mix(s.off_diagonal[0], xy);
    const float axx = qyy * qzz - qyz * qyz, ayy = qxx * qzz - qxz * qxz, azz = qxx * qyy - qxy * qxy;
    const float axy = qxz * qyz - qxy * qzz, axz = qxy * qyz - qxz * qyy, ayz = qxy * qxz - qxx * qyz;
    float x = dot(axx, axy, axz, rx, ry, rz), y = dot(axy, ayy, ayz, rx, ry, rz), z = dot(axz, ayz, azz, rx, ry, rz);
    const float scale = 1 / std::sqrt(dot(x, y, z, x, y, z));
    x = x * scale, y = y * scale, z = z * scale;
    const auto along = [&](const float(&v)[4]) { return dot(v[0], v[1], v[2], x, y, z); };
    const float a1 = along(s.factor[0]), a2 = along(s.factor[1]), a3 = along(s.factor[2]);
    const float b1 = dot(e.l11, e.l21, e.l31, x, y, z), b2 = e.l22 * y + e.l32 * z, b3 = e.l33 * z;
    const auto lesser = [](float u, float v) { return v < u ? v : u; };
    const float box_a = along(box.center) +
                        ((std::abs(along(box.axis[0])) + std::abs(along(box.axis[1]))) + std::abs(along(box.axis[2])));
    float slack = 0, reached[3];
    for (size_t i = 0; i < 3; ++i) {
        const auto origin = static_cast<float>(load_le<int32_t>(block + kBlockBoxOrigin + 4 * i));
        const float step = std::bit_cast<float>((127 + int32_t{load_le<uint8_t>(block + kBlockBoxExponent + i)}) << 23);
        const auto side = [&](size_t array) {
            return static_cast<float>(load_le<uint8_t>(block + array + kBlockLanes * i + lane)) * step;
        };
        const float n = i == 0 ? x : i == 1 ? y : z, from = origin - e.center[i];
        reached[i] = std::min(n * (from + side(kBlockBoxLow)), n * (from + side(kBlockBoxHigh)));
        slack += std::abs(origin) + (65535 + 255 * step);
    }
    const float box_b = -((reached[0] + reached[1]) + reached[2]);
    const float a = lesser(std::sqrt(dot(a1, a2, a3, a1, a2, a3)) + kLaneMargin * s.size, box_a + box.slack);
    const float b = lesser(std::sqrt(dot(b1, b2, b3, b1, b2, b3)) + kLaneMargin * size, box_b + kBoxMargin * slack);
    const double nx = x, ny = y, nz = z;
    const double p = (nx * (double{e.center[0]} - s.exact[0]) + ny * (double{e.center[1]} - s.exact[1])) +
                     nz * (double{e.center[2]} - s.exact[2]);
    const double square = (nx * nx + ny * ny) + nz * nz;
    const double gap = (p - double{a + b}) - 0x1p-43 * (s.reach + double{kLargestCenter});
    const double factor = square <= 1 + 0x1p-20 ? (3.0 - square) * (0.5 - 0x1p-49) : 0.0;
    return {gap * factor, size};
}

template <class T> bool same(T x, T y) {
    return x == y || (std::isnan(x) && std::isnan(y));
}
template <class T, size_t N> bool same(const T (&x)[N], const T (&y)[N]) { // the fourth component means nothing
    return std::equal(x, x + 3, y, [](const T& u, const T& v) { return same(u, v); });
}

TEST(DistanceLanes, AllTargetsGiveTheBitsOfTheScalarReference) {
    Random random(20);
    uint32_t near = 0, far = 0;
    for (uint32_t n = 0; n < 3000; ++n) {
        Pair p = pair(random, kFamilies[n % std::size(kFamilies)]);
        if (n % 2 == 0) box_in(random, p.a), box_in(random, p.b);
        if (n % 3 == 0) { // any bytes at all
            for (auto& byte : p.a.bytes) byte = static_cast<std::byte>(random.below(256));
            for (size_t i = 0; i < 3; ++i) {
                store_le(p.a.bytes.data() + kBlockBoxOrigin + 4 * i,
                         static_cast<int32_t>(random.below(1 << 28)) - (1 << 27));
                store_le(p.a.bytes.data() + kBlockBoxExponent + i,
                         static_cast<uint8_t>(random.below(kMaxBoxExponent + 1)));
            }
        }
        const Placed one = placed(p.b, p.lane, p.lattice_b_to_a);
        targets::for_each([&](const char* target) {
            Placed here;
            HWY_DYNAMIC_DISPATCH(place_on_target)(p.b.bytes.data(), p.lane, p.lattice_b_to_a, here);
            const Single &x = one.single, &y = here.single;
            ASSERT_TRUE(same(x.exact, y.exact) && same(x.center, y.center) && same(x.factor, y.factor) &&
                        same(x.diagonal, y.diagonal) && same(x.off_diagonal, y.off_diagonal) && same(x.low, y.low) &&
                        same(x.high, y.high) && same(x.size, y.size) && same(x.weight, y.weight) &&
                        same(x.slack, y.slack) && same(x.reach, y.reach))
                << target;
            ASSERT_TRUE(same(one.box.center, here.box.center) && same(one.box.axis, here.box.axis) &&
                        same(one.box.slack, here.box.slack))
                << target;
            const double enough = 1000;
            const Bounds bounds = bounds_of(p.a, one, enough);
            for (uint32_t lane = 0; lane < kBlockLanes; ++lane) {
                const Bound expected = scalar_reference(p.a.bytes.data(), lane, p.a.lattice.step_exponent, one);
                ASSERT_TRUE(same(expected.lower, bounds.lower[lane]) && same(expected.size, bounds.size[lane]))
                    << target << " lane " << lane << ": " << expected.lower << " " << bounds.lower[lane];
                ASSERT_EQ((bounds.near >> lane & 1) != 0, !(expected.lower >= enough)) << target;
                ++((bounds.near >> lane & 1) != 0 ? near : far);
            }
        });
    }
    EXPECT_GT(near, far / 20);
    EXPECT_GT(far, near / 20);
}

} // namespace
} // namespace prolate::query
#endif // HWY_ONCE
