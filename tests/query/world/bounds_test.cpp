// Boxes around placed trees: they hold what they must, whatever the pose, and are hardly larger than that.
#include "query/world/bounds.hpp"
#include "query/world/bounds_tree.hpp"
#include "tests/exact_scenes.hpp"
#include "tests/reference.hpp"
#include "tests/scenes.hpp"
#include "tests/shapes.hpp"

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

// Exact faces of what a tree stands for, at `pose`: its leaves' ellipsoids, or its triangles.
struct Faces {
    reference::Vector lower{1e30L, 1e30L, 1e30L}, upper{-1e30L, -1e30L, -1e30L};
    void add(const reference::Vector& p, const reference::Vector& half) {
        for (size_t k = 0; k < 3; ++k)
            lower[k] = std::min(lower[k], p[k] - half[k]), upper[k] = std::max(upper[k], p[k] + half[k]);
    }
};
Faces faces(const TreeView& tree, const Pose& pose, Real margin) {
    const reference::Matrix rotation = reference::rotation(pose.rotation);
    Faces out;
    tree.for_each_in_cut(tree.level_count() - 1, [&](uint32_t node) {
        if (!tree.has_triangles()) {
            const reference::Pair pair({}, {}, tree.ellipsoid(node), pose); // seen from the world
            const auto half = [&](size_t k) { return std::sqrt(pair.q2[k][k]) + margin; };
            return out.add(pair.r, {half(0), half(1), half(2)});
        }
        const TriangleRange range = tree.triangles(node);
        for (uint32_t t = range.first; t < range.first + range.count; ++t)
            for (const uint32_t corner : tree.triangle(t)) {
                const Vec3 v = tree.vertex(corner);
                const auto p = rotation * reference::Vector{v.x, v.y, v.z};
                out.add({p[0] + pose.translation.x, p[1] + pose.translation.y, p[2] + pose.translation.z},
                        {margin, margin, margin});
            }
    });
    return out;
}

// Poses a face of the box so that it comes to lie near 0, where floats are dense and only the margin of the doubles
// helps. Returns how often the box is too small. `longer` is how much longer than the truth a side is, at most.
uint32_t too_small(const TreeView& tree, uint32_t poses, double rounding, double& longer) {
    Random random(2);
    uint32_t wrong = 0;
    longer = 0;
    for (uint32_t i = 0; i < poses; ++i) {
        Pose pose{{}, random.rotation()};
        const float margin = i % 3 == 0 ? static_cast<float>(random.log_in(1e-4, 1)) : 0;
        const Faces at_origin = faces(tree, pose, margin);
        pose.translation = {static_cast<float>(-at_origin.lower[0]), static_cast<float>(-at_origin.upper[1]),
                            static_cast<float>(random.log_in(1e-3, 1e6))};
        const Faces truth = faces(tree, pose, margin);
        const Bounds box =
            query::bounds_at(tree, query::relative_pose({}, pose), margin, query::kReachTolerance, rounding);
        const Real lower[] = {box.lower.x, box.lower.y, box.lower.z}, upper[] = {box.upper.x, box.upper.y, box.upper.z};
        bool holds = true;
        for (size_t k = 0; k < 3; ++k) {
            holds &= lower[k] <= truth.lower[k] && upper[k] >= truth.upper[k];
            const Real excess = truth.lower[k] - lower[k] + upper[k] - truth.upper[k],
                       size = truth.upper[k] - truth.lower[k];
            if (k < 2) longer = std::max(longer, static_cast<double>(excess / size)); // z is far away, and rounded
        }
        wrong += !holds;
    }
    return wrong;
}

// Trees whose leaves are asked: one ellipsoid, and one triangle.
struct Single {
    std::vector<std::byte> ellipsoid, triangle;
};
Single single(Random& random) {
    const Ellipsoid e = scenes::ellipsoid(random.in_ball(), scenes::radii(random, 1000), random.rotation());
    const double center[] = {e.center.x, e.center.y, e.center.z}, factor[] = {e.l11, e.l21, e.l22, e.l31, e.l32, e.l33};
    const format::Lattice lattice = format::lattice_for(center, center, 1);
    format::PackedNode node;
    format::quantise(node, lattice, center, factor);
    Mesh mesh{
        {scenes::to_float(random.in_ball()), scenes::to_float(random.in_ball()), scenes::to_float(random.in_ball())},
        {{0, 1, 2}}};
    return {format::encode({}, 8, lattice, std::vector<format::PackedLevel>{{{node}, {}}}),
            scenes::exact_tree(std::move(mesh), {.closed = false}).bytes};
}

// Both kinds of them, in many poses.
uint32_t singles_too_small(double rounding, double& longer) {
    Random random(3);
    uint32_t wrong = 0;
    longer = 0;
    for (uint32_t i = 0; i < 200; ++i) {
        const Single s = single(random);
        for (const auto& bytes : {s.ellipsoid, s.triangle}) {
            double by = 0;
            wrong += too_small(*TreeView::open(bytes), 250, rounding, by);
            longer = std::max(longer, by);
        }
    }
    return wrong;
}
TEST(Bounds, HoldsEllipsoidsAndTrianglesAtEveryPose) {
    double longer = 0;
    EXPECT_EQ(singles_too_small(kSeparationMargin, longer), 0u);
    EXPECT_LT(longer, 1e-3); // of needles edge-on; what is asked is exact
}
TEST(Bounds, TheCheckAboveNoticesAMissingMargin) {
    double longer = 0;
    EXPECT_GT(singles_too_small(0, longer), 100u);
}

// Whole trees. Those of clouds are uneven: of degrees 3 to 64, depths 1 to 5, leaves on every level.
TEST(Bounds, HoldsTheLeavesOfATreeAndIsTight) {
    Random random(4);
    for (uint32_t n = 0; n < 15; ++n) {
        const uint32_t degrees[] = {3, 8, 64};
        const auto scene = scenes::tree(random, scenes::cloud(random, 300),
                                        {.degree = degrees[n % 3],
                                         .levels = 1 + n % 5,
                                         .stop_probability = n % 2 ? 0.2 : 0,
                                         .unit = n % 4 ? 1 : 0x1p-7});
        const TreeView tree = *TreeView::open(scene.bytes);
        double longer = 0;
        EXPECT_EQ(too_small(tree, 40, kSeparationMargin, longer), 0u);
        EXPECT_LT(longer, 0.02);
        // A prefix is a body, too, whose leaves may stick out of those of the whole.
        for (uint32_t l = 0; l < tree.level_count(); ++l) {
            const auto prefix = TreeView::open(tree.bytes().first(tree.level(l).end_byte));
            EXPECT_EQ(too_small(*prefix, 10, kSeparationMargin, longer), 0u);
            EXPECT_LT(longer, 0.02);
        }
    }
}
TEST(Bounds, HoldsTheTrianglesOfAnExactTree) { // without hulls; exact_test.cpp has those that the builder makes
    for (uint32_t n = 0; n < 8; ++n) {
        const scenes::ExactScene scene =
            scenes::exact_tree(n % 2 ? shapes::torus(1, 0.3f, 12 + n, 9) : shapes::sheet(2, 1, 4 + n),
                               {.degree = n % 3 ? 8u : 64u, .leaf_triangles = 1 + n});
        const TreeView tree = *TreeView::open(scene.bytes);
        double longer = 0;
        EXPECT_EQ(too_small(tree, 60, kSeparationMargin, longer), 0u);
        EXPECT_LT(longer, 0.1);
        for (uint32_t l = 0; l < tree.level_count(); ++l) // its ellipsoids, then
            EXPECT_EQ(
                too_small(*TreeView::open(tree.bytes().first(tree.level(l).end_byte)), 10, kSeparationMargin, longer),
                0u);
    }
}

// A corner of the local box moves no farther than motion() says. Half of the rotations are small, a quarter about an
// axis that makes the bound sharp.
uint32_t moved_farther(double rounding, double& sharpest) {
    Random random(4);
    uint32_t wrong = 0;
    sharpest = 0;
    for (uint32_t i = 0; i < 100000; ++i) {
        const Point h{random.log_in(1e-3, 1), random.log_in(1e-3, 1), random.log_in(1e-3, 1)}, o = random.in_ball();
        query::LocalBounds local{{o[0], o[1], o[2]}, {h[0], h[1], h[2]}, 0, 0};
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
    EXPECT_EQ(bounds(tree, {}, kNan), query::kEverything);
    EXPECT_EQ(bounds(tree, {}, kInf), query::kEverything);
    EXPECT_EQ(bounds(tree, {}, -1), bounds(tree, {}));
    EXPECT_TRUE(overlap({{0, 0, 0}, {1, 1, 1}}, {{1, 1, 1}, {2, 2, 2}})); // faces belong to a box
    EXPECT_FALSE(overlap({{0, 0, 0}, {1, 1, 1}}, {{0, 1.1f, 0}, {2, 2, 2}}));
    EXPECT_TRUE(overlap({{0, 0, 0}, {kNan, 1, 1}}, {{5, 0, 0}, {6, 2, 2}}));
}

} // namespace
} // namespace prolate
