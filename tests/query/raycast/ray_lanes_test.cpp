// The culling tests of rays: never miss what a ray meets, and give the same bits on every SIMD target as their scalar
// twins.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "tests/query/raycast/ray_lanes_test.cpp"
#include "query/simd/targets.hpp"

#include <hwy/foreach_target.h>

#include "query/raycast/lanes-inl.hpp"

#include "tests/query/blocks.hpp"
#include "tests/query/lane_references.hpp"
#include "tests/reference.hpp"
#include "tests/scenes.hpp"
#include "tests/targets.hpp"

#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

HWY_BEFORE_NAMESPACE();
namespace prolate::query::HWY_NAMESPACE {

AxisMask block_mask(const std::byte* block, int32_t step_exponent, const LatticePoint& point, uint32_t axis) {
    return axis == 0   ? axis_block<0>(block, step_exponent, point)
           : axis == 1 ? axis_block<1>(block, step_exponent, point)
                       : axis_block<2>(block, step_exponent, point);
}

void placed_ray(const double (&origin)[4], const double (&span)[4], double reach, double thickness, LatticeRay& out) {
    place_in_lattice(origin, span, reach, thickness, out);
}

void block_entries(const std::byte* block, int32_t step_exponent, const LatticeRay& ray, float limit,
                   float entries[kBlockLanes]) {
    for (size_t i = 0; i < kBlockLanes; i += kFloatLanes) {
        const LaneNodes nodes = load_nodes(block, i, step_exponent);
        store_unaligned(ray.thickness > 0 ? entry_lanes<true>(nodes, ray, set(limit))
                                          : entry_lanes<false>(nodes, ray, set(limit)),
                        entries + i);
    }
}

void block_box_entries(const std::byte* block, const LatticeRay& ray, float limit, float entries[kBlockLanes]) {
    const BoxRay boxes = box_ray(block, ray);
    for (size_t i = 0; i < kBlockLanes; i += kFloatLanes) {
        const BoxTimes times = box_times(block, i, ray, boxes, set(limit));
        const Float never = set(std::numeric_limits<float>::infinity());
        store_unaligned(choose(times.enter > times.leave, never, times.enter), entries + i);
    }
}

} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace prolate::query {
HWY_EXPORT(block_mask);
HWY_EXPORT(placed_ray);
HWY_EXPORT(block_entries);
HWY_EXPORT(block_box_entries);

namespace {

using reference::Matrix;
using reference::Real;
using reference::Vector;
using reference::operator*;
using reference::operator-;
using scenes::Block;
using scenes::Point;
using scenes::Random;

// Where the line o + s span meets the ellipsoid; empty if from > to.
struct Chord {
    Real from, to;
};
Chord chord(const Ellipsoid& e, const Vector& o, const Vector& span) {
    const Matrix to_ball = reference::inverse(scenes::factor_of(e));
    const Vector y = to_ball * (o - Vector{e.center.x, e.center.y, e.center.z}), v = to_ball * span;
    const Real vv = reference::dot(v, v), middle = -reference::dot(y, v) / vv;
    const Vector m{y[0] + middle * v[0], y[1] + middle * v[1], y[2] + middle * v[2]};
    const Real inside = 1 - reference::dot(m, m);
    if (!(inside >= 0)) return {1, 0};
    const Real half = std::sqrt(inside / vv);
    return {middle - half, middle + half};
}

// A ray that grazes lane `lane`: through a point `distance` (of the thinnest radius) off its surface, in a tangent.
struct Grazing {
    Vector origin, span; // metres
};
Grazing grazing(Random& random, const Ellipsoid& e, const LatticeInfo& lattice) {
    const Matrix l = scenes::factor_of(e);
    const Point u = random.direction(), w = random.direction();
    const Real off = 1 + random.log_in(1e-7, 1) * (random.below(2) == 0 ? 1 : -1);
    Vector in{u[0], u[1], u[2]}, tangent = reference::cross(in, {w[0], w[1], w[2]});
    const Real turn = random.in(-0.1, 0.1); // some enter the ellipsoid
    const Vector p = l * Vector{off * in[0], off * in[1], off * in[2]};
    const Vector t = l * Vector{tangent[0] + turn * in[0], tangent[1] + turn * in[1], tangent[2] + turn * in[2]};
    const Real length = std::sqrt(reference::dot(t, t));
    const Real reach = std::ldexp(Real{1}, lattice.step_exponent) * 65536 * random.log_in(1e-3, 1.5);
    const Real begin = random.in(-0.2, 1.1);
    Grazing out;
    for (size_t i = 0; i < 3; ++i) {
        out.span[i] = t[i] / length * reach;
        out.origin[i] = (Real{(&e.center.x)[i]} + p[i]) - begin * out.span[i];
    }
    return out;
}

// As a query would place it, all in double.
LatticeRay place(const Grazing& g, const LatticeInfo& lattice, double slack_factor, double thickness = 0) {
    const double per_step = std::ldexp(1.0, -lattice.step_exponent);
    double origin[4] = {}, span[4] = {}, reach = 0;
    for (size_t i = 0; i < 3; ++i) {
        origin[i] = static_cast<double>(g.origin[i]) * per_step - lattice.origin[i];
        span[i] = static_cast<double>(g.span[i]) * per_step;
        reach += std::abs(origin[i]) + std::abs(span[i]) + 2 * std::abs(static_cast<double>(lattice.origin[i]));
    }
    LatticeRay ray;
    HWY_DYNAMIC_DISPATCH(placed_ray)(origin, span, reach, thickness * per_step, ray);
    ray.slack *= static_cast<float>(slack_factor);
    for (size_t i = 0; i < 3; ++i) ray.margin[i] = (ray.thickness + ray.slack) * std::abs(ray.inverse[i]);
    return ray;
}

struct Counts {
    uint32_t rays = 0, met = 0, missed = 0, wrong = 0, loose = 0;
};

Counts hunt_rays(uint64_t seed, uint32_t blocks, double ratio, double slack_factor = 1) {
    Random random(seed);
    Counts counts;
    for (uint32_t n = 0; n < blocks; ++n) {
        const Block b = scenes::block(random, ratio);
        const Grazing g = grazing(random, b.ellipsoids[random.below(kBlockLanes)], b.lattice);
        const LatticeRay ray = place(g, b.lattice, slack_factor);
        const float limit = random.below(2) == 0 ? 1.0f : static_cast<float>(random.unit());
        float entries[kBlockLanes];
        HWY_DYNAMIC_DISPATCH(block_entries)(b.bytes.data(), b.lattice.step_exponent, ray, limit, entries);
        for (uint32_t lane = 0; lane < kBlockLanes; ++lane) {
            const Chord truth = chord(b.ellipsoids[lane], g.origin, g.span);
            const Real first = std::max(truth.from, Real{0});
            const bool meets = truth.from <= truth.to && truth.to >= 0 && first <= limit;
            ++counts.rays, counts.met += meets;
            counts.missed += std::isinf(entries[lane]);
            counts.wrong += meets && !(entries[lane] <= first);
            counts.loose += meets && entries[lane] < first - 1e-3L;
            counts.loose += !meets && !std::isinf(entries[lane]);
        }
    }
    return counts;
}

TEST(RayLanes, NeverMissWhatARayMeets) {
    for (const double ratio : {3.0, 50.0, 1000.0}) {
        const Counts c = hunt_rays(1, 20'000, ratio);
        EXPECT_EQ(c.wrong, 0u) << ratio;
        EXPECT_GT(c.met, c.rays / 20) << ratio;
        EXPECT_GT(c.missed, c.rays / 2) << ratio;
        EXPECT_LT(c.loose, c.rays / 10) << ratio; // the margin is a fifth of a lattice step
    }
}

TEST(RayLanes, TheHuntNoticesWrongMargins) {
    EXPECT_GT(hunt_rays(1, 5'000, 50, -1).wrong, 0u);
    EXPECT_GT(hunt_rays(1, 5'000, 50, -8).wrong, 10u);
}

// Thick rays beside a lane: `thickness` off a point of its surface, along it, but for a gap. Counts that lane alone.
Counts hunt_thick_rays(uint64_t seed, uint32_t blocks, double ratio, double slack_factor = 1) {
    Random random(seed);
    Counts counts;
    for (uint32_t n = 0; n < blocks; ++n) {
        const Block b = scenes::block(random, ratio);
        const std::byte* const bytes = b.bytes.data();
        const uint32_t lane = random.below(kBlockLanes);
        const Ellipsoid& e = b.ellipsoids[lane];
        const Matrix l = scenes::factor_of(e);
        const Point u = random.direction(), w = random.direction();
        const Vector support = reference::transposed(l) * Vector{u[0], u[1], u[2]};
        const Real k = 1 / std::sqrt(reference::dot(support, support));
        const Vector x = l * Vector{k * support[0], k * support[1], k * support[2]}; // farthest along u
        const Vector tangent = reference::cross({u[0], u[1], u[2]}, {w[0], w[1], w[2]});
        const double size = std::ldexp(65536, b.lattice.step_exponent), thickness = size * random.log_in(1e-4, 0.3);
        const Real gap = thickness * random.log_in(1e-6, 1) * (random.below(2) == 0 ? 1 : -1);
        const Real turn = random.below(2) == 0 ? 0 : random.in(-0.1, 0.1);
        const Real begin = random.in(-0.2, 1.1), length = size * random.log_in(1e-2, 1.5);
        Grazing g{};
        for (size_t i = 0; i < 3; ++i) {
            g.span[i] = length * (tangent[i] + turn * u[i]);
            g.origin[i] = Real{(&e.center.x)[i]} + x[i] + (thickness + gap) * u[i] - begin * g.span[i];
        }
        const bool meets = gap < 0 && begin >= 0 && begin <= 1; // at that point, and perhaps before
        const LatticeRay ray = place(g, b.lattice, slack_factor, thickness);
        float entries[kBlockLanes], boxes[kBlockLanes];
        HWY_DYNAMIC_DISPATCH(block_entries)(bytes, b.lattice.step_exponent, ray, 1, entries);
        HWY_DYNAMIC_DISPATCH(block_box_entries)(bytes, ray, 1, boxes);
        ++counts.rays, counts.met += meets, counts.missed += std::isinf(entries[lane]);
        counts.wrong += meets && !(std::max(entries[lane], boxes[lane]) <= begin);
    }
    return counts;
}

TEST(RayLanes, ThickRaysNeverMissWhatTheyComeNear) {
    for (const double ratio : {3.0, 50.0, 1000.0}) {
        const Counts c = hunt_thick_rays(5, 40'000, ratio);
        EXPECT_EQ(c.wrong, 0u) << ratio;
        EXPECT_GT(c.met, c.rays / 4) << ratio;
        EXPECT_GT(c.missed, c.rays / 50) << ratio;
    }
    EXPECT_GT(hunt_thick_rays(5, 20'000, 3, -8).wrong, 0u);
}

// Boxes, for rays that pass their corners and edges, some of them along an axis or in a plane.
Counts hunt_boxes(uint64_t seed, uint32_t blocks, double slack_factor = 1) {
    Random random(seed);
    Counts counts;
    for (uint32_t n = 0; n < blocks; ++n) {
        const Block b = scenes::block(random, 3);
        const std::byte* const bytes = b.bytes.data();
        const Real step = std::ldexp(Real{1}, b.lattice.step_exponent);
        const auto side = [&](size_t array, size_t i, uint32_t lane) { // metres
            const int32_t exponent = load_le<uint8_t>(bytes + kBlockBoxExponent + i);
            const Real x =
                std::ldexp(static_cast<Real>(load_le<uint8_t>(bytes + array + kBlockLanes * i + lane)), exponent);
            return (x + load_le<int32_t>(bytes + kBlockBoxOrigin + 4 * i) + b.lattice.origin[i]) * step;
        };
        const uint32_t aim = random.below(kBlockLanes);
        Grazing g{};
        const Point d = random.direction();
        for (size_t i = 0; i < 3; ++i) {
            Real at = side(random.below(2) == 0 ? kBlockBoxLow : kBlockBoxHigh, i, aim);
            at += step * random.log_in(1e-6, 1e3) * (random.below(2) == 0 ? 1 : -1);
            g.span[i] = random.below(3) == 0 ? 0 : d[i] * 65536 * step;
            g.origin[i] = at - random.in(-0.1, 0.9) * g.span[i];
        }
        const LatticeRay ray = place(g, b.lattice, slack_factor);
        float entries[kBlockLanes];
        HWY_DYNAMIC_DISPATCH(block_box_entries)(bytes, ray, 1, entries);
        for (uint32_t lane = 0; lane < kBlockLanes; ++lane) {
            Real enter = 0, leave = 1;
            for (size_t i = 0; i < 3; ++i) {
                const Real low = side(kBlockBoxLow, i, lane) - g.origin[i],
                           high = side(kBlockBoxHigh, i, lane) - g.origin[i];
                if (g.span[i] == 0) {
                    if (low > 0 || high < 0) leave = -1;
                } else {
                    enter = std::max(enter, std::min(low / g.span[i], high / g.span[i]));
                    leave = std::min(leave, std::max(low / g.span[i], high / g.span[i]));
                }
            }
            const bool meets = enter <= leave;
            ++counts.rays, counts.met += meets, counts.missed += std::isinf(entries[lane]);
            counts.wrong += meets && !(entries[lane] <= enter);
            counts.loose += meets ? entries[lane] < enter - 1e-3L : !std::isinf(entries[lane]);
        }
    }
    return counts;
}

TEST(RayLanes, NeverMissABoxThatARayMeets) {
    const Counts c = hunt_boxes(4, 50'000);
    EXPECT_EQ(c.wrong, 0u);
    EXPECT_GT(c.met, c.rays / 25);
    EXPECT_GT(c.missed, c.rays / 2);
    EXPECT_LT(c.loose, c.rays / 10);
    EXPECT_GT(hunt_boxes(4, 10'000, -1).wrong, 0u);
}

Counts hunt_axes(uint64_t seed, uint32_t blocks, double ratio, double slack_factor = 1) {
    Random random(seed);
    Counts counts;
    for (uint32_t n = 0; n < blocks; ++n) {
        const Block b = scenes::block(random, ratio);
        const uint32_t axis = random.below(3);
        // A point whose line along the axis touches the shadow of a lane, or nearly so.
        const Ellipsoid& e = b.ellipsoids[random.below(kBlockLanes)];
        const Matrix l = scenes::factor_of(e);
        const Point u = random.direction();
        const Vector normal{axis == 0 ? 0 : u[0], axis == 1 ? 0 : u[1], axis == 2 ? 0 : u[2]};
        const Vector y = reference::transposed(l) * normal;
        const Real length = std::sqrt(reference::dot(y, y)),
                   off = 1 + random.log_in(1e-7, 1) * (random.below(2) == 0 ? 1 : -1);
        const Vector rim = l * Vector{y[0] / length * off, y[1] / length * off, y[2] / length * off};
        Vector p{e.center.x + rim[0], e.center.y + rim[1], e.center.z + rim[2]};
        p[axis] += random.in(-2, 2) * std::sqrt(reference::dot(l[axis], l[axis]));
        PlacedPoint point{{static_cast<double>(p[0]), static_cast<double>(p[1]), static_cast<double>(p[2])}, 0};
        point.reach = std::sqrt(static_cast<double>(reference::dot(p, p)));
        LatticePoint placed = lattice_point(point, b.lattice);
        placed.slack *= static_cast<float>(slack_factor);
        const AxisMask mask = HWY_DYNAMIC_DISPATCH(block_mask)(b.bytes.data(), b.lattice.step_exponent, placed, axis);
        Vector direction{};
        direction[axis] = 1;
        for (uint32_t lane = 0; lane < kBlockLanes; ++lane) {
            const Vector origin{point.position.x, point.position.y, point.position.z};
            const Chord truth = chord(b.ellipsoids[lane], origin, direction);
            const bool line = truth.from <= truth.to;
            const bool ahead = (mask.ahead >> lane & 1) != 0, behind = (mask.behind >> lane & 1) != 0;
            ++counts.rays, counts.met += line;
            counts.missed += !ahead && !behind;
            counts.wrong += line && ((truth.to >= 0 && !ahead) || (truth.from <= 0 && !behind));
            counts.loose += !line && (ahead || behind);
        }
    }
    return counts;
}

TEST(RayLanes, AxesNeverMissWhatTheyMeet) {
    for (const double ratio : {3.0, 50.0, 1000.0}) {
        const Counts c = hunt_axes(2, 20'000, ratio);
        EXPECT_EQ(c.wrong, 0u) << ratio;
        EXPECT_GT(c.met, c.rays / 20) << ratio;
        EXPECT_GT(c.missed, c.rays / 2) << ratio;
        EXPECT_LT(c.loose, c.rays / 10) << ratio; // the margin is a fifth of a lattice step
    }
}

TEST(RayLanes, TheHuntOfAxesNoticesWrongMargins) {
    EXPECT_GT(hunt_axes(2, 5'000, 50, -1).wrong, 0u);
    EXPECT_GT(hunt_axes(2, 5'000, 50, -8).wrong, 10u);
}

TEST(RayLanes, SameBitsOnEveryTargetAndInPlainCode) {
    int compared = 0;
    targets::for_each([&](const char* name) {
        Random random(3);
        for (int n = 0; n < 2'000; ++n) {
            Block b = scenes::block(random, 100);
            // Also what no builder writes: any bytes at all, but for nodes' exponents, which open() checks.
            if (n % 4 == 0) {
                for (std::byte& x : b.bytes) x = static_cast<std::byte>(random.next());
                for (uint32_t lane = 0; lane < kBlockLanes; ++lane)
                    store_le(b.bytes.data() + kBlockExponent + lane,
                             static_cast<int8_t>(b.lattice.step_exponent + kMinNodeSize +
                                                 static_cast<int32_t>(random.below(kMaxNodeSize - kMinNodeSize))));
            }
            const Grazing g = grazing(random, b.ellipsoids[random.below(kBlockLanes)], b.lattice);
            const double thickness = n % 3 == 0 ? std::ldexp(random.in(0, 1e4), b.lattice.step_exponent) : 0;
            const LatticeRay ray = place(g, b.lattice, 1, thickness);
            const PlacedPoint point{
                {static_cast<double>(g.origin[0]), static_cast<double>(g.origin[1]), static_cast<double>(g.origin[2])},
                1};
            const LatticePoint origin = lattice_point(point, b.lattice);
            const int32_t step = b.lattice.step_exponent;
            float entries[kBlockLanes];
            HWY_DYNAMIC_DISPATCH(block_entries)(b.bytes.data(), step, ray, 0.75f, entries);
            for (uint32_t lane = 0; lane < kBlockLanes; ++lane) {
                const float expected = ray_entry(b.bytes.data(), lane, step, ray, 0.75f);
                ASSERT_EQ(std::bit_cast<uint32_t>(expected), std::bit_cast<uint32_t>(entries[lane]))
                    << name << ' ' << n;
            }
            for (uint32_t axis = 0; axis < 3; ++axis) {
                const AxisMask mask = HWY_DYNAMIC_DISPATCH(block_mask)(b.bytes.data(), step, origin, axis);
                for (uint32_t lane = 0; lane < kBlockLanes; ++lane) {
                    const AxisMask expected = axis_mask(b.bytes.data(), lane, step, origin, axis);
                    ASSERT_EQ(expected.ahead, mask.ahead >> lane & 1) << name << ' ' << n << ' ' << axis;
                    ASSERT_EQ(expected.behind, mask.behind >> lane & 1) << name << ' ' << n << ' ' << axis;
                }
            }
            if (b.bytes[kBlockBoxExponent] > std::byte{kMaxBoxExponent}) continue; // open() refuses these
            HWY_DYNAMIC_DISPATCH(block_box_entries)(b.bytes.data(), ray, 0.75f, entries);
            for (uint32_t lane = 0; lane < kBlockLanes; ++lane) {
                const float expected = box_entry(b.bytes.data(), lane, ray, 0.75f);
                ASSERT_EQ(std::bit_cast<uint32_t>(expected), std::bit_cast<uint32_t>(entries[lane]))
                    << name << ' ' << n;
            }
            ++compared;
        }
    });
    EXPECT_GE(compared, 2'000);
}

} // namespace
} // namespace prolate::query
#endif // HWY_ONCE
