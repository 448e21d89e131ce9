// clean(): welding, degenerate triangles, classification of edges, and what it refuses.
#include <prolate/mesh.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <string>
#include <utility>
#include <vector>

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

// ---- welding ----

TEST(Clean, AlmostWeldedCornersAreJoinedIfThatClosesTheMesh) {
    const Mesh whole = torus(20, 10);
    std::mt19937 engine(3);
    const auto noise = [&engine](float size) { return size * (static_cast<float>(engine() % 2001) / 1000 - 1); };
    for (const float far : {0.0f, 100.0f}) { // the tolerance goes with the coordinates
        Mesh mesh = soup(whole);
        const float size = std::nextafter(3 + far, 1000.0f) - (3 + far);
        for (Vec3& v : mesh.vertices) v = {v.x + far + noise(size), v.y + noise(size), v.z + noise(size)};
        EXPECT_FALSE(clean(mesh.view(), 0)->report.closed);
        const auto cleaned = clean(mesh.view());
        ASSERT_TRUE(cleaned);
        EXPECT_TRUE(cleaned->report.closed);
        EXPECT_EQ(cleaned->mesh.vertices.size(), 200u);
        EXPECT_EQ(cleaned->mesh.triangles.size(), 400u);
        EXPECT_GT(cleaned->report.welded_vertices, 0u);
        EXPECT_GT(cleaned->report.weld_distance, 0);
        EXPECT_LE(cleaned->report.weld_distance, 8 * size);
        EXPECT_EQ(mesh.vertices.size() - cleaned->report.merged_vertices - cleaned->report.welded_vertices, 200u);
        // Corner by corner, no point moved farther than it says.
        for (size_t t = 0; t < 400; ++t)
            for (size_t c = 0; c < 3; ++c) {
                const Vec3 &a = mesh.vertices[mesh.triangles[t][c]],
                           &b = cleaned->mesh.vertices[cleaned->mesh.triangles[t][c]];
                EXPECT_LE(std::hypot(double{a.x} - b.x, double{a.y} - b.y, double{a.z} - b.z),
                          cleaned->report.weld_distance);
            }
    }
}

TEST(Clean, WeldingLeavesAloneWhatItCannotClose) {
    Mesh mesh = soup(torus(20, 10));
    mesh.vertices[7].z += 1e-7f;
    mesh.triangles.pop_back(); // a hole
    const auto cleaned = clean(mesh.view());
    ASSERT_TRUE(cleaned);
    EXPECT_FALSE(cleaned->report.closed);
    EXPECT_EQ(cleaned->report.welded_vertices, 0u);
    EXPECT_EQ(cleaned->report.weld_distance, 0);
    // A gap of 1e-3 is no noise, unless the user says so.
    mesh = soup(tetrahedron());
    mesh.vertices[0].x = 1e-3f;
    EXPECT_FALSE(clean(mesh.view())->report.closed);
    EXPECT_TRUE(clean(mesh.view(), 2e-3f)->report.closed);
    EXPECT_NEAR(clean(mesh.view(), 2e-3f)->report.weld_distance, 1e-3, 1e-9);
    EXPECT_EQ(clean(mesh.view(), NAN).error().code, ErrorCode::bad_options);
}

// A closed sheet thinner than the tolerance keeps both sides, also beside a part that has to be welded.
TEST(Clean, ThinWallsStay) {
    Mesh mesh;
    const float thin = 1e-8f;
    for (const float z : {0.0f, thin})
        for (const auto& [x, y] : {std::pair{0.f, 0.f}, {1.f, 0.f}, {1.f, 1.f}, {0.f, 1.f}})
            mesh.vertices.push_back({x, y, z});
    for (const auto& [a, b, c, d] : {std::array{3u, 2u, 1u, 0u},
                                     {4u, 5u, 6u, 7u},
                                     {0u, 1u, 5u, 4u},
                                     {1u, 2u, 6u, 5u},
                                     {2u, 3u, 7u, 6u},
                                     {3u, 0u, 4u, 7u}}) {
        mesh.triangles.push_back({a, b, c});
        mesh.triangles.push_back({a, c, d});
    }
    Mesh noisy = soup(tetrahedron());
    noisy.vertices[0].x = 3e-8f;
    const auto base = static_cast<uint32_t>(mesh.vertices.size());
    for (const Vec3& v : noisy.vertices) mesh.vertices.push_back({v.x + 2, v.y, v.z});
    for (Triangle t : noisy.triangles) mesh.triangles.push_back({t[0] + base, t[1] + base, t[2] + base});
    mesh.vertices[base].x += 5e-7f;
    const auto cleaned = clean(mesh.view());
    ASSERT_TRUE(cleaned);
    EXPECT_TRUE(cleaned->report.closed);
    EXPECT_EQ(cleaned->mesh.vertices.size(), 8 + 4u);
    EXPECT_EQ(cleaned->report.size[2], 1);
    for (const float z : {0.0f, thin})
        EXPECT_GE(std::count_if(cleaned->mesh.vertices.begin(), cleaned->mesh.vertices.end(),
                                [z](const Vec3& v) { return v.z == z; }),
                  4);
}

// ---- inside out ----

// A tetrahedron around (x, 0, 0), of inscribed radius about r.
Mesh ball(float r, float x, bool inward) {
    Mesh out;
    for (const Vec3 v : {Vec3{1, 1, 1}, {1, -1, -1}, {-1, 1, -1}, {-1, -1, 1}})
        out.vertices.push_back({x + 3 * r * v.x, 3 * r * v.y, 3 * r * v.z});
    out.triangles = {{0, 1, 2}, {0, 3, 1}, {0, 2, 3}, {1, 3, 2}};
    if (inward)
        for (Triangle& t : out.triangles) std::swap(t[0], t[1]);
    return out;
}
double volume_of(const Mesh& mesh) {
    double six = 0;
    for (const Triangle& t : mesh.triangles) {
        const Vec3 &a = mesh.vertices[t[0]], &b = mesh.vertices[t[1]], &c = mesh.vertices[t[2]];
        six += a.x * (double{b.y} * c.z - double{b.z} * c.y) - a.y * (double{b.x} * c.z - double{b.z} * c.x) +
               a.z * (double{b.x} * c.y - double{b.y} * c.x);
    }
    return six / 6;
}
Mesh joined(std::initializer_list<Mesh> parts) {
    Mesh out;
    for (const Mesh& part : parts) {
        const auto base = static_cast<uint32_t>(out.vertices.size());
        out.vertices.insert(out.vertices.end(), part.vertices.begin(), part.vertices.end());
        for (const Triangle& t : part.triangles) out.triangles.push_back({t[0] + base, t[1] + base, t[2] + base});
    }
    return out;
}
// Which of the four-triangle parts were turned; all parts stay where they are.
std::vector<bool> turned(std::initializer_list<Mesh> parts) {
    const Mesh mesh = joined(parts);
    const auto cleaned = clean(mesh.view());
    EXPECT_TRUE(cleaned);
    std::vector<bool> out;
    for (size_t p = 0; p < parts.size(); ++p) {
        Mesh before = mesh, after = cleaned->mesh;
        before.triangles = {mesh.triangles.begin() + 4 * p, mesh.triangles.begin() + 4 * p + 4};
        after.triangles = {cleaned->mesh.triangles.begin() + 4 * p, cleaned->mesh.triangles.begin() + 4 * p + 4};
        EXPECT_NEAR(std::abs(volume_of(before)), std::abs(volume_of(after)), 1e-6 * std::abs(volume_of(before)));
        out.push_back(volume_of(before) * volume_of(after) < 0);
    }
    EXPECT_EQ(cleaned->report.turned_shells, static_cast<uint32_t>(std::count(out.begin(), out.end(), true)));
    const auto again = clean(cleaned->mesh.view());
    EXPECT_EQ(again->report.turned_shells, 0u) << "what is right stays";
    return out;
}
using Flags = std::vector<bool>;

TEST(Clean, TurnsShellsThatAreInsideOut) {
    constexpr bool in = true, out = false;
    EXPECT_EQ(turned({ball(1, 0, out)}), Flags({false}));
    EXPECT_EQ(turned({ball(1, 0, in)}), Flags({true}));
    EXPECT_EQ(turned({ball(1, 500, in)}), Flags({true})) << "wherever it is";
    EXPECT_EQ(turned({ball(1, 0, out), ball(1, 20, in), ball(1, 40, out)}), Flags({false, true, false}));
}

TEST(Clean, KeepsCavitiesAndBodiesWithinBodies) {
    constexpr bool in = true, out = false;
    EXPECT_EQ(turned({ball(4, 0, out), ball(1, 0, in)}), Flags({false, false})) << "a cavity";
    EXPECT_EQ(turned({ball(4, 0, out), ball(1, 0, out)}), Flags({false, false})) << "a body within a body";
    EXPECT_EQ(turned({ball(4, 0, in), ball(1, 0, out)}), Flags({true, true})) << "all of a hollow body is inside out";
    EXPECT_EQ(turned({ball(4, 0, in), ball(1, 0, in)}), Flags({true, true}));
    EXPECT_EQ(turned({ball(16, 0, out), ball(4, 0, in), ball(1, 0, out)}), Flags({false, false, false}));
    EXPECT_EQ(turned({ball(16, 0, out), ball(4, 0, in), ball(1, 0, in)}), Flags({false, false, true}))
        << "a body in a cavity";
    EXPECT_EQ(turned({ball(16, 0, in), ball(4, 0, out), ball(1, 0, in)}), Flags({true, true, true}));
}

TEST(Clean, ShellsThatMeetKeepTheirSolid) {
    constexpr bool in = true, out = false;
    EXPECT_EQ(turned({ball(2, 0, out), ball(2, 1, out)}), Flags({false, false}));
    EXPECT_EQ(turned({ball(2, 0, out), ball(2, 5, in)}), Flags({false, true})) << "it sticks out: it is a body";
    EXPECT_EQ(turned({ball(2, 0, in), ball(2, 5, in)}), Flags({true, true}));
}

TEST(Clean, AnOpenPartIsNotTurnedAndAClosedOneBesideItIs) {
    Mesh open = ball(1, 30, true);
    open.triangles.pop_back();
    const auto cleaned = clean(joined({ball(1, 0, true), open}).view());
    ASSERT_TRUE(cleaned);
    EXPECT_EQ(cleaned->report.turned_shells, 1u);
    EXPECT_FALSE(cleaned->report.closed);
}

// Both sides of a surface are no solid, however each is cut into triangles; two lobes of opposite signs are one.
TEST(Clean, WhatEnclosesNothingIsNotClosed) {
    const Mesh solid = tetrahedron();
    Mesh both = solid;
    for (const Triangle& t : solid.triangles) both.triangles.push_back({t[0], t[2], t[1]});
    const Mesh sheet = {{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}, {{0, 1, 2}, {0, 2, 3}, {1, 0, 3}, {1, 3, 2}}};
    for (const Mesh& mesh : {both, soup(both), sheet, soup(sheet)}) {
        const auto cleaned = clean(mesh.view());
        ASSERT_TRUE(cleaned);
        EXPECT_EQ(cleaned->report.open_edges, 0u);
        EXPECT_FALSE(cleaned->report.closed);
        EXPECT_EQ(cleaned->mesh.triangles.size(), mesh.triangles.size()) << "no point of the surface is lost";
    }
    Mesh lobes = solid; // its mirror image, facing inwards, on the same edge
    lobes.vertices.insert(lobes.vertices.end(), {{0, -1, 0}, {0, 0, -1}});
    for (const Triangle& t : solid.triangles) {
        Triangle image = t;
        for (uint32_t& corner : image) corner += corner < 2 ? 0 : 2;
        lobes.triangles.push_back({image[0], image[2], image[1]});
    }
    Mesh solid_and_sheet = solid;
    solid_and_sheet.vertices.insert(solid_and_sheet.vertices.end(), {{5, 0, 0}, {6, 0, 0}, {5, 1, 0}});
    solid_and_sheet.triangles.insert(solid_and_sheet.triangles.end(), {{4, 5, 6}, {4, 6, 5}});
    for (const Mesh& mesh : {lobes, solid_and_sheet}) {
        const auto cleaned = clean(mesh.view());
        ASSERT_TRUE(cleaned);
        EXPECT_TRUE(cleaned->report.closed);
    }
}

TEST(Clean, CanBeStopped) {
    const Mesh mesh = soup(torus(1000, 300));
    const auto cleaned = clean(mesh.view(), kDefaultWeld, [] { return false; });
    ASSERT_FALSE(cleaned);
    EXPECT_EQ(cleaned.error().code, ErrorCode::cancelled);
}

TEST(Clean, RefusesSizesThatNoTreeCanHold) {
    for (const float size : {1e-37f, 1e25f}) {
        Mesh mesh = tetrahedron();
        for (Vec3& v : mesh.vertices) v = {v.x * size, v.y * size, v.z * size};
        const Error error = error_of(mesh);
        EXPECT_EQ(error.code, ErrorCode::bad_mesh);
        EXPECT_NE(std::string(error.what).find("another unit"), std::string::npos) << error.what;
    }
}

TEST(Clean, KeepsAndHashesThePlacement) {
    Mesh mesh = tetrahedron();
    const uint64_t before = hash(mesh.view());
    mesh.placement.origin[1] = 1000;
    EXPECT_NE(hash(mesh.view()), before);
    EXPECT_EQ(clean(mesh.view())->mesh.placement, mesh.placement);
    EXPECT_EQ(clean(mesh.view())->report.size, (std::array<double, 3>{1, 1, 1}));
}

} // namespace
} // namespace prolate
