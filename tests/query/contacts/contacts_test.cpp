// Contact manifolds: boxes, balls and heaps with known contacts, and what holds for all bodies.
#include "query/contacts/contacts.hpp"
#include "query/ellipsoid/gap.hpp"
#include "query/ellipsoid/separation.hpp"
#include "tests/exact_scenes.hpp"
#include "tests/reference.hpp"
#include "tests/scenes.hpp"
#include "tests/shapes.hpp"
#include "tests/targets.hpp"

#include <prolate/collide.hpp>
#include <prolate/contacts.hpp>
#include <prolate/distance.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <numbers>
#include <utility>
#include <vector>

namespace prolate {
namespace {

using scenes::Point;
using scenes::Random;

static_assert(noexcept(contacts(std::declval<TreeView>(), Pose{}, std::declval<TreeView>(), Pose{},
                                std::declval<ContactManifolds&>(), std::declval<QueryContext&>())));

struct Solid {
    std::vector<std::byte> bytes;
    TreeView view() const { return *TreeView::open(bytes); }
};
Solid exact(const Mesh& mesh, bool closed = true) {
    return {scenes::exact_tree(mesh, {.degree = 4, .leaf_triangles = 2, .closed = closed}).bytes};
}
Solid floor_box() {
    return exact(shapes::moved(shapes::box(20, 20, 1), {-10, -10, -1}));
}
Solid unit_box() {
    return exact(shapes::moved(shapes::box(), {-0.5f, -0.5f, -0.5f}));
}
Solid proxy(Random& random, const Point& radii, const Point& center = {}) {
    std::vector<Point> points;
    for (int i = 0; i < 200; ++i) {
        const Point d = random.direction();
        points.push_back({center[0] + radii[0] * d[0], center[1] + radii[1] * d[1], center[2] + radii[2] * d[2]});
    }
    return {scenes::tree(random, points, {.levels = 1}).bytes};
}
Pose about_z(float x, float y, float z, double angle) {
    return {{x, y, z}, {0, 0, static_cast<float>(std::sin(angle / 2)), static_cast<float>(std::cos(angle / 2))}};
}

ContactResult ask(const Solid& a, const Pose& pose_a, const Solid& b, const Pose& pose_b, ContactManifolds& manifolds,
                  float margin = 0) {
    QueryContext context;
    std::memset(&context, 0xee, sizeof context);
    return contacts(a.view(), pose_a, b.view(), pose_b, manifolds, context, {.margin = margin});
}
ContactManifolds fresh(const Solid& a, const Pose& pose_a, const Solid& b, const Pose& pose_b, float margin = 0) {
    ContactManifolds out;
    ask(a, pose_a, b, pose_b, out, margin);
    return out;
}

double distance_of(const Vec3& a, const Vec3& b) {
    return std::hypot(a.x - b.x, a.y - b.y, a.z - b.z);
}
double dot(const Vec3& a, const Vec3& b) {
    return double{a.x} * b.x + double{a.y} * b.y + double{a.z} * b.z;
}

// Are the four points below the corners of the unit box?
void expect_footprint(const Manifold& m, const Pose& box, float depth) {
    EXPECT_NEAR(m.normal.z, 1, 1e-6);
    ASSERT_EQ(m.count, 4u);
    for (const double x : {-0.5, 0.5})
        for (const double y : {-0.5, 0.5}) {
            const Point corner = scenes::rotate(box.rotation, {x, y, -0.5});
            const Vec3 p = scenes::to_float(
                {corner[0] + box.translation.x, corner[1] + box.translation.y, corner[2] + box.translation.z});
            const auto same = [&](const ContactPoint& c) { return distance_of(c.point_b, p) < 1e-5; };
            EXPECT_EQ(std::count_if(m.points, m.points + 4, same), 1);
        }
    for (const ContactPoint& c : m.points) {
        EXPECT_NEAR(c.depth, depth, 2e-6);
        EXPECT_NEAR(c.point_a.z, 0, 2e-6);
        EXPECT_NEAR(c.point_a.z - c.point_b.z, depth, 2e-6);
    }
}

TEST(Contacts, ABoxOnTheFloorStandsOnItsCorners) {
    const Solid floor = floor_box(), sheet = exact(shapes::moved(shapes::sheet(8, 8, 16), {-4, -4, 0}), false),
                box = unit_box();
    Random random(1);
    for (int i = 0; i < 50; ++i) {
        const float depth = i % 3 == 0 ? 0.01f : i % 3 == 1 ? 0.0f : -0.005f;
        const Pose pose = about_z(static_cast<float>(random.in(-2, 2)), static_cast<float>(random.in(-2, 2)),
                                  0.5f - depth, random.in(0, 6));
        for (const Solid* below : {&floor, &sheet}) {
            const ContactManifolds m = fresh(*below, {}, box, pose, 0.01f);
            ASSERT_EQ(m.count, 1u);
            expect_footprint(m.manifolds[0], pose, depth);
        }
    }
}

TEST(Contacts, ABoxOnABoxOfTheSameFootprint) {
    const Solid box = unit_box();
    for (const float depth : {0.01f, 0.0f, -0.005f}) {
        const Pose above{{0, 0, 1 - depth}, {}};
        const ContactManifolds m = fresh(box, {}, box, above, 0.01f);
        ASSERT_EQ(m.count, 1u);
        EXPECT_NEAR(m.manifolds[0].normal.z, 1, 1e-6);
        ASSERT_EQ(m.manifolds[0].count, 4u);
        for (const ContactPoint& c : m.manifolds[0].points) {
            EXPECT_NEAR(std::abs(c.point_b.x), 0.5, 1e-5);
            EXPECT_NEAR(std::abs(c.point_b.y), 0.5, 1e-5);
            EXPECT_NEAR(c.depth, depth, 1e-6);
        }
    }
}

TEST(Contacts, ABoxInACornerHasTwoManifolds) {
    Mesh room = shapes::moved(shapes::box(20, 20, 1), {-10, -10, -1});
    shapes::append(room, shapes::moved(shapes::box(1, 20, 5), {-1, -10, 0.001f}));
    const ContactManifolds m = fresh(exact(room), {}, unit_box(), {{0.49f, 0, 0.48f}, {}});
    ASSERT_EQ(m.count, 2u);
    EXPECT_NEAR(m.manifolds[0].normal.z, 1, 1e-6); // the deeper
    EXPECT_NEAR(m.manifolds[0].points[0].depth, 0.02, 1e-6);
    EXPECT_NEAR(m.manifolds[1].normal.x, 1, 1e-6);
    EXPECT_NEAR(m.manifolds[1].points[0].depth, 0.01, 1e-6);
    EXPECT_EQ(m.manifolds[0].count, 4u);
    EXPECT_EQ(m.manifolds[1].count, 4u);
}

TEST(Contacts, ATableStandsOnFourFeet) {
    Mesh table = shapes::moved(shapes::box(2, 1, 0.1f), {-1, -0.5f, 1});
    for (const float x : {-0.95f, 0.85f})
        for (const float y : {-0.45f, 0.35f})
            shapes::append(table, shapes::moved(shapes::box(0.1f, 0.1f, 1.01f), {x, y, 0}));
    const ContactManifolds m = fresh(floor_box(), {}, exact(table), {{0, 0, -0.002f}, {}});
    ASSERT_EQ(m.count, 1u);
    ASSERT_EQ(m.manifolds[0].count, 4u);
    for (const ContactPoint& c : m.manifolds[0].points) { // the outermost corners of the feet
        EXPECT_NEAR(std::abs(c.point_b.x), 0.95, 1e-5);
        EXPECT_NEAR(std::abs(c.point_b.y), 0.45, 1e-5);
        EXPECT_NEAR(c.depth, 0.002, 1e-6);
    }
}

TEST(Contacts, EdgesThatCross) {
    // Two boxes on their edges, crossed: one point, straight up.
    const Solid box = unit_box();
    const float s = std::numbers::sqrt2_v<float> / 2, c = std::cos(std::numbers::pi_v<float> / 8),
                d = std::sin(std::numbers::pi_v<float> / 8);
    const Pose below{{}, {d, 0, 0, c}};
    for (const float depth : {0.02f, -0.004f}) {
        const ContactManifolds m = fresh(box, below, box, {{0.1f, 0.05f, 2 * s - depth}, {0, d, 0, c}}, 0.005f);
        ASSERT_EQ(m.count, 1u);
        ASSERT_EQ(m.manifolds[0].count, 1u);
        EXPECT_NEAR(m.manifolds[0].normal.z, 1, 1e-5);
        const ContactPoint& p = m.manifolds[0].points[0];
        EXPECT_NEAR(p.depth, depth, 1e-5);
        EXPECT_NEAR(p.point_a.x, 0.1, 1e-5);
        EXPECT_NEAR(p.point_a.y, 0, 1e-5);
    }
}

TEST(Contacts, BallsTouchAlongTheirCenters) {
    const Solid ball = exact(shapes::icosphere(4));
    Random random(2);
    for (int i = 0; i < 20; ++i) {
        const Point d = random.direction();
        const double depth = random.in(-0.01, 0.02);
        const Pose other{scenes::to_float({(2 - depth) * d[0], (2 - depth) * d[1], (2 - depth) * d[2]}),
                         random.rotation()};
        const ContactManifolds m = fresh(ball, {{}, random.rotation()}, ball, other, 0.02f);
        ASSERT_GE(m.count, 1u);
        EXPECT_GT(dot(m.manifolds[0].normal, scenes::to_float(d)), 0.99);
        float deepest = -1;
        for (uint32_t k = 0; k < m.manifolds[0].count; ++k) deepest = std::max(deepest, m.manifolds[0].points[k].depth);
        EXPECT_NEAR(deepest, depth, 0.006); // facets
    }
}

TEST(Contacts, EllipsoidsTouchWhereTheSlowAnswerSays) {
    Random random(3);
    int deep = 0, near = 0;
    for (int i = 0; i < 200; ++i) {
        const auto some = [&] { return proxy(random, scenes::radii(random, 4)); };
        const Solid a = some(), b = some();
        const Point d = random.direction();
        const double t = random.in(0.8, 2.2);
        const Pose pose_a{{}, random.rotation()},
            pose_b{scenes::to_float({t * d[0], t * d[1], t * d[2]}), random.rotation()};
        const float margin = 0.1f;
        const ContactManifolds m = fresh(a, pose_a, b, pose_b, margin);
        const Ellipsoid x = a.view().ellipsoid(0), y = b.view().ellipsoid(0);
        const auto gap = [&](const Pose& pose) {
            return query::distance_of(query::place(x), query::place(y, query::relative_pose(pose_a, pose)), 1e-9);
        };
        if (gap(pose_b).lower > margin) {
            EXPECT_EQ(m.count, 0u);
            continue;
        }
        ASSERT_EQ(m.count, 1u);
        ASSERT_EQ(m.manifolds[0].count, 1u);
        const ContactPoint& p = m.manifolds[0].points[0];
        ++(p.depth > 0 ? deep : near);
        // Moved by the depth along the normal, B touches A.
        Pose moved = pose_b;
        const Vec3 n = m.manifolds[0].normal;
        moved.translation.x += p.depth * n.x, moved.translation.y += p.depth * n.y,
            moved.translation.z += p.depth * n.z;
        const reference::Pair pair(x, pose_a, y, moved);
        EXPECT_NEAR(static_cast<double>(reference::contact(pair)), 1, 2e-5);
        EXPECT_NEAR(distance_of(p.point_a, p.point_b), std::abs(p.depth), 1e-6);
    }
    EXPECT_GT(deep, 30);
    EXPECT_GT(near, 5);
}

TEST(Contacts, ATriangleOnAnEllipsoid) {
    Random random(4);
    const Solid floor = floor_box(), ball = proxy(random, {1, 1, 1});
    const Ellipsoid e = ball.view().ellipsoid(0);
    for (const bool swap : {false, true})
        for (int i = 0; i < 20; ++i) {
            Pose pose{{static_cast<float>(random.in(-2, 2)), 1.3f, 0}, random.rotation()};
            pose.translation.z = static_cast<float>(random.in(0.95, 1.1));
            // The lowest point of the ellipsoid.
            const Point down =
                scenes::rotate({-pose.rotation.x, -pose.rotation.y, -pose.rotation.z, pose.rotation.w}, {0, 0, 1});
            const double w[3] = {e.l11 * down[0] + e.l21 * down[1] + e.l31 * down[2], e.l22 * down[1] + e.l32 * down[2],
                                 e.l33 * down[2]};
            const double lowest = pose.translation.z + down[0] * e.center.x + down[1] * e.center.y +
                                  down[2] * e.center.z - std::hypot(w[0], w[1], w[2]);
            const ContactManifolds m = swap ? fresh(ball, pose, floor, {}, 0.2f) : fresh(floor, {}, ball, pose, 0.2f);
            ASSERT_EQ(m.count, 1u);
            EXPECT_NEAR(m.manifolds[0].normal.z, swap ? -1 : 1, 1e-3);
            float deepest = -1;
            for (uint32_t k = 0; k < m.manifolds[0].count; ++k)
                deepest = std::max(deepest, m.manifolds[0].points[k].depth);
            EXPECT_NEAR(deepest, -lowest, 1e-3);
        }
}

// ---- flat ground ----

// Bodies in flat ground: one manifold, its normal, and the depth of the deepest vertex, whatever the triangles are.

/// The sheet's cells are of different sizes, and split along either diagonal.
Mesh uneven_sheet(Random& random, uint32_t n, float half) {
    Mesh mesh = shapes::sheet(2 * half, 2 * half, n);
    std::vector<float> at(n + 1);
    for (float& x : at) x = static_cast<float>(random.in(-half, half));
    at.front() = -half, at.back() = half;
    std::sort(at.begin(), at.end());
    for (uint32_t i = 0; i <= n; ++i)
        for (uint32_t j = 0; j <= n; ++j) mesh.vertices[i * (n + 1) + j] = {at[i], at[j], 0};
    for (size_t cell = 0; cell < mesh.triangles.size(); cell += 2) {
        const uint32_t a = mesh.triangles[cell][0], b = mesh.triangles[cell][1], c = mesh.triangles[cell][2],
                       d = mesh.triangles[cell + 1][2];
        if (random.below(2) == 0) mesh.triangles[cell] = {a, b, d}, mesh.triangles[cell + 1] = {b, c, d};
    }
    return mesh;
}
/// Closed, with this top.
Mesh slab_below(const Mesh& top, uint32_t n, float thickness) {
    Mesh mesh = top;
    const auto count = static_cast<uint32_t>(top.vertices.size());
    for (const Vec3& v : top.vertices) mesh.vertices.push_back({v.x, v.y, v.z - thickness});
    for (const Triangle& t : top.triangles) mesh.triangles.push_back({t[0] + count, t[2] + count, t[1] + count});
    const auto wall = [&](uint32_t a, uint32_t b) { // from a to b, counter-clockwise around the top
        mesh.triangles.push_back({b, a, a + count});
        mesh.triangles.push_back({b, a + count, b + count});
    };
    for (uint32_t i = 0; i < n; ++i) {
        const uint32_t row = n + 1;
        wall(i * row, (i + 1) * row), wall(n * row + i, n * row + i + 1);
        wall((i + 1) * row + n, i * row + n), wall(i + 1, i);
    }
    return mesh;
}
/// As the pose places it; rounded, so that what was flat is so but for that.
Mesh turned(Mesh mesh, const Quat& rotation) {
    for (Vec3& v : mesh.vertices) v = scenes::to_float(scenes::rotate(rotation, {v.x, v.y, v.z}));
    return mesh;
}
/// Every vertex of the unit sphere pushed apart along z, or scaled.
Mesh stretched(Mesh mesh, float x, float y, float z, float apart = 0) {
    for (Vec3& v : mesh.vertices) v = {x * v.x, y * v.y, z * v.z + (v.z > 0 ? apart : -apart)};
    return mesh;
}
/// A prism of n sides with fans for its ends.
Mesh prism(uint32_t n, float radius, float half) {
    Mesh mesh{{{0, 0, -half}, {0, 0, half}}, {}};
    for (uint32_t i = 0; i < n; ++i) {
        const float u = 2 * std::numbers::pi_v<float> * static_cast<float>(i) / static_cast<float>(n);
        for (const float z : {-half, half}) mesh.vertices.push_back({radius * std::cos(u), radius * std::sin(u), z});
        const uint32_t a = 2 + 2 * i, b = 2 + 2 * ((i + 1) % n);
        mesh.triangles.insert(mesh.triangles.end(), {{0, b, a}, {1, a + 1, b + 1}, {a, b, b + 1}, {a, b + 1, a + 1}});
    }
    return mesh;
}
struct Convex {
    const char* name;
    Mesh mesh;
    Solid solid;
};
std::vector<Convex> convex_bodies() {
    std::vector<Convex> out;
    const auto add = [&](const char* name, const Mesh& mesh) { out.push_back({name, mesh, exact(mesh)}); };
    add("cube", shapes::moved(shapes::box(), {-0.5f, -0.5f, -0.5f}));
    add("plank", shapes::moved(shapes::box(1, 0.5f, 0.25f), {-0.5f, -0.25f, -0.125f}));
    add("fine ball", shapes::moved(shapes::icosphere(4), {}, 0.5f));
    add("coarse ball", shapes::moved(shapes::icosphere(1), {}, 0.5f));
    add("tetrahedron", shapes::moved(shapes::tetrahedron(), {-0.25f, -0.25f, -0.25f}));
    add("capsule", stretched(shapes::icosphere(3), 0.2f, 0.2f, 0.2f, 0.3f));
    add("ellipsoid", stretched(shapes::icosphere(3), 0.6f, 0.3f, 0.2f));
    add("cylinder", prism(32, 0.3f, 0.4f));
    return out;
}
struct Ground {
    const char* name;
    Solid solid;
    Quat rotation; ///< of its normal, from (0, 0, 1)
};
std::vector<Ground> grounds() {
    constexpr float kHalf = 2;
    constexpr uint32_t kCells = 16; // of 0.25
    std::vector<Ground> out;
    Random random(21);
    const Mesh cells = shapes::moved(shapes::sheet(2 * kHalf, 2 * kHalf, kCells), {-kHalf, -kHalf, 0}),
               square = shapes::moved(shapes::sheet(2 * kHalf, 2 * kHalf, 1), {-kHalf, -kHalf, 0}),
               uneven = uneven_sheet(random, kCells, kHalf);
    const Quat tilted = random.rotation(), other = random.rotation();
    out.push_back({"floor of cells", exact(cells, false), {}});
    out.push_back({"slab of cells", exact(slab_below(cells, kCells, 1)), {}});
    out.push_back({"square of two triangles", exact(square, false), {}});
    out.push_back({"box", exact(slab_below(square, 1, 1)), {}});
    out.push_back({"tilted floor", exact(turned(uneven, tilted), false), tilted});
    out.push_back({"tilted slab", exact(turned(slab_below(uneven, kCells, 1), other)), other});
    return out;
}

double lowest_along(const Mesh& mesh, const Quat& rotation, const Point& up) {
    double low = HUGE_VAL;
    for (const Vec3& v : mesh.vertices) {
        const Point p = scenes::rotate(rotation, {v.x, v.y, v.z});
        low = std::min(low, p[0] * up[0] + p[1] * up[1] + p[2] * up[2]);
    }
    return low;
}
// Deepest point of a manifold.
double depth_of(const Manifold& m) {
    double out = -HUGE_VAL;
    for (uint32_t k = 0; k < m.count; ++k) out = std::max(out, double{m.points[k].depth});
    return out;
}
Point operator+(const Point& a, const Point& b) {
    return {a[0] + b[0], a[1] + b[1], a[2] + b[2]};
}
// The pose at which `mesh` is so deep in the half-space below `surface`, a point, `up` being its outward normal.
Pose resting(const Mesh& mesh, const Quat& rotation, const Point& up, const Point& surface, double depth) {
    const double h = -lowest_along(mesh, rotation, up) - depth;
    return {scenes::to_float(surface + Point{h * up[0], h * up[1], h * up[2]}), rotation};
}

TEST(Contacts, FlatGroundHasOneNormalAndTheDepthOfTheDeepestVertex) {
    const auto bodies = convex_bodies();
    Random random(22);
    for (const Ground& ground : grounds())
        for (const Convex& body : bodies)
            for (const double depth : {-0.005, 0.001, 0.01, 0.03, 0.1}) {
                int ghosts = 0;
                double worst = 0;
                for (int i = 0; i < 20; ++i) {
                    const Pose below{scenes::to_float(random.direction()), random.rotation()};
                    const auto placed = [&](const Point& p) {
                        return scenes::rotate(below.rotation, scenes::rotate(ground.rotation, p));
                    };
                    const Point up = placed({0, 0, 1}),
                                surface = placed({random.in(-0.5, 0.5), random.in(-0.5, 0.5), 0}) +
                                          Point{below.translation.x, below.translation.y, below.translation.z};
                    const Pose pose = resting(body.mesh, random.rotation(), up, surface, depth);
                    const float margin = depth < 0 || i % 2 == 0 ? 0.01f : 0;
                    const bool swap = i % 4 < 2;
                    const ContactManifolds m = swap ? fresh(body.solid, pose, ground.solid, below, margin)
                                                    : fresh(ground.solid, below, body.solid, pose, margin);
                    const double along = dot(m.manifolds[0].normal, scenes::to_float(up));
                    ghosts += m.count != 1 || (swap ? -along : along) < 1 - 1e-6;
                    worst = std::max(worst, std::abs(depth_of(m.manifolds[0]) - depth));
                }
                EXPECT_EQ(ghosts, 0) << ground.name << ", " << body.name << ", " << depth;
                EXPECT_LT(worst, 1e-6 + 0.01 * std::abs(depth)) << ground.name << ", " << body.name << ", " << depth;
            }
}

TEST(Contacts, FineBallsReportTheirDepth) {
    const Mesh fine = shapes::icosphere(5);
    const Solid ball = exact(fine), cube = unit_box();
    Random random(23);
    for (const double depth : {0.003, 0.01, 0.1})
        for (int i = 0; i < 10; ++i) {
            const Point d = random.direction();
            const ContactManifolds on_cube = fresh(
                cube, {}, ball, resting(fine, random.rotation(), {0, 0, 1}, {0.1 * d[0], 0.1 * d[1], 0.5}, depth));
            ASSERT_EQ(on_cube.count, 1u);
            EXPECT_GT(on_cube.manifolds[0].normal.z, 1 - 1e-5);
            EXPECT_NEAR(depth_of(on_cube.manifolds[0]), depth, 0.01 * depth);

            const Pose below{{}, random.rotation()};
            const double top = -lowest_along(fine, below.rotation, {-d[0], -d[1], -d[2]});
            const ContactManifolds on_ball = fresh(
                ball, below, ball, resting(fine, random.rotation(), d, {top * d[0], top * d[1], top * d[2]}, depth));
            ASSERT_EQ(on_ball.count, 1u);
            EXPECT_GT(dot(on_ball.manifolds[0].normal, scenes::to_float(d)), std::cos(0.03));
            EXPECT_NEAR(depth_of(on_ball.manifolds[0]), depth, 0.1 * depth + 2e-4); // facets
        }
}

// A sheet of cells, bent along x = 0: a roof where slope > 0, else a valley.
Mesh bent(uint32_t cells, float slope) {
    Mesh mesh = shapes::moved(shapes::sheet(4, 4, cells), {-2, -2, 0});
    for (Vec3& v : mesh.vertices) v.z = -slope * std::abs(v.x);
    return mesh;
}

TEST(Contacts, ConvexEdgesHaveTheNormalOfWhatLiesOnThem) {
    constexpr uint32_t kCells = 16;
    const Mesh mesh = shapes::moved(shapes::box(), {-0.5f, -0.5f, -0.5f});
    const Solid cube = exact(mesh);
    Random random(24);
    for (const float slope : {0.1f, 0.5f, 1.0f})
        for (const bool closed : {false, true}) {
            const Mesh roof = bent(kCells, slope);
            const Solid ground = closed ? exact(slab_below(roof, kCells, 3)) : exact(roof, false);
            for (const double depth : {0.001, 0.01, 0.03})
                for (int i = 0; i < 20; ++i) { // a face of the cube lies across the ridge, tilted less than the slope
                    const double tilt = random.in(-0.4, 0.4) * std::atan(slope), turn = random.in(0, 6);
                    const double s = std::sin(tilt / 2), c = std::cos(tilt / 2), u = std::sin(turn / 2),
                                 w = std::cos(turn / 2);
                    const Quat rotation{static_cast<float>(s * u), static_cast<float>(s * w), static_cast<float>(c * u),
                                        static_cast<float>(c * w)};
                    const Point up = scenes::rotate(rotation, {0, 0, 1});
                    const Pose pose = resting(mesh, rotation, up, {0, random.in(-1, 1), 0}, depth);
                    const ContactManifolds m = fresh(ground, {}, cube, pose);
                    ASSERT_EQ(m.count, 1u) << slope << ' ' << closed << ' ' << depth << ' ' << i;
                    EXPECT_GT(dot(m.manifolds[0].normal, scenes::to_float(up)), std::cos(0.02 + 2 * depth));
                    EXPECT_NEAR(depth_of(m.manifolds[0]), depth, 0.01 * depth);
                }
        }
}

TEST(Contacts, ConcaveEdgesHaveTheNormalsOfBothFaces) {
    Random random(25);
    for (const auto& [fineness, kCells] : {std::pair{2, 16u}, {4, 16u}, {5, 100u}}) {
        const Mesh mesh = shapes::moved(shapes::icosphere(fineness), {}, 0.5f);
        const Solid ball = exact(mesh);
        for (const float slope : {0.5f, 1.0f})
            for (const bool closed : {false, true}) {
                const Mesh valley = bent(kCells, -slope);
                const Solid ground = closed ? exact(slab_below(valley, kCells, 1)) : exact(valley, false);
                const double size = std::hypot(1, slope);
                const Point sides[2] = {{slope / size, 0, 1 / size}, {-slope / size, 0, 1 / size}};
                for (const double depth : {-0.004, 0.001, 0.003, 0.01})
                    for (int i = 0; i < 10; ++i) { // as deep in the one side as in the other
                        const Quat rotation = random.rotation();
                        const double h = -lowest_along(mesh, rotation, sides[0]) - depth,
                                     k = -lowest_along(mesh, rotation, sides[1]) - depth;
                        const Pose pose{scenes::to_float({(h - k) / (2 * sides[0][0]), random.in(-1, 1),
                                                          (h + k) / (2 * sides[0][2])}),
                                        rotation};
                        const ContactManifolds m = fresh(ground, {}, ball, pose, depth < 0 ? 0.01f : 0);
                        ASSERT_EQ(m.count, 2u) << fineness << ' ' << slope << ' ' << closed << ' ' << depth;
                        for (const Point& side : sides) {
                            const auto of_side = [&](const Manifold& n) {
                                return dot(n.normal, scenes::to_float(side)) > 1 - 1e-5 &&
                                       std::abs(depth_of(n) - depth) < 0.02 * std::abs(depth);
                            };
                            EXPECT_EQ(std::count_if(m.manifolds, m.manifolds + 2, of_side), 1);
                        }
                    }
            }
    }
}

// ---- hooks ----

// The world's z onto itself and turned by `spin`; then about x by a right angle and `tilt`.
Quat upright(double tilt, double spin) {
    const double h = std::numbers::pi / 4 + tilt / 2, s = spin / 2;
    return {static_cast<float>(std::sin(h) * std::cos(s)), static_cast<float>(-std::sin(h) * std::sin(s)),
            static_cast<float>(std::cos(h) * std::sin(s)), static_cast<float>(std::cos(h) * std::cos(s))};
}
Vec3 moved_by(const Vec3& p, double t, const Vec3& d) {
    return scenes::to_float({p.x + t * d.x, p.y + t * d.y, p.z + t * d.z});
}

// Two rings like links of a chain, pulled apart until their insides press against each other. Where they touch, both
// are saddles, along which a climb goes around to the far side.
TEST(Contacts, LinkedRingsArePushedBackIntoTheirHoles) {
    Random random(31);
    for (const uint32_t sides : {48u, 90u}) {
        const Solid ring = exact(shapes::torus(1, 0.2f, sides, sides / 2));
        for (const double depth : {0.001, 0.003, 0.01, 0.03, 0.1})
            for (int i = 0; i < 6; ++i) {
                const Pose a = about_z(0, 0, 0, random.in(0, 6));
                Pose b{{}, upright(i % 2 == 0 ? 0 : random.in(-0.5, 0.5), random.in(0, 6))};
                QueryContext context;
                const auto meet = [&](const Vec3& at) {
                    b.translation = at;
                    return collide(ring.view(), a, ring.view(), b, context).verdict == Verdict::overlapping;
                };
                double free = 1.3, touching = 1.7;
                for (int k = 0; k < 25; ++k) {
                    const double middle = (free + touching) / 2;
                    (meet(scenes::to_float({middle, 0, 0})) ? touching : free) = middle;
                }
                // As far as the deepest point is, they are back where they were, but for the facets; and soon apart.
                Vec3 at = scenes::to_float({touching + depth, 0, 0});
                int rounds = 0;
                for (; rounds < 6 && meet(at); ++rounds) {
                    const ContactManifolds m = i % 3 == 0 ? fresh(ring, a, ring, b) : fresh(ring, b, ring, a);
                    ASSERT_EQ(m.count, 1u);
                    const double d = depth_of(m.manifolds[0]), sign = i % 3 == 0 ? 1 : -1;
                    if (rounds == 0) {
                        EXPECT_LT(sign * m.manifolds[0].normal.x, -0.95) << sides << ' ' << depth;
                        EXPECT_GT(d, 0.6 * depth) << sides << ' ' << depth;
                        EXPECT_LT(d, 1.1 * depth + 1e-4) << sides << ' ' << depth;
                    }
                    at = moved_by(at, sign * (d + 1e-5), m.manifolds[0].normal);
                }
                EXPECT_LT(rounds, 6) << sides << ' ' << depth;
                EXPECT_NEAR(at.x, touching, 0.3 * depth + 1e-3) << sides << ' ' << depth;
            }
    }
}

// ---- one way ----

// Convex bodies that go a little into each other are apart once they are moved by what their one manifold says, and
// that is about the shortest way. Of a hundred, the search for it misses a few.
TEST(Contacts, OneManifoldSeparatesConvexBodies) {
    const auto bodies = convex_bodies();
    Random random(32);
    int several = 0, longer = 0, meeting = 0, count = 0;
    for (int i = 0; i < 600; ++i) {
        const auto n = static_cast<uint32_t>(bodies.size());
        const Solid &a = bodies[random.below(n)].solid, &b = bodies[random.below(n)].solid;
        const Point d = random.direction();
        const Pose pose_a{{}, random.rotation()};
        Pose pose_b{{}, random.rotation()};
        QueryContext context;
        const auto meet = [&](double t) {
            pose_b.translation = scenes::to_float({t * d[0], t * d[1], t * d[2]});
            return collide(a.view(), pose_a, b.view(), pose_b, context).verdict == Verdict::overlapping;
        };
        double apart = 3, touching = 0;
        for (int k = 0; k < 25; ++k) (meet((apart + touching) / 2) ? touching : apart) = (apart + touching) / 2;
        const double depth = random.log_in(1e-4, 0.05);
        if (!meet(touching - depth)) continue;
        const ContactManifolds m = fresh(a, pose_a, b, pose_b);
        ASSERT_GE(m.count, 1u);
        several += m.count > 1, ++count;
        const double found = depth_of(m.manifolds[0]);
        EXPECT_LT(found, 1.5 * depth + 1e-4) << i;
        longer += found > 1.02 * depth + 1e-4;
        pose_b.translation = moved_by(pose_b.translation, 1.02 * found + 1e-5, m.manifolds[0].normal);
        meeting += collide(a.view(), pose_a, b.view(), pose_b, context).verdict == Verdict::overlapping;
    }
    EXPECT_GT(count, 500);
    EXPECT_LT(several, count / 50);
    EXPECT_LT(longer, count / 25);
    EXPECT_LT(meeting, count / 50);
}

TEST(Contacts, ABudgetBoundsTriangleTestsToo) {
    // A margin with which everything is near everything.
    const Solid ball = exact(shapes::icosphere(3)), sheet = exact(shapes::sheet(2, 2, 24), false);
    QueryContext context;
    ContactManifolds m;
    for (const uint64_t most : {0, 1, 10, 100, 1000, 10000}) {
        const QueryOptions options{.max_pair_tests = most, .margin = 100};
        const ContactResult r = contacts(ball.view(), {}, sheet.view(), {{3, 0, 0}, {}}, m, context, options);
        EXPECT_EQ(r.verdict, r.found > 0 ? Verdict::overlapping : Verdict::undecided);
        EXPECT_LE(r.found, most);
        const CollideAllResult all = collide_all(ball.view(), {}, sheet.view(), {{3, 0, 0}, {}}, {}, context, options);
        EXPECT_LE(all.stats.tests(), most);
        EXPECT_LE(all.found, most);
    }
}

// The budget may end a later search before its first pair: what met in the first one is a point all the same.
TEST(Contacts, WhatMeetsHasAPointWithAnyBudget) {
    const Solid ring = exact(shapes::torus(1, 0.3f, 40, 20), false), ball = exact(shapes::icosphere(3));
    Random random(12);
    QueryContext context;
    int overlapping = 0;
    for (const Solid* other : {&ring, &ball})
        for (int i = 0; i < 20; ++i) {
            const Pose pose = scenes::pose_at(random, random.in(0.2, 1.5));
            ContactManifolds m;
            const ContactResult whole = contacts(ring.view(), {}, other->view(), pose, m, context);
            for (uint64_t part = 1; part < 40; ++part) {
                const QueryOptions options{.max_pair_tests = whole.stats.tests() * part / 40};
                const ContactResult r = contacts(ring.view(), {}, other->view(), pose, m, context, options);
                if (r.verdict != Verdict::overlapping || r.enclosed) continue;
                ++overlapping;
                ASSERT_GE(m.count, 1u) << i << ' ' << part;
                ASSERT_GE(m.manifolds[0].count, 1u);
            }
        }
    EXPECT_GT(overlapping, 100);
}

// Where a body touches with parts that do not hang together, or hang together far from there, climbs around one do not
// see how deep the others are.
TEST(Contacts, TheDepthIsThatOfTheDeepestPart) {
    const Solid ground = exact(shapes::moved(shapes::box(20, 20, 4), {-10, -10, -4}));
    for (const float higher : {0.0f, 0.02f, 0.05f, 0.08f, 0.11f}) {
        Mesh feet = shapes::moved(shapes::icosphere(4), {-2, 0, 0});
        shapes::append(feet, shapes::moved(shapes::icosphere(4), {2, 0, higher}));
        for (const bool bar : {false, true}) {
            if (bar) shapes::append(feet, shapes::moved(shapes::box(5, 1, 1), {-2.5, -0.5, 0}));
            const Pose pose{{0.1f, 0.2f, 0.88f}, {}};
            const ContactManifolds m = fresh(ground, {}, exact(feet), pose);
            ASSERT_EQ(m.count, 1u);
            EXPECT_NEAR(depth_of(m.manifolds[0]), 0.12, 1e-4) << higher;
        }
    }
}

// Of these trees some leaves lie above the last level: among the nodes that meet are some with triangles, and others,
// and of the other tree none has any.
// Climbs of fine bodies that are apart end near the way between their nearest points, not on it.
TEST(Contacts, BodiesWithinTheMarginAreAsFarApartAsTheirDistance) {
    Random random(31);
    const auto context = std::make_unique<QueryContext>();
    for (int i = 0; i < 8; ++i) {
        const uint32_t cells = 8 + random.below(20);
        const auto valley =
            scenes::exact_tree(slab_below(bent(cells, -static_cast<float>(random.in(0.3, 1.2))), cells, 1));
        const auto ball = scenes::exact_tree(stretched(shapes::icosphere(3), 0.3f, 0.5f, 0.3f));
        const TreeView a = *TreeView::open(valley.bytes), b = *TreeView::open(ball.bytes);
        const Pose p{{}, random.rotation()};
        const double height = random.in(0.5, 1);
        const Pose q{scenes::to_float(scenes::rotate(p.rotation, {random.in(-0.1, 0.1), 0, height})),
                     random.rotation()};
        const DistanceResult d = distance(a, p, b, q, *context);
        if (d.verdict != Verdict::separated) continue;
        ContactManifolds m;
        const auto margin = static_cast<float>(d.upper * random.in(1.05, 3));
        ASSERT_EQ(contacts(a, p, b, q, m, *context, {.margin = margin}).verdict, Verdict::overlapping);
        ASSERT_GT(m.count, 0u);
        double deepest = -HUGE_VAL;
        for (uint32_t k = 0; k < m.count; ++k)
            for (uint32_t n = 0; n < m.manifolds[k].count; ++n)
                deepest = std::max(deepest, double{m.manifolds[k].points[n].depth});
        EXPECT_NEAR(deepest, -d.upper, 0.06 * d.upper + 1e-3) << i;
    }
}

TEST(Contacts, ALevelMayCutWhereSomeNodesAreLeaves) {
    const scenes::ExactScene scene =
        scenes::exact_tree(shapes::torus(1, 0.3f, 37, 17), {.degree = 5, .leaf_triangles = 2});
    const TreeView torus = *TreeView::open(scene.bytes);
    Random random(11);
    const scenes::Scene cover = scenes::tree(random, scenes::cloud(random, 600), {.degree = 5});
    const auto context = std::make_unique<QueryContext>();
    for (const TreeView& other : {torus, *TreeView::open(cover.bytes)}) {
        uint64_t most = 0;
        for (int i = 0; i < 200; ++i) {
            const Pose pose = scenes::pose_at(random, random.in(0, 1));
            for (uint32_t level = 0; level < torus.level_count(); ++level) {
                ContactManifolds m;
                const ContactResult r = contacts(torus, {}, other, pose, m, *context, {.max_level = level});
                EXPECT_EQ(r.verdict, collide(torus, {}, other, pose, *context, {.max_level = level}).verdict);
                EXPECT_EQ(m.count > 0, r.found > 0);
                most = std::max(most, r.found);
            }
        }
        EXPECT_GT(most, query::kMany);
    }
}

TEST(Contacts, ACubeOnItsCorner) {
    const Solid floor = exact(shapes::moved(shapes::sheet(2, 2, 1), {-1, -1, 0}), false), cube = unit_box();
    const ContactManifolds m = fresh(floor, {}, cube, {{-0.3466f, 0.3485f, 0.7101f}, {-0.1f, 0, -0.4f, -0.4f}});
    ASSERT_EQ(m.count, 1u);
    EXPECT_NEAR(m.manifolds[0].normal.z, 1, 1e-6);
    EXPECT_NEAR(depth_of(m.manifolds[0]), 0.00202, 1e-5);
}

// ---- time ----

std::vector<uint64_t> ids_of(const ContactManifolds& m) {
    std::vector<uint64_t> out;
    for (uint32_t i = 0; i < m.count; ++i)
        for (uint32_t k = 0; k < m.manifolds[i].count; ++k) out.push_back(m.manifolds[i].points[k].id);
    return out;
}

TEST(Contacts, PointsOfASlidingBoxKeepTheirIdsAndImpulses) {
    const Solid sheet = exact(shapes::moved(shapes::sheet(8, 8, 16), {-4, -4, 0}), false), box = unit_box();
    for (const Solid& below : {floor_box(), sheet}) {
        ContactManifolds m;
        std::vector<uint64_t> first;
        for (int step = 0; step < 200; ++step) {
            const Pose pose = about_z(0.01f * static_cast<float>(step) - 1, 0.004f * static_cast<float>(step), 0.498f,
                                      0.3 + 0.002 * step);
            ask(below, {}, box, pose, m);
            ASSERT_EQ(m.count, 1u);
            ASSERT_EQ(m.manifolds[0].count, 4u);
            if (step == 0) first = ids_of(m);
            ASSERT_EQ(ids_of(m), first) << step;
            for (ContactPoint& p : m.manifolds[0].points) {
                EXPECT_EQ(p.age, static_cast<uint32_t>(step));
                EXPECT_EQ(p.impulse[0], step == 0 ? 0 : static_cast<float>(p.id % 1000));
                p.impulse[0] = static_cast<float>(p.id % 1000);
            }
        }
    }
}

TEST(Contacts, AStackAtRestDoesNotJitter) {
    const Solid box = unit_box();
    Random random(5);
    ContactManifolds m;
    std::vector<uint64_t> first;
    const auto shake = [&](float x) { return x + static_cast<float>(random.in(-2e-6, 2e-6)); };
    for (int step = 0; step < 300; ++step) {
        // The order of the poses' bits changes at random, and so does which of two corners is the deepest.
        const Pose lower{{shake(0), shake(0), shake(0)}, {shake(0), shake(0), shake(0), 1}},
            upper{{shake(0), shake(0.2f), shake(0.999f)}, {shake(0), shake(0), shake(0.1f), 1}};
        ask(box, lower, box, upper, m, 0.001f);
        ASSERT_EQ(m.count, 1u);
        ASSERT_EQ(m.manifolds[0].count, 4u);
        EXPECT_GT(m.manifolds[0].normal.z, 1 - 1e-6);
        if (step == 0) first = ids_of(m);
        ASSERT_EQ(ids_of(m), first) << step;
        for (const ContactPoint& p : m.manifolds[0].points) EXPECT_NEAR(p.depth, 0.001, 2e-5);
    }
}

TEST(Contacts, LeavingPointsAreForgotten) {
    const Solid floor = floor_box(), box = unit_box();
    ContactManifolds m;
    ask(floor, {}, box, about_z(0, 0, 0.499f, 0), m);
    EXPECT_EQ(m.count, 1u);
    ask(floor, {}, box, about_z(0, 0, 2, 0), m);
    EXPECT_EQ(m.count, 0u);
    ask(floor, {}, box, about_z(0, 0, 0.499f, 0), m);
    EXPECT_EQ(m.manifolds[0].points[0].age, 0u);
}

// ---- what holds for all bodies ----

std::vector<Solid> zoo() {
    Random random(6);
    std::vector<Solid> out{unit_box(),
                           exact(shapes::torus(1, 0.3f, 24, 12)),
                           exact(shapes::icosphere(2)),
                           exact(shapes::sheet(2, 2, 6), false),
                           exact(shapes::tetrahedron()),
                           exact(shapes::moved(shapes::box(2, 2, 1e-3f), {-1, -1, 0}))};
    out.push_back({scenes::tree(random, scenes::cloud(random, 300), {}).bytes});
    out.push_back(proxy(random, {1, 0.4, 0.7}));
    return out;
}
template <class Check> void for_each_query(int rounds, Check&& check) {
    const auto solids = zoo();
    Random random(7);
    for (int i = 0; i < rounds; ++i) {
        const auto n = static_cast<uint32_t>(solids.size());
        const Solid &a = solids[random.below(n)], &b = solids[random.below(n)];
        const Point d = random.direction();
        const double t = random.in(0, 2.5);
        const Pose pose_a{scenes::to_float(random.direction()), random.rotation()};
        const Pose pose_b{{pose_a.translation.x + static_cast<float>(t * d[0]),
                           pose_a.translation.y + static_cast<float>(t * d[1]),
                           pose_a.translation.z + static_cast<float>(t * d[2])},
                          random.rotation()};
        check(a, pose_a, b, pose_b, i % 2 ? 0.05f : 0.0f);
    }
}
bool same(const ContactManifolds& x, const ContactManifolds& y) {
    if (x.count != y.count) return false;
    for (uint32_t i = 0; i < x.count; ++i) {
        const Manifold &m = x.manifolds[i], &n = y.manifolds[i];
        if (m.normal != n.normal || m.count != n.count) return false;
        for (uint32_t k = 0; k < m.count; ++k) {
            const ContactPoint &p = m.points[k], &q = n.points[k];
            if (p.point_a != q.point_a || p.point_b != q.point_b || p.depth != q.depth || p.id != q.id ||
                p.age != q.age)
                return false;
        }
    }
    return true;
}

TEST(Contacts, VerdictsAreThoseOfCollideAndContactsArePoints) {
    int overlapping = 0, apart = 0;
    for_each_query(400, [&](const Solid& a, const Pose& pose_a, const Solid& b, const Pose& pose_b, float margin) {
        QueryContext context;
        ContactManifolds m;
        const ContactResult r = ask(a, pose_a, b, pose_b, m, margin);
        const CollideResult c = collide(a.view(), pose_a, b.view(), pose_b, context, {.margin = margin});
        ASSERT_EQ(r.verdict, c.verdict);
        ASSERT_EQ(r.enclosed, c.enclosed);
        ++(r.verdict == Verdict::overlapping ? overlapping : apart);
        EXPECT_EQ(m.count > 0, r.verdict == Verdict::overlapping && !r.enclosed);
        for (uint32_t i = 0; i < m.count; ++i) {
            EXPECT_NEAR(dot(m.manifolds[i].normal, m.manifolds[i].normal), 1, 1e-5);
            EXPECT_GE(m.manifolds[i].count, 1u);
            for (uint32_t k = 0; k < m.manifolds[i].count; ++k) {
                const ContactPoint& p = m.manifolds[i].points[k];
                EXPECT_GE(p.depth, -margin - 1e-5);
                EXPECT_LE(p.depth, 2.5);
                const Vec3 between{p.point_a.x - p.point_b.x, p.point_a.y - p.point_b.y, p.point_a.z - p.point_b.z};
                EXPECT_NEAR(dot(between, m.manifolds[i].normal), p.depth, 1e-5);
                for (uint32_t l = 0; l < k; ++l) EXPECT_NE(p.id, m.manifolds[i].points[l].id);
            }
        }
    });
    EXPECT_GT(overlapping, 100);
    EXPECT_GT(apart, 100);
}

// What the first pass does not know of a pair, because a patch resolved it that made no manifold, the second one finds:
// the manifolds are as deep as those of a second search.
TEST(Contacts, FewPairsAreAsDeepAsASecondSearchFindsThem) {
    const scenes::ExactScene scene = scenes::exact_tree(shapes::torus(1, 0.3f, 24, 12));
    const TreeView torus = *TreeView::open(scene.bytes);
    const auto deepest = [](const ContactManifolds& manifolds) {
        float most = -HUGE_VALF;
        for (uint32_t i = 0; i < manifolds.count; ++i)
            for (uint32_t k = 0; k < manifolds.manifolds[i].count; ++k)
                most = std::max(most, manifolds.manifolds[i].points[k].depth);
        return most;
    };
    scenes::Random random(7);
    const auto context = std::make_unique<QueryContext>();
    int count = 0;
    for (int i = 0; i < 600; ++i) {
        const Pose a = scenes::pose_at(random, random.in(0, 1.5)), b = scenes::pose_at(random, random.in(0, 1.5));
        ContactManifolds repeated, searched;
        const ContactResult r = query::contacts(torus, a, torus, b, repeated, *context, {}, query::kMany);
        if (r.found == 0 || r.found >= query::kMany) continue;
        query::contacts(torus, a, torus, b, searched, *context, {}, r.found);
        EXPECT_GT(deepest(repeated), 0.99f * deepest(searched)) << i;
        ++count;
    }
    EXPECT_GT(count, 50);
}

TEST(Contacts, ExchangedBodiesHaveExchangedContacts) {
    for_each_query(300, [](const Solid& a, const Pose& pose_a, const Solid& b, const Pose& pose_b, float margin) {
        if (&a == &b && pose_a == pose_b) return;
        const ContactManifolds ab = fresh(a, pose_a, b, pose_b, margin);
        ContactManifolds ba = fresh(b, pose_b, a, pose_a, margin);
        ASSERT_EQ(ab.count, ba.count);
        for (uint32_t i = 0; i < ab.count; ++i) {
            const Manifold &m = ab.manifolds[i], &n = ba.manifolds[i];
            ASSERT_EQ(m.count, n.count);
            EXPECT_EQ(m.normal, (Vec3{-n.normal.x, -n.normal.y, -n.normal.z}));
            for (uint32_t k = 0; k < m.count; ++k) {
                const auto found = std::count_if(n.points, n.points + n.count, [&](const ContactPoint& p) {
                    return p.point_a == m.points[k].point_b && p.point_b == m.points[k].point_a &&
                           p.depth == m.points[k].depth;
                });
                EXPECT_EQ(found, 1);
            }
        }
    });
}

TEST(Contacts, EveryInstructionSetGivesTheSameBits) {
    std::vector<ContactManifolds> first;
    targets::for_each([&](const char* name) {
        size_t i = 0;
        for_each_query(100, [&](const Solid& a, const Pose& pose_a, const Solid& b, const Pose& pose_b, float margin) {
            const ContactManifolds m = fresh(a, pose_a, b, pose_b, margin);
            if (i == first.size()) first.push_back(m);
            EXPECT_TRUE(same(first[i++], m)) << name;
        });
    });
}

TEST(Contacts, WhatIsNotFiniteHasNoPoints) {
    const Solid a = unit_box();
    for (const float bad : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
        ContactManifolds m;
        const ContactResult r = ask(a, {{bad, 0, 0}, {}}, a, {}, m);
        EXPECT_NE(r.verdict, Verdict::separated);
        EXPECT_EQ(m.count, 0u);
    }
}

} // namespace
} // namespace prolate
