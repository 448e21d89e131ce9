// Points in solids: winding numbers through the tree against all triangles, in every direction and on every target.
#include "query/inside/crossing.hpp"
#include "query/inside/inside.hpp"
#include "tests/exact_scenes.hpp"
#include "tests/reference.hpp"
#include "tests/scenes.hpp"
#include "tests/shapes.hpp"
#include "tests/targets.hpp"

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

namespace prolate {
namespace {

using scenes::Point;
using scenes::Random;

query::PlacedPoint at(const Point& p) {
    return {{p[0], p[1], p[2]}, std::sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2])};
}

struct Solid {
    const char* name;
    Mesh mesh;
};
std::vector<Solid> solids() {
    Mesh nested = shapes::hollow_ball();
    shapes::append(nested, shapes::moved(shapes::box(0.5f, 0.5f, 0.5f), {-0.25f, -0.25f, -0.25f}));
    return {{"ball", shapes::icosphere(3)},
            {"box", shapes::moved(shapes::box(4, 4, 4), {-2, -2, -2})},
            {"torus", shapes::torus(1, 0.3f, 60, 24)},
            {"two pieces", shapes::two_pieces()},
            {"nested", nested},
            {"far", shapes::moved(shapes::torus(1, 0.4f, 30, 12), {1e4f, -2e4f, 3e4f})},
            {"tiny", shapes::moved(shapes::torus(1, 0.4f, 30, 12), {}, 1e-22f)},
            {"huge", shapes::moved(shapes::torus(1, 0.4f, 30, 12), {}, 1e15f)}};
}

// Winding number by solid angles (Van Oosterom and Strackee 1983).
double solid_angles(const Mesh& mesh, const Point& p) {
    double sum = 0;
    for (const Triangle& t : mesh.triangles) {
        glm::dvec3 v[3];
        for (size_t i = 0; i < 3; ++i) {
            const Vec3 x = mesh.vertices[t[i]];
            v[i] = {x.x - p[0], x.y - p[1], x.z - p[2]};
            v[i] /= glm::length(v[i]);
        }
        sum += std::atan2(glm::dot(v[0], glm::cross(v[1], v[2])),
                          1 + glm::dot(v[0], v[1]) + glm::dot(v[1], v[2]) + glm::dot(v[2], v[0]));
    }
    return sum / (2 * std::numbers::pi);
}

double distance(const Mesh& mesh, const Point& p) {
    const reference::Vector x{p[0], p[1], p[2]};
    reference::Real least = HUGE_VALL;
    for (const Triangle& t : mesh.triangles) {
        reference::Corners corners;
        for (size_t i = 0; i < 3; ++i)
            corners[i] = {mesh.vertices[t[i]].x, mesh.vertices[t[i]].y, mesh.vertices[t[i]].z};
        least = std::min(least, reference::distance(corners, {x, x, x}));
    }
    return static_cast<double>(least);
}

// A point of the mesh's box, widened; every fourth one in line with a vertex or the middle of an edge.
Point ask(Random& random, const Mesh& mesh) {
    const auto vertex = [&] {
        const Vec3 v = mesh.vertices[random.below(static_cast<uint32_t>(mesh.vertices.size()))];
        return Point{v.x, v.y, v.z};
    };
    const Point a = vertex(), b = vertex(), c = vertex();
    Point p{};
    for (size_t i = 0; i < 3; ++i)
        p[i] = a[i] + random.in(-0.2, 1.2) * (b[i] - a[i]) + random.in(0, 0.1) * (c[i] - a[i]);
    if (random.below(4) == 0) {
        const Triangle t = mesh.triangles[random.below(static_cast<uint32_t>(mesh.triangles.size()))];
        const Vec3 v = mesh.vertices[t[0]], w = mesh.vertices[t[random.below(2)]];
        const Point middle{(double{v.x} + w.x) / 2, (double{v.y} + w.y) / 2, (double{v.z} + w.z) / 2};
        const uint32_t along = random.below(3);
        for (size_t i = 0; i < 3; ++i)
            if (i != along) p[i] = middle[i];
    }
    return p;
}

TEST(Inside, TreesCountAsAllTrianglesDo) {
    for (const Solid& solid : solids()) {
        Random random(1);
        const auto scene = scenes::exact_tree(solid.mesh);
        const auto tree = *TreeView::open(scene.bytes);
        int inside = 0, culled = 0;
        const int count = 100;
        for (int i = 0; i < count; ++i) {
            const Point p = ask(random, solid.mesh);
            const double truth = solid_angles(solid.mesh, p);
            const auto place = at(p);
            QueryStats stats;
            const auto winding = query::winding_number(tree, place, stats, UINT64_MAX);
            ASSERT_TRUE(winding);
            bool same = std::abs(truth - static_cast<double>(*winding)) < 1e-3;
            for (uint32_t d = 0; d < 6; ++d)
                same = same && query::crossings(tree, {0, tree.triangle_count()}, place.position,
                                                {d / 2, d % 2 != 0}) == *winding;
            if (!same) { // only on the surface
                ASSERT_LT(distance(solid.mesh, p), 1e-13 * place.reach) << solid.name << ' ' << i;
                continue;
            }
            inside += *winding != 0;
            culled += stats.triangle_tests < tree.triangle_count();
        }
        EXPECT_GT(inside, count / 20) << solid.name;
        EXPECT_LT(inside, count * 19 / 20) << solid.name;
        EXPECT_GT(culled, count / 3) << solid.name;
    }
}

TEST(Inside, AllTargetsTakeTheSameWay) {
    const auto scene = scenes::exact_tree(shapes::torus(1, 0.3f, 60, 24), {.degree = 20});
    const auto tree = *TreeView::open(scene.bytes);
    std::vector<uint64_t> first;
    targets::for_each([&](const char* name) {
        Random random(2);
        std::vector<uint64_t> counts;
        for (int i = 0; i < 300; ++i) {
            QueryStats stats;
            const auto winding = query::winding_number(tree, at(ask(random, scene.mesh)), stats, UINT64_MAX);
            counts.insert(counts.end(),
                          {static_cast<uint64_t>(*winding), stats.pair_tests, stats.block_tests, stats.triangle_tests});
        }
        if (first.empty()) first = counts;
        EXPECT_EQ(counts, first) << name;
    });
}

TEST(Inside, StopsWithinTheBudget) {
    const auto scene = scenes::exact_tree(shapes::icosphere(4), {.degree = 20});
    const auto tree = *TreeView::open(scene.bytes);
    QueryStats all;
    ASSERT_EQ(query::winding_number(tree, at({0.01, 0.02, 0.03}), all, UINT64_MAX), 1);
    ASSERT_GT(all.pair_tests, 30u);
    for (uint64_t most = 0; most < all.tests(); ++most) {
        QueryStats stats;
        EXPECT_FALSE(query::winding_number(tree, at({0.01, 0.02, 0.03}), stats, most));
        EXPECT_LE(stats.tests(), most);
    }
    QueryStats stats;
    EXPECT_EQ(query::winding_number(tree, at({0.01, 0.02, 0.03}), stats, all.tests()), 1);
}

TEST(Inside, NodesThatDoNotEncloseAreNoticed) {
    const auto scene = scenes::exact_tree(shapes::torus(1, 0.3f, 60, 24), {.shrink = 0.7});
    const auto tree = *TreeView::open(scene.bytes);
    Random random(4);
    int wrong = 0;
    for (int i = 0; i < 1000; ++i) {
        const Point p = ask(random, scene.mesh);
        QueryStats stats;
        wrong += query::winding_number(tree, at(p), stats, UINT64_MAX) !=
                 query::crossings(tree, {0, tree.triangle_count()}, at(p).position, {});
    }
    EXPECT_GT(wrong, 10);
}

} // namespace
} // namespace prolate
