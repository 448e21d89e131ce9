// Distance and contact of two triangles against long double.
#include "query/triangle/contact.hpp"
#include "query/triangle/distance.hpp"
#include "tests/query/triangle/triangle_pairs.hpp"

#include <gtest/gtest.h>

#include <limits>

namespace prolate {
namespace {

using query::PlacedTriangle;
using scenes::Random;
using namespace triangle_pairs;
using reference::Real;

struct Placed {
    PlacedTriangle a, b;
};
Placed placed(const Pair& p) {
    const auto bytes_a = leaf_of({p.a.begin(), p.a.end()}, {{0, 1, 2}});
    const auto bytes_b = leaf_of({p.b.begin(), p.b.end()}, {{0, 1, 2}});
    return {query::place(*TreeView::open(bytes_a), 0),
            query::place(*TreeView::open(bytes_b), 0, query::relative_pose(p.pose_a, p.pose_b))};
}
Real distance_to(const glm::dvec3& point, const PlacedTriangle& t) {
    reference::Corners corners;
    for (size_t i = 0; i < 3; ++i) corners[i] = {t.corner[i].x, t.corner[i].y, t.corner[i].z};
    const reference::Vector x{point.x, point.y, point.z};
    return reference::distance({x, x, x}, corners);
}

// How much the bounds miss the truth by, and how far they are from each other, of S.
struct Tally {
    uint32_t wrong = 0, loose = 0, apart = 0;
    double loosest = 0;
};
Tally tally(const Family& family, uint32_t count, double margin, double scale) {
    Random random(21);
    Tally out;
    for (uint32_t i = 0; i < count; ++i) {
        const Pair p = scaled(near_contact(random, family), scale);
        const auto [a, b] = placed(p);
        const auto d = query::distance(a, b, margin);
        const Real truth = distance(p);
        const double s = size(p), gap = (d.upper - d.lower) / s;
        out.wrong += !(d.lower <= truth && truth <= d.upper);
        out.loose += gap > 1e-8;
        out.loosest = std::max(out.loosest, gap);
        out.apart += d.lower > 0;
        if (margin != query::kSeparationMargin) continue;
        EXPECT_FALSE(d.lower > 0 && truth == 0) << i;
        EXPECT_LT(distance_to(d.on_a, a), 1e-14 * s) << i;
        EXPECT_LT(distance_to(d.on_b, b), 1e-14 * s) << i;
        EXPECT_LE(std::abs(glm::length(d.on_b - d.on_a) - d.upper), 256 * 0x1p-53 * 1.01 * s) << i;
    }
    return out;
}

class DistanceFamily : public testing::TestWithParam<Family> {};

TEST_P(DistanceFamily, IsBoundedOnBothSides) {
    for (const double scale : {1e-3, 1.0, 1e6}) {
        const uint32_t count = 12'000;
        const Tally result = tally(GetParam(), count, query::kSeparationMargin, scale);
        EXPECT_EQ(result.wrong, 0u);
        EXPECT_EQ(result.loose, 0u) << result.loosest;
        EXPECT_GT(result.apart, count / 10);
        EXPECT_LT(result.apart, count * 9 / 10);
    }
}
TEST_P(DistanceFamily, TheHarnessNoticesWrongMargins) {
    EXPECT_GT(tally(GetParam(), 10'000, -1e-12, 1).wrong, 100u);
    EXPECT_GT(tally(GetParam(), 10'000, 1e-7, 1).loose, 100u);
}
INSTANTIATE_TEST_SUITE_P(All, DistanceFamily, testing::ValuesIn(kFamilies),
                         [](const auto& family) { return std::string(family.param.name); });

PlacedTriangle triangle(const Corners& c) {
    const auto bytes = leaf_of({c.begin(), c.end()}, {{0, 1, 2}});
    return query::place(*TreeView::open(bytes), 0);
}

TEST(TriangleDistance, OfDegenerateOnes) {
    const Corners face{{{0, 0, 0}, {4, 0, 0}, {0, 4, 0}}};
    const auto point = [](float x, float y, float z) { return Corners{{{x, y, z}, {x, y, z}, {x, y, z}}}; };
    const auto segment = [](Vec3 p, Vec3 q) { return Corners{{p, q, q}}; };
    const auto expect = [](const Corners& a, const Corners& b, double truth) {
        for (const auto& d : {query::distance(triangle(a), triangle(b)), query::distance(triangle(b), triangle(a))}) {
            EXPECT_LE(d.lower, truth);
            EXPECT_GE(d.upper, truth);
            EXPECT_NEAR(d.lower, d.upper, 1e-11);
        }
    };
    expect(face, point(1, 1, 3), 3);
    expect(face, point(1, 1, 0), 0);
    expect(face, point(-3, -4, 0), 5);
    expect(point(1, 2, 3), point(1, 2, 3), 0);
    expect(point(1, 2, 3), point(1, 2, 5), 2);
    expect(face, segment({1, 1, -1}, {1, 1, 1}), 0);
    expect(face, segment({3, 3, -1}, {3, 3, 1}), std::sqrt(2.0));
    expect(segment({0, 0, 0}, {2, 0, 0}), segment({1, 1, -1}, {1, 1, 1}), 1);
    expect(segment({0, 0, 0}, {2, 0, 0}), segment({5, 4, 0}, {9, 4, 0}), 5);
    expect(segment({0, 0, 0}, {2, 0, 0}), segment({1, 0, 0}, {3, 0, 0}), 0);
    expect(face, face, 0);
}

TEST(TriangleDistance, ABadPoseProvesNothing) {
    const Corners t{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}};
    constexpr float kNan = std::numeric_limits<float>::quiet_NaN(), kInf = std::numeric_limits<float>::infinity();
    for (const Pose& pose : {Pose{{9, 0, kNan}, {}}, Pose{{kInf, 0, 0}, {}}, Pose{{9, 0, 0}, {0, 0, 0, 0}}}) {
        const auto [a, b] = placed({t, t, {}, pose});
        const auto d = query::distance(a, b);
        EXPECT_EQ(d.lower, 0);
        EXPECT_EQ(d.upper, std::numeric_limits<double>::infinity());
    }
}

// ---- contact ----

PlacedTriangle moved(PlacedTriangle t, const glm::dvec3& by) {
    for (glm::dvec3& corner : t.corner) corner += by;
    return t;
}
double overlap(const PlacedTriangle& a, const PlacedTriangle& b, const glm::dvec3& n) {
    double least = HUGE_VAL, most = -HUGE_VAL; // of n.(b_j - a_i)
    for (const glm::dvec3& x : a.corner)
        for (const glm::dvec3& y : b.corner)
            least = std::min(least, glm::dot(n, y - x)), most = std::max(most, glm::dot(n, y - x));
    return std::min(most, -least) / glm::length(n);
}

class ContactFamily : public testing::TestWithParam<Family> {};

TEST_P(ContactFamily, PointsLieOnBothTrianglesAndTheNormalTakesThemApart) {
    Random random(22);
    uint32_t meeting = 0, far = 0, deep = 0;
    double farthest = 0;
    for (uint32_t i = 0; i < 30'000; ++i) {
        Pair p = near_contact(random, GetParam());
        if (i % 2) // into each other
            p.pose_b.translation.x += static_cast<float>(random.in(-0.2, 0.2)),
                p.pose_b.translation.y += static_cast<float>(random.in(-0.2, 0.2));
        const auto [a, b] = placed(p);
        if (query::separated(a, b)) continue;
        ++meeting;
        const auto c = query::contact({a}, {b}, 0);
        const double s = size(p);
        ASSERT_NEAR(glm::length(c.normal), 1, 1e-12);
        ASSERT_GT(c.count, 0u) << i;
        double deepest = 0;
        for (uint32_t k = 0; k < c.count; ++k) {
            const auto& point = c.points[k];
            const Real off = std::max(distance_to(point.on_a, a), distance_to(point.on_b, b));
            farthest = std::max(farthest, static_cast<double>(off) / s);
            far += off > 1e-9 * s;
            ASSERT_NEAR(point.depth, glm::dot(c.normal, point.on_a - point.on_b), 1e-12 * s);
            deepest = std::max(deepest, point.depth);
        }
        deep += deepest > 1e-3;
        const double way = overlap(a, b, c.normal); // along the normal, or against it
        ASSERT_LE(deepest, way + 1e-9 * s) << i;
        ASSERT_TRUE(query::separated(a, moved(b, (way + 1e-12 * s) * c.normal)) ||
                    query::separated(a, moved(b, -(way + 1e-12 * s) * c.normal)))
            << i;
    }
    EXPECT_EQ(far, 0u) << farthest;
    EXPECT_GT(meeting, 1'000u);
    EXPECT_TRUE(GetParam().coplanar || deep > 1'000) << deep;
}
INSTANTIATE_TEST_SUITE_P(All, ContactFamily, testing::ValuesIn(kFamilies),
                         [](const auto& family) { return std::string(family.param.name); });

TEST(TriangleContact, OfSimpleOnes) {
    const Corners floor{{{-8, -8, 0}, {8, -8, 0}, {0, 8, 0}}};
    const Corners spike{{{0, 0, -0.25f}, {1, 0, 4}, {-1, 0, 4}}}; // through it
    const auto through = query::contact({triangle(floor)}, {triangle(spike)}, 0);
    ASSERT_EQ(through.count, 1u);
    EXPECT_NEAR(through.points[0].depth, 0.25, 1e-12);
    EXPECT_NEAR(through.normal.z, 1, 1e-12);
    EXPECT_NEAR(glm::length(through.points[0].on_a), 0, 1e-12);
    const auto reverse = query::contact({triangle(spike)}, {triangle(floor)}, 0);
    ASSERT_EQ(reverse.count, 1u);
    EXPECT_NEAR(reverse.points[0].depth, 0.25, 1e-12);
    EXPECT_NEAR(reverse.normal.z, -1, 1e-12);

    const Corners left{{{0, 0, 0}, {4, 0, 0}, {0, 4, 0}}}, right{{{2, 0, 0}, {6, 0, 0}, {2, 4, 0}}};
    const auto flat = query::contact({triangle(left)}, {triangle(right)}, 0); // (2,0) (4,0) (2,2)
    ASSERT_EQ(flat.count, 3u);
    glm::dvec3 sum(0);
    for (uint32_t k = 0; k < 3; ++k) {
        EXPECT_NEAR(flat.points[k].depth, 0, 1e-12);
        sum += flat.points[k].on_a;
    }
    EXPECT_NEAR(std::abs(flat.normal.z), 1, 1e-12);
    EXPECT_NEAR(glm::length(sum / 3.0 - glm::dvec3(8.0 / 3, 2.0 / 3, 0)), 0, 1e-12);
}

} // namespace
} // namespace prolate
