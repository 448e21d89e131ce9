// Triangle tests and the point-in-solid test of the query: against exact integers, and against long double.
#include "query/inside/inside.hpp"
#include "query/triangle/leaves.hpp"
#include "query/triangle/separation.hpp"
#include "tests/query/triangle/triangle_pairs.hpp"
#include "tests/reference.hpp"
#include "tests/scenes.hpp"
#include "tests/shapes.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <vector>

namespace prolate {
namespace {

using query::PlacedTriangle;
using scenes::Point;
using scenes::Random;
using namespace triangle_pairs;

using ApartTest = std::function<bool(const Pair&)>;

// The shipped test, with the placement that a query uses.
bool apart_with(double margin, const Pair& p) {
    const auto bytes_a = leaf_of({p.a.begin(), p.a.end()}, {{0, 1, 2}});
    const auto bytes_b = leaf_of({p.b.begin(), p.b.end()}, {{0, 1, 2}});
    const auto b_to_a = query::relative_pose(p.pose_a, p.pose_b);
    return query::separated(query::place(*TreeView::open(bytes_a), 0),
                            query::place(*TreeView::open(bytes_b), 0, b_to_a), 0, margin);
}
bool shipped(const Pair& p) {
    return apart_with(query::kSeparationMargin, p);
}

// The same by way of the float kernels: a leaf of one triangle each.
bool apart_in_lanes(const query::LaneMarginFactors& factors, const Pair& p) {
    const auto bytes_a = leaf_of({p.a.begin(), p.a.end()}, {{0, 1, 2}});
    const auto bytes_b = leaf_of({p.b.begin(), p.b.end()}, {{0, 1, 2}});
    return !query::test_leaves(*TreeView::open(bytes_a), {0, 1}, *TreeView::open(bytes_b), {0, 1},
                               query::relative_pose(p.pose_a, p.pose_b), 0, factors)
                .meet;
}

// ---- small integers: touching and coplanar cases abound, and everything is exact ----

using Int = int64_t;
using IntPoint = std::array<Int, 3>;
using IntTriangle = std::array<IntPoint, 3>;

IntPoint minus(const IntPoint& a, const IntPoint& b) {
    return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
IntPoint cross(const IntPoint& a, const IntPoint& b) {
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
Int dot(const IntPoint& a, const IntPoint& b) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
int sign(Int x) {
    return (x > 0) - (x < 0);
}
Int volume(const IntPoint& a, const IntPoint& b, const IntPoint& c, const IntPoint& d) {
    return dot(minus(d, a), cross(minus(b, a), minus(c, a)));
}

// In the plane of the triangle: does it hold p?
bool holds(const IntTriangle& t, const IntPoint& p) {
    const IntPoint n = cross(minus(t[1], t[0]), minus(t[2], t[0]));
    for (size_t i = 0; i < 3; ++i)
        if (dot(n, cross(minus(t[(i + 1) % 3], t[i]), minus(p, t[i]))) < 0) return false;
    return true;
}
// In one plane with normal n: do the segments meet?
bool segments_meet(const IntPoint& n, const IntPoint& p, const IntPoint& q, const IntPoint& r, const IntPoint& s) {
    const auto turn = [&](const IntPoint& a, const IntPoint& b, const IntPoint& c) {
        return sign(dot(n, cross(minus(b, a), minus(c, a))));
    };
    const auto between = [](const IntPoint& a, const IntPoint& b, const IntPoint& c) { // c on the line a b
        return dot(minus(a, c), minus(b, c)) <= 0;
    };
    const int r_side = turn(p, q, r), s_side = turn(p, q, s), p_side = turn(r, s, p), q_side = turn(r, s, q);
    if (r_side * s_side < 0 && p_side * q_side < 0) return true;
    return (r_side == 0 && between(p, q, r)) || (s_side == 0 && between(p, q, s)) ||
           (p_side == 0 && between(r, s, p)) || (q_side == 0 && between(r, s, q));
}
bool meets(const IntTriangle& t, const IntPoint& p, const IntPoint& q) {
    const int p_side = sign(volume(t[0], t[1], t[2], p)), q_side = sign(volume(t[0], t[1], t[2], q));
    if (p_side * q_side > 0) return false;
    if (p_side == 0 && q_side == 0) {
        const IntPoint n = cross(minus(t[1], t[0]), minus(t[2], t[0]));
        bool any = holds(t, p);
        for (size_t i = 0; i < 3; ++i) any = any || segments_meet(n, p, q, t[i], t[(i + 1) % 3]);
        return any;
    }
    int least = 1, most = -1;
    for (size_t i = 0; i < 3; ++i) {
        const int side = sign(volume(p, q, t[i], t[(i + 1) % 3]));
        least = std::min(least, side), most = std::max(most, side);
    }
    return least >= 0 || most <= 0;
}
bool meet(const IntTriangle& a, const IntTriangle& b) {
    for (size_t i = 0; i < 3; ++i)
        if (meets(a, b[i], b[(i + 1) % 3]) || meets(b, a[i], a[(i + 1) % 3])) return true;
    return false;
}

Corners to_floats(const IntTriangle& t) {
    Corners out;
    for (size_t i = 0; i < 3; ++i)
        out[i] = {static_cast<float>(t[i][0]), static_cast<float>(t[i][1]), static_cast<float>(t[i][2])};
    return out;
}

// Share of the pairs of integer triangles with corners below `range` that the test gets wrong.
uint32_t wrong_among_integers(Int range, bool flat, uint32_t count, const ApartTest& test, uint32_t& meeting) {
    Random random(static_cast<uint64_t>(range) * 2 + flat);
    const auto triangle = [&] {
        for (;;) {
            IntTriangle t;
            for (IntPoint& p : t)
                for (Int& x : p) x = static_cast<Int>(random.below(static_cast<uint32_t>(range)));
            if (flat) t[0][2] = t[1][2] = t[2][2] = 0;
            if (cross(minus(t[1], t[0]), minus(t[2], t[0])) != IntPoint{}) return t;
        }
    };
    uint32_t wrong = 0;
    for (uint32_t i = 0; i < count; ++i) {
        const IntTriangle a = triangle(), b = triangle();
        const bool truth = meet(a, b);
        meeting += truth;
        wrong += test({to_floats(a), to_floats(b), {}, {}}) == truth;
    }
    return wrong;
}

TEST(Triangles, AreExactOnIntegers) {
    for (const ApartTest& test : {ApartTest(shipped), ApartTest([](const Pair& p) { return apart_in_lanes({}, p); })})
        for (const Int range : {3, 5, 12})
            for (const bool flat : {false, true}) {
                uint32_t meeting = 0;
                EXPECT_EQ(wrong_among_integers(range, flat, 20'000, test, meeting), 0u) << range;
                EXPECT_GT(meeting, 2'000u);
                EXPECT_LT(meeting, 19'900u);
            }
}
TEST(Triangles, TheCheckAboveNoticesWrongMargins) {
    const auto wrong = [](const ApartTest& test) {
        uint32_t meeting = 0;
        return wrong_among_integers(5, false, 3'000, test, meeting);
    };
    EXPECT_GT(wrong([](const Pair& p) { return apart_with(-1e-12, p); }), 100u); // touching pairs
    EXPECT_GT(wrong([](const Pair& p) { return apart_with(0.01, p); }), 10u);
    EXPECT_GT(wrong([](const Pair& p) { return apart_in_lanes({.direction = -1e-6f}, p); }), 100u);
}

// ---- any shape, place and pose, near contact ----

struct Tally {
    uint32_t falsely_apart = 0, missed = 0, apart = 0;
};
constexpr double kDecided = 1e-9; // of S: farther triangles must be found apart

Tally tally(const Family& family, uint32_t count, const ApartTest& test) {
    Random random(7);
    Tally out;
    for (uint32_t i = 0; i < count; ++i) {
        const Pair p = near_contact(random, family);
        const bool apart = test(p);
        const reference::Real d = distance(p);
        out.falsely_apart += apart && d == 0;
        out.missed += !apart && d > kDecided * size(p);
        out.apart += apart;
    }
    return out;
}

class TriangleFamily : public testing::TestWithParam<Family> {};

TEST_P(TriangleFamily, AgreesWithTheReference) {
    const uint32_t count = 100'000;
    const Tally result = tally(GetParam(), count, shipped);
    EXPECT_EQ(result.falsely_apart, 0u);
    EXPECT_EQ(result.missed, 0u);
    EXPECT_GT(result.apart, count / 10);
    EXPECT_LT(result.apart, count * 9 / 10);
}
TEST_P(TriangleFamily, TheHarnessNoticesWrongMargins) {
    EXPECT_GT(tally(GetParam(), 20'000, [](const Pair& p) { return apart_with(-1e-4, p); }).falsely_apart, 0u);
    EXPECT_GT(tally(GetParam(), 20'000, [](const Pair& p) { return apart_with(1e-4, p); }).missed, 0u);
}

INSTANTIATE_TEST_SUITE_P(All, TriangleFamily, testing::ValuesIn(kFamilies),
                         [](const auto& family) { return std::string(family.param.name); });

TEST(Triangles, DegenerateOnesAreSegmentsAndPoints) {
    const Corners face{{{0, 0, 0}, {4, 0, 0}, {0, 4, 0}}};
    const auto point = [](float x, float y, float z) { return Corners{{{x, y, z}, {x, y, z}, {x, y, z}}}; };
    const auto segment = [](Vec3 p, Vec3 q) { return Corners{{p, q, q}}; };
    const auto apart = [](const Corners& a, const Corners& b) {
        EXPECT_EQ(shipped({a, b, {}, {}}), shipped({b, a, {}, {}}));
        return shipped({a, b, {}, {}});
    };
    EXPECT_FALSE(apart(face, point(1, 1, 0)));
    EXPECT_FALSE(apart(face, point(2, 2, 0))); // on the edge
    EXPECT_TRUE(apart(face, point(1, 1, 1e-6f)));
    EXPECT_TRUE(apart(face, point(2, 2.00001f, 0)));
    EXPECT_FALSE(apart(point(1, 1, 1), point(1, 1, 1)));
    EXPECT_TRUE(apart(point(1, 1, 1), point(1, 1, 1.00001f)));
    EXPECT_FALSE(apart(face, segment({1, 1, -1}, {1, 1, 1})));
    EXPECT_TRUE(apart(face, segment({3, 3, -1}, {3, 3, 1})));
    EXPECT_TRUE(apart(face, segment({2.5f, 2, 0}, {5, 5, 0})));
    EXPECT_FALSE(apart(segment({0, 0, 0}, {2, 2, 2}), segment({0, 0, 2}, {2, 2, 0})));
    EXPECT_TRUE(apart(segment({0, 0, 0}, {2, 2, 2}), segment({0, 0.1f, 2}, {2, 2.1f, 0})));
    EXPECT_FALSE(apart(segment({0, 0, 0}, {2, 0, 0}), segment({1, 0, 0}, {3, 0, 0}))); // on one line
    EXPECT_TRUE(apart(segment({0, 0, 0}, {2, 0, 0}), segment({2.1f, 0, 0}, {3, 0, 0})));
}

TEST(Triangles, ABadPoseNeverSeparates) {
    const Corners t{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}};
    constexpr float kNan = std::numeric_limits<float>::quiet_NaN(), kInf = std::numeric_limits<float>::infinity();
    for (const Pose& pose : {Pose{{9, 0, kNan}, {}}, Pose{{kInf, 0, 0}, {}}, Pose{{9, 0, 0}, {0, 0, 0, 0}}})
        EXPECT_FALSE(shipped({t, t, {}, pose}));
    EXPECT_TRUE(shipped({t, t, {}, {{9, 0, 0}, {}}}));
}

// ---- triangle and ellipsoid ----

TEST(Triangles, AgainstEllipsoidsAgreeWithTheReference) {
    Random random(11);
    uint32_t apart_count = 0;
    const uint32_t count = 100'000;
    for (uint32_t i = 0; i < count; ++i) {
        const Family family{"", i % 2 ? 1e-4 : 0.3, 0, false};
        const Ellipsoid e =
            scenes::ellipsoid(random.in_ball(), scenes::radii(random, i % 3 ? 40 : 4), random.rotation());
        Pair p{random_triangle(random, family), {}, {{}, random.rotation()}, {{}, random.rotation()}};
        // A point of the triangle near the ellipsoid's border.
        const Point u = random.direction(), way = random.direction();
        const Point on_e{e.center.x + e.l11 * u[0], e.center.y + e.l21 * u[0] + e.l22 * u[1],
                         e.center.z + e.l31 * u[0] + e.l32 * u[1] + e.l33 * u[2]};
        const Point a = scenes::rotate(p.pose_a.rotation, feature_point(random, p.a));
        const Point b = scenes::rotate(p.pose_b.rotation, on_e);
        const double gap = random.log_in(1e-7, 1);
        p.pose_b.translation =
            scenes::to_float({a[0] - b[0] + gap * way[0], a[1] - b[1] + gap * way[1], a[2] - b[2] + gap * way[2]});

        const reference::Real radius = reference::radius(reference::placed(p.a, p.pose_a, p.pose_a.translation), e,
                                                         p.pose_b, p.pose_a.translation);
        const auto bytes = leaf_of({p.a.begin(), p.a.end()}, {{0, 1, 2}});
        const TreeView tree = *TreeView::open(bytes);
        const bool one =
            query::separated(query::place(tree, 0), query::place(e, query::relative_pose(p.pose_a, p.pose_b)));
        const bool other = query::separated(query::place(tree, 0, query::relative_pose(p.pose_b, p.pose_a)),
                                            query::place(e)); // the ellipsoid as body A
        for (const bool apart : {one, other}) {
            ASSERT_FALSE(apart && radius < 1) << i;
            ASSERT_FALSE(!apart && radius > 1 + 1e-9L) << i;
        }
        apart_count += one;
    }
    EXPECT_GT(apart_count, count / 10);
    EXPECT_LT(apart_count, count * 9 / 10);
}

// ---- point in solid ----

int64_t winding(const Mesh& mesh, const query::PlacedPoint& p) {
    int64_t sum = 0; // leaf by leaf: each takes at most 127 triangles
    for (size_t begin = 0; begin < mesh.triangles.size(); begin += kMaxLeafTriangles) {
        const size_t end = std::min(mesh.triangles.size(), begin + kMaxLeafTriangles);
        const auto at = [&](size_t i) { return mesh.triangles.begin() + static_cast<ptrdiff_t>(i); };
        const auto bytes = leaf_of(mesh.vertices, {at(begin), at(end)});
        QueryStats stats;
        sum += *query::winding_number(*TreeView::open(bytes), p, stats, UINT64_MAX);
        EXPECT_EQ(stats.triangle_tests, end - begin);
    }
    return sum;
}
query::PlacedPoint at(double x, double y, double z) {
    return {{x, y, z}, std::sqrt(x * x + y * y + z * z)};
}

TEST(Inside, RaysThroughEdgesAndVerticesCountOnce) {
    // An octahedron and a box whose corners, edges and diagonals lie on the lattice that is asked.
    const Mesh octahedron{{{4, 0, 0}, {-4, 0, 0}, {0, 4, 0}, {0, -4, 0}, {0, 0, 4}, {0, 0, -4}},
                          {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4}, {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}}};
    const Mesh box = shapes::moved(shapes::box(4, 4, 4), {-2, -2, -2});
    for (int x = -5; x <= 5; ++x)
        for (int y = -5; y <= 5; ++y)
            for (int z = -5; z <= 5; ++z) {
                const int sum = std::abs(x) + std::abs(y) + std::abs(z);
                if (sum != 4) {
                    EXPECT_EQ(winding(octahedron, at(x, y, z)), sum < 4) << x << ' ' << y << ' ' << z;
                }
                const int largest = std::max({std::abs(x), std::abs(y), std::abs(z)});
                if (largest != 2) {
                    EXPECT_EQ(winding(box, at(x, y, z)), largest < 2) << x << ' ' << y << ' ' << z;
                    EXPECT_EQ(winding(shapes::inverted(box), at(x, y, z)), -(largest < 2));
                }
            }
}

TEST(Inside, ExactAsCloseToTheSurfaceAsDoublesGo) {
    // A sheared box: its sides are in no axis' direction, its corners small integers. The heights of points over a side
    // are exact by construction.
    const auto shear = [](double x, double y, double z) {
        return std::array<double, 3>{x + 3 * y, y - 2 * z, z + 5 * x};
    };
    Mesh mesh = shapes::box(2, 2, 2);
    for (Vec3& v : mesh.vertices) {
        const auto p = shear(v.x, v.y, v.z);
        v = {static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])};
    }
    const double determinant = 1 * (1 * 1) - 3 * (0 - (-2) * 5); // of the shear: does it keep the orientation?
    const int64_t in = determinant > 0 ? 1 : -1;
    Random random(3);
    for (int i = 0; i < 20'000; ++i) {
        const double step = std::ldexp(1, -static_cast<int>(10 + random.below(36)));
        double p[3];
        for (double& x : p) x = static_cast<double>(1 + random.below(63)) / 32;
        const bool upper = random.below(2) == 1, outside = random.below(2) == 1;
        const uint32_t axis = random.below(3);
        p[axis] = (upper ? 2 : 0) + (upper == outside ? step : -step);
        const bool truth = !outside;
        const auto q = shear(p[0], p[1], p[2]); // exact: few bits
        ASSERT_EQ(winding(mesh, at(q[0], q[1], q[2])), truth ? in : 0) << i;
    }
}

TEST(Inside, CountsEverySheet) {
    Mesh mesh = shapes::icosphere(2);
    shapes::append(mesh, shapes::moved(shapes::icosphere(2), {}, 0.5f));
    shapes::append(mesh, shapes::inverted(shapes::moved(shapes::icosphere(2), {}, 0.2f)));
    EXPECT_EQ(winding(mesh, at(0, 0, 0)), 1);
    EXPECT_EQ(winding(mesh, at(0.3, 0, 0)), 2);
    EXPECT_EQ(winding(mesh, at(0, 0.7, 0)), 1);
    EXPECT_EQ(winding(mesh, at(0, 0, -1.1)), 0);
    EXPECT_EQ(winding(mesh, at(0, 0, 1.1)), 0);
}

} // namespace
} // namespace prolate
