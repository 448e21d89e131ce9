// Contacts of finely meshed bodies with flat faces, of which contacts() leaves out most pairs of triangles: they are as
// good as those from all pairs, and have the normals and depths of coarse meshes of the same bodies.
#include "query/contacts/contacts.hpp"
#include "tests/scenes.hpp"
#include "tests/shapes.hpp"

#include <prolate/build.hpp>
#include <prolate/contacts.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <numbers>
#include <numeric>
#include <set>
#include <stdexcept>
#include <utility>
#include <vector>

namespace prolate {
namespace {

using scenes::Point;
using scenes::Random;

constexpr int kTimes = 4; // that triangles are cut in four

Mesh subdivided(Mesh mesh, int times) {
    for (; times > 0; --times) {
        std::map<std::pair<uint32_t, uint32_t>, uint32_t> middles;
        const auto middle = [&](uint32_t a, uint32_t b) {
            const auto [at, is_new] =
                middles.try_emplace(std::minmax(a, b), static_cast<uint32_t>(mesh.vertices.size()));
            const Vec3 p = mesh.vertices[a], q = mesh.vertices[b];
            if (is_new) mesh.vertices.push_back({(p.x + q.x) / 2, (p.y + q.y) / 2, (p.z + q.z) / 2});
            return at->second;
        };
        std::vector<Triangle> finer;
        for (const auto& [a, b, c] : mesh.triangles) {
            const uint32_t ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
            finer.insert(finer.end(), {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}});
        }
        mesh.triangles = std::move(finer);
    }
    return mesh;
}
/// So that what was flat is so but for rounding.
Mesh turned(Mesh mesh, const Quat& rotation) {
    for (Vec3& v : mesh.vertices) v = scenes::to_float(scenes::rotate(rotation, {v.x, v.y, v.z}));
    return mesh;
}
Quat reversed(const Quat& q) {
    return {-q.x, -q.y, -q.z, q.w};
}
/// A prism of n sides that stands on z = 0, ends in fans around their middles.
Mesh prism(uint32_t n, float radius, float height) {
    Mesh mesh{{{0, 0, 0}, {0, 0, height}}, {}};
    for (uint32_t i = 0; i < n; ++i) {
        const float u = 2 * std::numbers::pi_v<float> * static_cast<float>(i) / static_cast<float>(n);
        for (const float z : {0.0f, height}) mesh.vertices.push_back({radius * std::cos(u), radius * std::sin(u), z});
        const uint32_t a = 2 + 2 * i, b = 2 + 2 * ((i + 1) % n);
        mesh.triangles.insert(mesh.triangles.end(), {{0, b, a}, {1, a + 1, b + 1}, {a, b, b + 1}, {a, b + 1, a + 1}});
    }
    return mesh;
}
/// A table without a top: four feet, of which none lies on another's way out.
Mesh feet() {
    Mesh mesh;
    for (const float x : {-0.4f, 0.3f})
        for (const float y : {-0.3f, 0.2f})
            shapes::append(mesh, shapes::moved(shapes::box(0.1f, 0.1f, 0.3f), {x, y, 0}));
    return mesh;
}

Tree bake(const Mesh& mesh) {
    auto built = build(mesh.view(), {.exact = true});
    if (!built) throw std::runtime_error(built.error().what);
    return std::move(built->tree);
}
/// A body both ways, turned before it is baked.
struct Body {
    Quat turn;
    Tree coarse, fine;
    Body(const Mesh& mesh, const Quat& rotation)
        : turn(rotation), coarse(bake(turned(mesh, rotation))), fine(bake(turned(subdivided(mesh, kTimes), rotation))) {
    }
};

/// The product of two rotations, then moved.
Pose placed(const Pose& pose, const Quat& turn) {
    const Quat p = pose.rotation, q = reversed(turn);
    return {pose.translation,
            {p.w * q.x + p.x * q.w + p.y * q.z - p.z * q.y, p.w * q.y - p.x * q.z + p.y * q.w + p.z * q.x,
             p.w * q.z + p.x * q.y - p.y * q.x + p.z * q.w, p.w * q.w - p.x * q.x - p.y * q.y - p.z * q.z}};
}

/// Of the largest polygon with these corners.
double area(const Manifold& m) {
    const auto corner = [&](size_t i) {
        const Vec3 p = m.points[i].point_b;
        return Point{p.x, p.y, p.z};
    };
    const auto twice = [&](size_t i, size_t j, size_t k) {
        const Point p = corner(i), q = corner(j), r = corner(k);
        const Point u{q[0] - p[0], q[1] - p[1], q[2] - p[2]}, v{r[0] - p[0], r[1] - p[1], r[2] - p[2]};
        return m.normal.x * (u[1] * v[2] - u[2] * v[1]) + m.normal.y * (u[2] * v[0] - u[0] * v[2]) +
               m.normal.z * (u[0] * v[1] - u[1] * v[0]);
    };
    if (m.count < 3) return 0;
    std::vector<size_t> order(m.count);
    std::iota(order.begin(), order.end(), size_t{0});
    double largest = 0;
    do {
        const double whole =
            twice(order[0], order[1], order[2]) + (m.count > 3 ? twice(order[0], order[2], order[3]) : 0);
        largest = std::max(largest, std::abs(whole) / 2);
    } while (std::next_permutation(order.begin(), order.end()));
    return largest;
}
double depth(const Manifold& m) {
    double out = -HUGE_VAL;
    for (uint32_t k = 0; k < m.count; ++k) out = std::max(out, double{m.points[k].depth});
    return out;
}
std::set<uint64_t> ids(const ContactManifolds& all) {
    std::set<uint64_t> out;
    for (uint32_t i = 0; i < all.count; ++i)
        for (uint32_t k = 0; k < all.manifolds[i].count; ++k) out.insert(all.manifolds[i].points[k].id);
    return out;
}

struct Scene {
    std::vector<Body> grounds, bodies; // all touch z = 0, from below and from above
};
Scene scene() {
    Random random(1);
    Scene out;
    const Mesh sheet = shapes::moved(shapes::sheet(2, 2, 1), {-1, -1, 0}),
               box = shapes::moved(shapes::box(2, 2, 1), {-1, -1, -1});
    for (const bool turn : {false, true})
        for (const Mesh& mesh : {sheet, box}) out.grounds.emplace_back(mesh, turn ? random.rotation() : Quat{});
    const Mesh brick = shapes::moved(shapes::box(0.8f, 0.5f, 0.2f), {-0.4f, -0.25f, 0});
    for (const bool turn : {false, true})
        for (const Mesh& mesh : {brick, prism(7, 0.5f, 0.3f), feet()})
            out.bodies.emplace_back(mesh, turn ? random.rotation() : Quat{});
    return out;
}

TEST(CoplanarContacts, FineMeshesHaveTheManifoldsOfCoarseOnes) {
    const Scene all = scene();
    Random random(2);
    const auto context = std::make_unique<QueryContext>();
    uint64_t looked_at = 0, pairs = 0;
    double shares = 0;
    int manifolds = 0;
    for (const Body& ground : all.grounds)
        for (const Body& body : all.bodies)
            for (const double gap : {-0.003, 0.0, 0.0005})
                for (int i = 0; i < 6; ++i) { // some hang over the rim
                    const Quat place = random.rotation();
                    const float margin = gap < 0 && i % 2 == 0 ? 0 : 0.001f;
                    const double angle = random.in(0, 6);
                    const Point at = scenes::rotate(place, {random.in(-0.9, 0.9), random.in(-0.9, 0.9), gap});
                    const Quat upright = placed({{}, place}, {0, 0, static_cast<float>(std::sin(angle / 2)),
                                                              static_cast<float>(std::cos(angle / 2))})
                                             .rotation;
                    const Pose pose_a = placed({{}, place}, ground.turn),
                               pose_b = placed({scenes::to_float(at), upright}, body.turn);
                    const auto ask = [&](const Tree& a, const Tree& b, uint64_t many, uint64_t& found) {
                        ContactManifolds out;
                        found +=
                            query::contacts(a.view(), pose_a, b.view(), pose_b, out, *context, {.margin = margin}, many)
                                .found;
                        return out;
                    };
                    uint64_t of_coarse = 0;
                    const ContactManifolds m = ask(ground.coarse, body.coarse, query::kMany, of_coarse),
                                           u = ask(ground.fine, body.fine, UINT64_MAX, pairs),
                                           n = ask(ground.fine, body.fine, query::kMany, looked_at);
                    ASSERT_EQ(m.count, n.count) << gap << ' ' << i;
                    ASSERT_EQ(u.count, n.count) << gap << ' ' << i;
                    for (uint32_t k = 0; k < m.count; ++k) {
                        const Manifold &x = m.manifolds[k], &y = n.manifolds[k];
                        EXPECT_NEAR(x.normal.x, y.normal.x, 1e-5);
                        EXPECT_NEAR(x.normal.y, y.normal.y, 1e-5);
                        EXPECT_NEAR(x.normal.z, y.normal.z, 1e-5);
                        EXPECT_NEAR(depth(x), depth(y), 1e-6);
                        const double share =
                            area(y) / area(u.manifolds[k]); // the choice of four corners is no best one
                        EXPECT_GT(share, 0.75);
                        shares += share, ++manifolds;
                    }
                }
    EXPECT_GT(manifolds, 300);
    EXPECT_GT(shares / manifolds, 0.99);
    EXPECT_LT(looked_at, pairs / 5);
}

TEST(CoplanarContacts, WhatRestsKeepsItsPoints) {
    const Scene all = scene();
    constexpr int kSettled = 3; // points of the first queries are found again, if others are better
    Random random(3);
    const auto context = std::make_unique<QueryContext>();
    for (const Body& ground : all.grounds)
        for (const Body& body : all.bodies) {
            const Quat place = random.rotation();
            const auto shake = [&](double x) { return x + random.in(-2e-6, 2e-6); };
            ContactManifolds m;
            std::set<uint64_t> settled;
            for (int step = 0; step < 20; ++step) {
                const Point at = scenes::rotate(place, {shake(0.1), shake(-0.2), shake(2e-4)});
                contacts(ground.fine.view(), placed({{}, place}, ground.turn), body.fine.view(),
                         placed({scenes::to_float(at), place}, body.turn), m, *context, {.margin = 0.001f});
                ASSERT_EQ(m.count, 1u);
                ASSERT_EQ(m.manifolds[0].count, 4u);
                if (step == kSettled) settled = ids(m);
                if (step > kSettled) {
                    EXPECT_EQ(ids(m), settled) << step;
                }
            }
        }
}

} // namespace
} // namespace prolate
