// The hierarchy over the triangles against brute force.
#include "builder/random.hpp"
#include "builder/triangle_tree.hpp"
#include "tests/shapes.hpp"

#include <gtest/gtest.h>

#include <algorithm>

namespace prolate {
namespace {

Vec random_vec(Random& random) {
    const double x = random.symmetric(), y = random.symmetric(), z = random.symmetric();
    return {x, y, z};
}

Mesh with_degenerate_triangles() {
    Mesh mesh = shapes::torus(1, 0.3f, 40, 20);
    shapes::append(mesh, shapes::moved(shapes::sheet(2, 1, 7), {0, 0, 1}));
    const auto first = static_cast<uint32_t>(mesh.vertices.size());
    mesh.vertices.insert(mesh.vertices.end(), {{2, 0, 0}, {3, 0, 0}, {5, 0, 0}, {5, 1e-6f, 1e-7f}});
    mesh.triangles.insert(mesh.triangles.end(),
                          {{first, first + 1, first + 2}, {first, first + 2, first + 3}, {first, first, first}});
    return mesh;
}

// Smallest distance over a dense sample of the triangle: an upper bound, close to the truth.
double sampled_distance(const Vec& p, const Vec& a, const Vec& b, const Vec& c, int n) {
    double nearest = HUGE_VAL;
    for (int i = 0; i <= n; ++i)
        for (int j = 0; i + j <= n; ++j)
            nearest = std::min(nearest, (p - a - (b - a) * i / n - (c - a) * j / n).norm());
    return nearest;
}

TEST(NearestPoint, OfATriangleIsInItAndNoFartherThanItsSamples) {
    Random random(1);
    for (int round = 0; round < 400; ++round) {
        const Vec a = random_vec(random), b = random_vec(random), p = 2 * random_vec(random);
        Vec c = random_vec(random);
        if (round % 4 == 1) c = a + 0.3 * (b - a);                              // collinear
        if (round % 4 == 2) c = a + 0.3 * (b - a) + 1e-12 * random_vec(random); // a needle
        if (round % 4 == 3) c = a;
        const Vec nearest = nearest_point(p, a, b, c);
        EXPECT_LE((p - nearest).norm(), sampled_distance(p, a, b, c, 64) + 1e-12);
        EXPECT_LE(sampled_distance(nearest, a, b, c, 64), 0.08); // from no point of the triangle is a sample farther
    }
    const auto of_corner = [](const Vec& p) { return nearest_point(p, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}); };
    EXPECT_EQ(of_corner({0.25, 0.25, 3}), Vec(0.25, 0.25, 0));
    EXPECT_EQ(of_corner({1, 1, 0}), Vec(0.5, 0.5, 0));
    EXPECT_EQ(of_corner({-3, -4, 0}), Vec(0, 0, 0));
}

TEST(TriangleTree, DistanceIsTheSmallestOfAllTriangles) {
    const Mesh mesh = with_degenerate_triangles();
    const TriangleTree tree(mesh.view());
    Random random(2);
    for (int round = 0; round < 2000; ++round) {
        const Vec p = 3 * random_vec(random);
        double nearest = HUGE_VAL;
        for (const auto& [a, b, c] : tree.triangles())
            nearest = std::min(nearest, (p - nearest_point(p, to_vec(a), to_vec(b), to_vec(c))).norm());
        EXPECT_EQ(tree.distance(p), nearest);
        EXPECT_EQ((p - tree.nearest(p).point).norm(), nearest);
        EXPECT_EQ(tree.distance(p, 1.001 * nearest), nearest);
        EXPECT_EQ(tree.distance(p, 0.5 * nearest), 0.5 * nearest);
    }
    EXPECT_EQ(tree.distance(to_vec(mesh.vertices[17])), 0);
}

TEST(TriangleTree, IsTheSameWhateverTheOrderOfTheTriangles) {
    const Mesh mesh = with_degenerate_triangles();
    Mesh shuffled = mesh;
    Random random(3);
    for (size_t i = shuffled.triangles.size(); i > 1; --i)
        std::swap(shuffled.triangles[i - 1], shuffled.triangles[random.bits() % i]);
    const TriangleTree one(mesh.view()), other(shuffled.view());
    EXPECT_TRUE(std::ranges::equal(one.triangles(), other.triangles()));
    ASSERT_EQ(one.nodes().size(), other.nodes().size());
    for (size_t n = 0; n < one.nodes().size(); ++n) {
        EXPECT_EQ(one.nodes()[n].begin, other.nodes()[n].begin);
        EXPECT_EQ(one.nodes()[n].right, other.nodes()[n].right);
        EXPECT_EQ(one.nodes()[n].box.low, other.nodes()[n].box.low);
        EXPECT_EQ(one.nodes()[n].box.high, other.nodes()[n].box.high);
    }
}

TEST(TriangleTree, NodesHoldTheirChildrenAndAllTriangles) {
    for (const uint32_t n : {1u, 2u, 3u, 40u}) { // 2, 8, 18 and 3200 triangles: one leaf, a full one, a few, many
        const Mesh mesh = shapes::sheet(1, 2, n);
        const TriangleTree tree(mesh.view());
        EXPECT_EQ(tree.triangles().size(), mesh.triangles.size());
        const auto nodes = tree.nodes();
        for (uint32_t i = 0; i < nodes.size(); ++i) {
            for (uint32_t t = nodes[i].begin; t < nodes[i].end; ++t)
                for (const Vec3& v : tree.triangles()[t])
                    EXPECT_TRUE((nodes[i].box.low.array() <= to_vec(v).array()).all() &&
                                (nodes[i].box.high.array() >= to_vec(v).array()).all());
            if (nodes[i].right == 0) continue;
            EXPECT_EQ(nodes[i].begin, nodes[i + 1].begin);
            EXPECT_EQ(nodes[i + 1].end, nodes[nodes[i].right].begin);
            EXPECT_EQ(nodes[i].end, nodes[nodes[i].right].end);
        }
    }
}

TEST(TriangleTree, VisitMissesNothingOfTheEllipsoid) {
    const Mesh mesh = with_degenerate_triangles();
    const TriangleTree tree(mesh.view());
    const auto radial = [](const Fit& fit, const Vec3& v) { return fit.radial_squared(to_vec(v)); };
    Random random(4);
    size_t inside_nodes = 0, skipped = 0;
    for (int round = 0; round < 500; ++round) {
        Mat factor = Mat::Zero();
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j <= i; ++j) factor(i, j) = i == j ? 0.02 + random.uniform() : 0.3 * random.symmetric();
        const Fit fit(random_vec(random), factor);
        std::vector<int> seen(tree.triangles().size(), 0); // 1: met, 2: in a node that is inside
        tree.visit(
            fit,
            [&](uint32_t n) {
                ++inside_nodes;
                for (uint32_t t = tree.nodes()[n].begin; t < tree.nodes()[n].end; ++t) seen[t] += 2;
            },
            [&](const TriangleTree::Corners& corners) { ++seen[size_t(&corners - tree.triangles().data())]; });
        for (size_t t = 0; t < seen.size(); ++t) {
            const auto& [a, b, c] = tree.triangles()[t];
            ASSERT_LE(seen[t], 2);
            if (seen[t] == 2) {
                EXPECT_LT(std::max({radial(fit, a), radial(fit, b), radial(fit, c)}), 1);
            } else if (seen[t] == 0) {
                ++skipped;
                for (const double u : {0.0, 0.3, 0.6, 1.0})
                    for (const double v : {0.0, 0.5, 1.0})
                        EXPECT_GT(fit.radial_squared((1 - u) * to_vec(a) + u * (1 - v) * to_vec(b) + u * v * to_vec(c)),
                                  1);
            }
        }
    }
    EXPECT_GT(inside_nodes, 500u);
    EXPECT_GT(skipped, 100'000u);
}

TEST(TriangleTree, OfNoTrianglesIsInfinitelyFar) {
    const TriangleTree tree{MeshView{}};
    EXPECT_EQ(tree.distance(Vec::Zero()), HUGE_VAL);
    EXPECT_EQ(tree.distance(Vec::Zero(), 3), 3);
    tree.visit(
        Fit(), [](uint32_t) { FAIL(); }, [](const TriangleTree::Corners&) { FAIL(); });
}

} // namespace
} // namespace prolate
