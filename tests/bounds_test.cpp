// Boxes around placed trees: they hold what they must, whatever the pose, and are not much larger than that.
#include "query/bounds.hpp"
#include "query/bounds_tree.hpp"
#include "tests/reference.hpp"
#include "tests/scenes.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace prolate {
namespace {

using query::kSeparationMargin;
using reference::Real;
using reference::operator*;
using reference::operator-;
using scenes::Point;
using scenes::Random;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInf = std::numeric_limits<float>::infinity();

TEST(Bounds, RoundsOutward) {
    Random random(1);
    uint32_t tight = 0;
    for (uint32_t i = 0; i < 200000; ++i) {
        double x = (random.below(2) ? 1 : -1) * random.log_in(1e-50, 3e38);
        if (i % 4 == 0) x = static_cast<float>(x);                                           // no rounding is needed
        if (i % 4 == 1) x = std::nextafter(static_cast<double>(static_cast<float>(x)), 0.0); // nearly none
        const float down = query::round_down(x), up = query::round_up(x);
        ASSERT_LE(down, x);
        ASSERT_GE(up, x);
        tight += std::abs(x) > 1e-30 && std::abs(x) < 1e38 && (double{up} - down) <= 0x1p-21 * std::abs(x);
    }
    EXPECT_GT(tight, 100000u);
    EXPECT_LE(query::round_down(0), 0);
    EXPECT_EQ(query::round_down(1e300), std::numeric_limits<float>::infinity()); // so is the box, which is refused
    EXPECT_EQ(query::round_down(-1e300), -std::numeric_limits<float>::infinity());
    EXPECT_TRUE(std::isnan(query::round_down(kNan)));
}

// Exact faces of the box of an ellipsoid at `pose`.
struct Faces {
    reference::Vector lower, upper;
};
Faces faces(const Ellipsoid& e, const Pose& pose, Real margin) {
    const reference::Pair pair({}, {}, e, pose); // seen from the world
    Faces out;
    for (size_t i = 0; i < 3; ++i) {
        const Real half = std::sqrt(pair.q2[i][i]);
        out.lower[i] = pair.r[i] - half - margin, out.upper[i] = pair.r[i] + half + margin;
    }
    return out;
}

// One ellipsoid as a tree's bounds. The turned box is made so large that it does not bind, or the other way round.
query::LocalBounds local_bounds(const Ellipsoid& e, bool by_ellipsoid) {
    const double far = 1e6;
    const glm::dvec3 half(e.l11, std::hypot(e.l21, e.l22), std::hypot(e.l31, std::hypot(e.l32, e.l33)));
    query::LocalBounds out{e, {e.center.x, e.center.y, e.center.z}, half, 0, 0};
    if (by_ellipsoid)
        out.half *= far;
    else
        out.root = {
            .center = e.center, .l11 = float(half.x * far), .l22 = float(half.y * far), .l33 = float(half.z * far)};
    const auto length = [](const glm::dvec3& v) { return std::sqrt(v.x * v.x + v.y * v.y + v.z * v.z); };
    out.radius = length(out.half), out.reach = length(out.center) + out.radius;
    return out;
}

// Poses a face of the box so that it comes to lie near 0, where floats are dense and only the margin of the doubles
// helps. Returns how often the box is too small.
uint32_t too_small(double rounding, bool by_ellipsoid, double& looseness) {
    Random random(2);
    uint32_t wrong = 0;
    looseness = 0;
    for (uint32_t i = 0; i < 100000; ++i) {
        const Point r = scenes::radii(random, 1000), center = random.in_ball();
        const Ellipsoid e = scenes::ellipsoid(center, r, random.rotation());
        Pose pose{{}, random.rotation()};
        const float margin = i % 3 == 0 ? static_cast<float>(random.log_in(1e-4, 1)) : 0;
        const auto local = local_bounds(e, by_ellipsoid);
        // Exact faces of the turned box: those of its largest enclosed corners, along each axis.
        const auto exact = [&] {
            if (by_ellipsoid) return faces(e, pose, margin);
            const auto rotation = reference::rotation(pose.rotation);
            Faces out;
            for (size_t k = 0; k < 3; ++k) {
                const Real t[] = {pose.translation.x, pose.translation.y, pose.translation.z};
                Real middle = t[k], half = margin;
                for (size_t j = 0; j < 3; ++j) {
                    middle += rotation[k][j] * local.center[static_cast<int>(j)];
                    half += std::abs(rotation[k][j]) * local.half[static_cast<int>(j)];
                }
                out.lower[k] = middle - half, out.upper[k] = middle + half;
            }
            return out;
        };
        const Faces at_origin = exact();
        pose.translation = {static_cast<float>(-at_origin.lower[0]), static_cast<float>(-at_origin.upper[1]),
                            static_cast<float>(random.log_in(1e-3, 1e6))};
        const Faces truth = exact();
        const Bounds box = query::bounds_at(local, {}, query::relative_pose({}, pose), margin, rounding);
        const Real lower[] = {box.lower.x, box.lower.y, box.lower.z}, upper[] = {box.upper.x, box.upper.y, box.upper.z};
        bool holds = true;
        for (size_t k = 0; k < 3; ++k) {
            holds &= lower[k] <= truth.lower[k] && upper[k] >= truth.upper[k];
            const Real scale = std::abs(truth.lower[k]) + std::abs(truth.upper[k]) + 0x1p-20L * pose.translation.z;
            looseness = std::max(looseness,
                                 static_cast<double>((truth.lower[k] - lower[k] + upper[k] - truth.upper[k]) / scale));
        }
        wrong += !holds;
    }
    return wrong;
}

TEST(Bounds, HoldsEllipsoidsAndTurnedBoxesAtEveryPose) {
    double looseness = 0;
    EXPECT_EQ(too_small(kSeparationMargin, true, looseness), 0u);
    EXPECT_LT(looseness, 1e-6);
    EXPECT_EQ(too_small(kSeparationMargin, false, looseness), 0u);
    EXPECT_LT(looseness, 1e-6);
}
TEST(Bounds, TheCheckAboveNoticesAMissingMargin) {
    double looseness = 0;
    EXPECT_GT(too_small(0, true, looseness), 100u);
    EXPECT_GT(too_small(0, false, looseness), 100u);
}

// Whole trees: the points that they cover, at random and extreme poses.
uint32_t points_outside(double shrink, double& mean_ratio) {
    Random random(3);
    uint32_t outside = 0, boxes = 0;
    mean_ratio = 0;
    for (uint32_t n = 0; n < 12; ++n) {
        const auto scene = scenes::tree(
            random, scenes::cloud(random, 400),
            {.degree = n % 2 ? 8u : 3u, .levels = 1 + n % 5, .unit = n % 3 ? 1 : 0x1p-7, .shrink = shrink});
        const TreeView tree = *TreeView::open(scene.bytes);
        for (uint32_t i = 0; i < 60; ++i) {
            const double far = i % 2 ? 0 : random.log_in(1e-3, 1e8);
            const Point d = random.direction();
            const Pose pose{scenes::to_float({far * d[0], far * d[1], far * d[2]}), random.rotation()};
            const float margin = i % 3 ? 0.0f : 0.01f;
            const Bounds box = bounds(tree, pose, margin);
            outside += !query::is_finite(box);
            const reference::Matrix rotation = reference::rotation(pose.rotation);
            Faces truth{{1e30L, 1e30L, 1e30L}, {-1e30L, -1e30L, -1e30L}};
            for (const Point& p : scene.points) {
                const auto q = rotation * reference::Vector{p[0], p[1], p[2]};
                const Real t[] = {pose.translation.x, pose.translation.y, pose.translation.z};
                for (size_t k = 0; k < 3; ++k) {
                    truth.lower[k] = std::min(truth.lower[k], q[k] + t[k] - margin);
                    truth.upper[k] = std::max(truth.upper[k], q[k] + t[k] + margin);
                }
            }
            const Real lower[] = {box.lower.x, box.lower.y, box.lower.z},
                       upper[] = {box.upper.x, box.upper.y, box.upper.z};
            for (size_t k = 0; k < 3; ++k) {
                outside += lower[k] > truth.lower[k];
                outside += upper[k] < truth.upper[k];
            }
            if (far == 0 && tree.level_count() > 2) {
                Real ratio = 1;
                for (size_t k = 0; k < 3; ++k) ratio *= (upper[k] - lower[k]) / (truth.upper[k] - truth.lower[k]);
                mean_ratio += static_cast<double>(ratio), ++boxes;
            }
        }
    }
    mean_ratio /= boxes;
    return outside;
}

TEST(Bounds, HoldsTheSolidOfATree) {
    double ratio = 0;
    EXPECT_EQ(points_outside(1, ratio), 0u);
    EXPECT_LT(ratio, 3); // in volume; these fits are scaled covariances, and not tight ones
}
TEST(Bounds, TheCheckAboveNoticesTreesThatDoNotCover) {
    double ratio = 0;
    EXPECT_GT(points_outside(0.7, ratio), 100u);
}

// A corner of the local box moves no farther than motion() says. Half of the rotations are small, a quarter about an
// axis that makes the bound sharp.
uint32_t moved_farther(double rounding, double& sharpest) {
    Random random(4);
    uint32_t wrong = 0;
    sharpest = 0;
    for (uint32_t i = 0; i < 100000; ++i) {
        const Point h{random.log_in(1e-3, 1), random.log_in(1e-3, 1), random.log_in(1e-3, 1)}, o = random.in_ball();
        query::LocalBounds local{{}, {o[0], o[1], o[2]}, {h[0], h[1], h[2]}, 0, 0};
        local.radius = std::sqrt(h[0] * h[0] + h[1] * h[1] + h[2] * h[2]);
        local.reach = std::sqrt(o[0] * o[0] + o[1] * o[1] + o[2] * o[2]) + local.radius;
        const double turn = i % 2 ? random.log_in(1e-9, 1) : 0, shift = random.log_in(1e-9, 1);
        const double far = random.log_in(1, 1e6);
        Pose from{scenes::to_float({far, 0, -far}), random.rotation()}, to = from;
        to.rotation.x += static_cast<float>(turn * random.in(-1, 1));
        to.rotation.w += static_cast<float>(turn * random.in(-1, 1));
        to.translation.y = static_cast<float>(shift);
        const auto at = [&](const Pose& pose) { return query::anchor(local, query::relative_pose({}, pose)); };
        const double bound = query::motion(local, at(from), at(to), rounding);
        const reference::Matrix r = reference::rotation(from.rotation), s = reference::rotation(to.rotation);
        Real farthest = 0;
        for (uint32_t corner = 0; corner < 8; ++corner) {
            const auto sign = [&](uint32_t k) { return corner >> k & 1 ? 1 : -1; };
            const reference::Vector p{o[0] + Real{h[0]} * sign(0), o[1] + Real{h[1]} * sign(1),
                                      o[2] + Real{h[2]} * sign(2)};
            const reference::Vector d = s * p - r * p;
            farthest = std::max({farthest, std::abs(d[0]), std::abs(d[1] + to.translation.y), std::abs(d[2])});
        }
        wrong += !(bound >= farthest);
        sharpest = std::max(sharpest, static_cast<double>(farthest / bound));
    }
    return wrong;
}
TEST(Bounds, NothingMovesFartherThanItSays) {
    double sharpest = 0;
    EXPECT_EQ(moved_farther(kSeparationMargin, sharpest), 0u);
    EXPECT_GT(sharpest, 0.99);
}
TEST(Bounds, TheCheckAboveNoticesAMissingMarginToo) {
    double sharpest = 0;
    EXPECT_GT(moved_farther(0, sharpest), 100u);
}

TEST(Bounds, NodesOfLevelOneMakeBoxesTighter) {
    Random random(4);
    const auto scene = scenes::tree(random, scenes::cloud(random, 400), {});
    const TreeView tree = *TreeView::open(scene.bytes);
    const auto local = query::local_bounds(tree);
    uint32_t tighter = 0;
    for (uint32_t i = 0; i < 200; ++i) {
        const auto to_world = query::relative_pose({}, {{}, random.rotation()});
        const Bounds with = query::bounds_at(tree, local, to_world, 0),
                     without = query::bounds_at(local, {}, to_world, 0);
        EXPECT_TRUE(query::contains(without, with));
        tighter += with != without;
    }
    EXPECT_GT(tighter, 100u);
}

TEST(Bounds, IsInfiniteWhereNothingIsKnown) {
    Random random(5);
    const auto scene = scenes::tree(random, scenes::cloud(random, 100), {});
    const TreeView tree = *TreeView::open(scene.bytes);
    const Pose poses[] = {{{kNan, 0, 0}, {}},    {{0, 0, kInf}, {}},
                          {{}, {0, 0, 0, 0}},    {{}, {kNan, 0, 0, 1}},
                          {{}, {kInf, 0, 0, 1}}, {{0, std::numeric_limits<float>::max(), 0}, {}}};
    for (const Pose& pose : poses) {
        const Bounds box = bounds(tree, pose);
        EXPECT_EQ(box, query::kEverything);
        EXPECT_TRUE(overlap(box, {{1e30f, 0, 0}, {1e30f, 0, 0}}));
    }
    EXPECT_TRUE(overlap({{0, 0, 0}, {1, 1, 1}}, {{1, 1, 1}, {2, 2, 2}})); // faces belong to a box
    EXPECT_FALSE(overlap({{0, 0, 0}, {1, 1, 1}}, {{0, 1.1f, 0}, {2, 2, 2}}));
    EXPECT_TRUE(overlap({{0, 0, 0}, {kNan, 1, 1}}, {{5, 0, 0}, {6, 2, 2}}));
}

} // namespace
} // namespace prolate
