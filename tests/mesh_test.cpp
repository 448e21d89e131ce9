// clean(): welding, degenerate triangles, classification of edges, and what it refuses.
#include <prolate/mesh.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

namespace prolate {
namespace {

Mesh tetrahedron() {
    return {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}}};
}

// Every triangle with corners of its own, as STL files have it.
Mesh soup(const Mesh& mesh) {
    Mesh out;
    for (const Triangle& t : mesh.triangles) {
        const auto base = static_cast<uint32_t>(out.vertices.size());
        for (const uint32_t corner : t) out.vertices.push_back(mesh.vertices[corner]);
        out.triangles.push_back({base, base + 1, base + 2});
    }
    return out;
}

Mesh torus(uint32_t around, uint32_t across) {
    Mesh out;
    for (uint32_t i = 0; i < around; ++i)
        for (uint32_t j = 0; j < across; ++j) {
            const double u = 2 * std::numbers::pi * i / around, v = 2 * std::numbers::pi * j / across;
            const double r = 2 + std::cos(v);
            out.vertices.push_back({static_cast<float>(r * std::cos(u)), static_cast<float>(r * std::sin(u)),
                                    static_cast<float>(std::sin(v))});
            const auto at = [&](uint32_t a, uint32_t b) { return a % around * across + b % across; };
            out.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
            out.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
        }
    return out;
}

Error error_of(const Mesh& mesh) {
    const auto cleaned = clean(mesh.view());
    EXPECT_FALSE(cleaned);
    return cleaned ? Error{} : cleaned.error();
}

TEST(Clean, LeavesACleanMeshAlone) {
    const Mesh mesh = tetrahedron();
    const auto cleaned = clean(mesh.view());
    ASSERT_TRUE(cleaned);
    EXPECT_EQ(cleaned->mesh.vertices, mesh.vertices);
    EXPECT_EQ(cleaned->mesh.triangles, mesh.triangles);
    EXPECT_TRUE(cleaned->report.closed);
    EXPECT_EQ(cleaned->report.input_vertices, 4u);
    EXPECT_EQ(cleaned->report.input_triangles, 4u);
    EXPECT_EQ(cleaned->report.merged_vertices, 0u);
    EXPECT_EQ(cleaned->report.open_edges, 0u);
    EXPECT_EQ(cleaned->report.non_manifold_edges, 0u);
}

TEST(Clean, WeldsATriangleSoup) {
    const Mesh mesh = torus(40, 20);
    const auto whole = clean(mesh.view()), welded = clean(soup(mesh).view());
    ASSERT_TRUE(whole && welded);
    EXPECT_TRUE(welded->report.closed);
    EXPECT_EQ(welded->report.merged_vertices, 6 * 800u - 800u);
    EXPECT_EQ(welded->mesh.vertices.size(), 800u);
    EXPECT_EQ(welded->mesh.triangles.size(), 1600u);
    // The same triangles, corner by corner.
    for (size_t t = 0; t < 1600; ++t)
        for (size_t c = 0; c < 3; ++c)
            EXPECT_EQ(welded->mesh.vertices[welded->mesh.triangles[t][c]], mesh.vertices[mesh.triangles[t][c]]);
}

TEST(Clean, NegativeZeroIsZeroAndNearIsNotEqual) {
    Mesh mesh = soup(tetrahedron());
    for (Vec3& v : mesh.vertices)
        if (v.y == 0) v.y = -0.0f;
    auto cleaned = clean(mesh.view());
    ASSERT_TRUE(cleaned);
    EXPECT_TRUE(cleaned->report.closed);
    EXPECT_EQ(cleaned->mesh.vertices.size(), 4u);
    for (const Vec3& v : cleaned->mesh.vertices) EXPECT_FALSE(std::signbit(v.y));

    mesh.vertices[0].x = std::numeric_limits<float>::denorm_min();
    cleaned = clean(mesh.view(), 0);
    ASSERT_TRUE(cleaned);
    EXPECT_FALSE(cleaned->report.closed);
    EXPECT_EQ(cleaned->mesh.vertices.size(), 5u);
}

TEST(Clean, TheSignOfZeroDoesNotChangeTheHash) {
    Mesh mesh = tetrahedron();
    const auto plus = clean(mesh.view());
    for (Vec3& v : mesh.vertices)
        if (v.z == 0) v.z = -0.0f;
    const auto minus = clean(mesh.view());
    ASSERT_TRUE(plus && minus);
    EXPECT_EQ(hash(plus->mesh.view()), hash(minus->mesh.view()));
    mesh.vertices[1].x = 1.5f;
    const auto other = clean(mesh.view());
    ASSERT_TRUE(other);
    EXPECT_NE(hash(plus->mesh.view()), hash(other->mesh.view()));
}

TEST(Clean, DropsRepeatedCornersOnlyWhereOtherTrianglesHoldThem) {
    Mesh mesh = tetrahedron();
    mesh.vertices.push_back({5, 5, 5});
    mesh.triangles.push_back({0, 0, 1}); // on an edge of others
    mesh.triangles.push_back({2, 2, 2}); // on a corner of others
    mesh.triangles.push_back({3, 4, 4}); // a spike: the only place where (5,5,5) occurs
    const auto cleaned = clean(mesh.view());
    ASSERT_TRUE(cleaned);
    EXPECT_EQ(cleaned->report.degenerate_triangles, 3u);
    EXPECT_TRUE(cleaned->report.closed) << "a->b and b->a cancel";
    EXPECT_EQ(cleaned->mesh.triangles.size(), 5u);
    EXPECT_EQ(cleaned->mesh.triangles.back(), (Triangle{3, 4, 4}));
    EXPECT_EQ(cleaned->mesh.vertices.size(), 5u);
}

TEST(Clean, WeldingCanMakeCornersEqual) {
    Mesh mesh = tetrahedron();
    mesh.vertices.push_back(mesh.vertices[1]);
    mesh.triangles.push_back({0, 1, 4});
    const auto cleaned = clean(mesh.view());
    ASSERT_TRUE(cleaned);
    EXPECT_EQ(cleaned->report.degenerate_triangles, 1u);
    EXPECT_EQ(cleaned->report.merged_vertices, 1u);
    EXPECT_EQ(cleaned->report.unused_vertices, 0u) << "a merged vertex is not counted twice";
    EXPECT_EQ(cleaned->mesh.triangles.size(), 4u);
}

TEST(Clean, KeepsCollinearTrianglesThatCloseASeam) {
    // The edge 0-1 of one face is split at 4 in its neighbour; the sliver 0-1-4 closes the seam.
    Mesh mesh = tetrahedron();
    mesh.vertices.push_back({0.5f, 0, 0});
    mesh.triangles = {{0, 2, 1}, {0, 4, 3}, {4, 1, 3}, {1, 2, 3}, {2, 0, 3}, {0, 1, 4}};
    const auto cleaned = clean(mesh.view());
    ASSERT_TRUE(cleaned);
    EXPECT_EQ(cleaned->report.degenerate_triangles, 1u);
    EXPECT_EQ(cleaned->mesh.triangles.size(), 6u);
    EXPECT_TRUE(cleaned->report.closed);
}

TEST(Clean, CountsUnusedVertices) {
    Mesh mesh = tetrahedron();
    mesh.vertices.insert(mesh.vertices.begin(), {9, 9, 9});
    for (Triangle& t : mesh.triangles)
        for (uint32_t& corner : t) ++corner;
    const auto cleaned = clean(mesh.view());
    ASSERT_TRUE(cleaned);
    EXPECT_EQ(cleaned->report.unused_vertices, 1u);
    EXPECT_EQ(cleaned->mesh.vertices, tetrahedron().vertices);
    EXPECT_EQ(cleaned->mesh.triangles, tetrahedron().triangles);
}

TEST(Clean, FindsOpenEdges) {
    Mesh hole = tetrahedron();
    hole.triangles.pop_back();
    auto cleaned = clean(hole.view());
    ASSERT_TRUE(cleaned);
    EXPECT_EQ(cleaned->report.open_edges, 3u);
    EXPECT_FALSE(cleaned->report.closed);

    Mesh flipped = tetrahedron();
    std::swap(flipped.triangles[0][0], flipped.triangles[0][1]);
    cleaned = clean(flipped.view());
    ASSERT_TRUE(cleaned);
    EXPECT_EQ(cleaned->report.open_edges, 3u) << "inconsistent orientation does not cancel";

    cleaned = clean(Mesh{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}}.view());
    ASSERT_TRUE(cleaned) << "one triangle is a legal open mesh";
    EXPECT_EQ(cleaned->report.open_edges, 3u);
}

TEST(Clean, FindsNonManifoldEdges) {
    // Two tetrahedra with one edge in common: each is closed, the edge has four triangles.
    Mesh mesh = tetrahedron();
    mesh.vertices.insert(mesh.vertices.end(), {{0, -1, 0}, {0, 0, -1}});
    for (const Triangle& t : {Triangle{0, 4, 1}, {0, 1, 5}, {1, 4, 5}, {4, 0, 5}}) mesh.triangles.push_back(t);
    const auto cleaned = clean(mesh.view());
    ASSERT_TRUE(cleaned);
    EXPECT_EQ(cleaned->report.non_manifold_edges, 1u);
    EXPECT_TRUE(cleaned->report.closed);
}

TEST(Clean, RefusesWhatIsNoMesh) {
    EXPECT_EQ(error_of({}).code, ErrorCode::bad_mesh);
    EXPECT_EQ(error_of({{{0, 0, 0}}, {}}).code, ErrorCode::bad_mesh);
    EXPECT_EQ(error_of({{{1, 1, 1}}, {{0, 0, 0}}}).code, ErrorCode::bad_mesh);
    EXPECT_EQ(error_of({{{1, 1, 1}, {1, 1, 1}, {1, 1, 1}}, {{0, 1, 2}}}).code, ErrorCode::bad_mesh);
    EXPECT_EQ(error_of({{{0, 0, 0}, {1, 1, 1}, {3, 3, 3}}, {{0, 1, 2}}}).code, ErrorCode::bad_mesh) << "a segment";

    Mesh mesh = tetrahedron();
    mesh.triangles[2][1] = 4;
    Error error = error_of(mesh);
    EXPECT_EQ(error.code, ErrorCode::bad_mesh);
    EXPECT_EQ(error.where, 2u);
    EXPECT_TRUE(std::string(error.what).starts_with("triangle"));

    for (const float bad : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
        mesh = tetrahedron();
        mesh.vertices[3].y = bad;
        error = error_of(mesh);
        EXPECT_EQ(error.code, ErrorCode::bad_mesh);
        EXPECT_EQ(error.where, 3u);
        EXPECT_TRUE(std::string(error.what).starts_with("vertex"));
    }
}

// Against a slow and obvious count, on random soups over few points, where everything happens at once.
TEST(Clean, AgreesWithCountingByHand) {
    std::mt19937 engine(7);
    const auto random = [&engine](uint32_t below) { return static_cast<uint32_t>(engine() % below); };
    for (int round = 0; round < 300; ++round) {
        Mesh mesh;
        const uint32_t points = 4 + random(6);
        for (uint32_t i = 0; i < points; ++i)
            mesh.vertices.push_back(
                {static_cast<float>(random(2)), static_cast<float>(random(2)), static_cast<float>(random(3))});
        for (uint32_t i = 0; i < 12; ++i) mesh.triangles.push_back({random(points), random(points), random(points)});
        const auto cleaned = clean(mesh.view());
        if (!cleaned) continue;
        uint32_t open = 0, crowded = 0;
        for (uint32_t a = 0; a < points; ++a)
            for (uint32_t b = 0; b < a; ++b) {
                const Vec3 &p = mesh.vertices[a], &q = mesh.vertices[b];
                const auto first = [&](const Vec3& v) {
                    return std::find(mesh.vertices.begin(), mesh.vertices.end(), v) - mesh.vertices.begin();
                };
                if (first(p) != a || first(q) != b) continue; // count each pair of positions once
                int balance = 0, count = 0;
                for (const Triangle& t : mesh.triangles) {
                    const Vec3 c[3] = {mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]};
                    if (c[0] == c[1] || c[1] == c[2] || c[2] == c[0]) continue;
                    for (size_t i = 0; i < 3; ++i) {
                        const Vec3 &from = c[i], &to = c[(i + 1) % 3];
                        balance += (from == p && to == q) - (from == q && to == p);
                        count += (from == p && to == q) || (from == q && to == p);
                    }
                }
                open += balance != 0;
                crowded += count >= 3;
            }
        EXPECT_EQ(cleaned->report.open_edges, open);
        EXPECT_EQ(cleaned->report.non_manifold_edges, crowded);
        // No corner of the input is lost.
        for (const Triangle& t : mesh.triangles)
            for (const uint32_t corner : t)
                EXPECT_NE(
                    std::find(cleaned->mesh.vertices.begin(), cleaned->mesh.vertices.end(), mesh.vertices[corner]),
                    cleaned->mesh.vertices.end());
    }
}

} // namespace
} // namespace prolate
