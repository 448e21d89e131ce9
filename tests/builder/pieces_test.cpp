// The solid in convex pieces: nothing of it may get lost, however the pieces are cut.
#include "builder/pieces.hpp"
#include "builder/random.hpp"
#include "tests/shapes.hpp"

#include <prolate/mesh.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <numeric>
#include <set>

namespace prolate {
namespace {

Vec random_vec(Random& random) {
    const double x = random.symmetric(), y = random.symmetric(), z = random.symmetric();
    return {x, y, z};
}

Vec random_point(const Mesh& mesh, const Triangle& t, Random& random) {
    double u = random.uniform(), v = random.uniform();
    if (u + v > 1) u = 1 - u, v = 1 - v;
    const Vec a = to_vec(mesh.vertices[t[0]]), b = to_vec(mesh.vertices[t[1]]), c = to_vec(mesh.vertices[t[2]]);
    return a + u * (b - a) + v * (c - a);
}

// May `p` be in the piece? No, if an ellipsoid around the piece's points does not contain it: tried with the smallest
// one and stretched ones. No test of the hull itself, but a sharp one, and for what pieces are for.
bool may_contain(const Pieces& pieces, uint32_t piece, const Vec& p, Random& random) {
    constexpr double kRounding = 1e-6;
    if ((p - pieces.center(piece)).norm() > pieces.radius(piece) * (1 + kRounding)) return false;
    const double min_radius = 1e-4 * pieces.radius(piece);
    const Fit round = enclosing_ellipsoid(pieces.points(piece), min_radius);
    if (round.radial_squared(p) > 1 + kRounding) return false;
    for (int i = 0; i < 4; ++i) {
        const Vec axis = random_vec(random).normalized();
        const double r = pieces.radius(piece);
        const Mat shape = r * r * (Mat::Identity() + 99 * axis * axis.transpose());
        const Fit needle = capped(round.center, shape, min_radius);
        if (needle.radial_squared(p) > std::pow(needle.reach(pieces.points(piece)), 2) * (1 + kRounding)) return false;
    }
    return true;
}

bool somewhere(const Pieces& pieces, const Vec& p, Random& random) {
    Box at;
    at.add(p);
    bool found = false;
    pieces.for_each_near(at, [&](uint32_t piece) { found = found || may_contain(pieces, piece, p, random); });
    return found;
}

// Points of the surface and of the inside, all of which have to be in a piece; returns how many were inside.
int expect_whole(const Mesh& mesh, const Pieces& pieces, bool closed) {
    Random random(11);
    for (const Triangle& t : mesh.triangles) {
        EXPECT_TRUE(somewhere(pieces, random_point(mesh, t, random), random));
        EXPECT_TRUE(somewhere(pieces, to_vec(mesh.vertices[t[0]]), random));
    }
    const Winding winding(mesh.view());
    Box box;
    for (const Vec3& v : mesh.vertices) box.add(to_vec(v));
    int inside = 0;
    for (int round = 0; closed && round < 3000; ++round) {
        const Vec p = box.center() + 0.5 * random_vec(random).cwiseProduct(box.size());
        if (std::abs(winding(p, 6)) < 0.75) continue;
        ++inside;
        EXPECT_TRUE(somewhere(pieces, p, random)) << p.transpose();
    }
    return inside;
}

struct Case {
    const char* name;
    Mesh mesh;
    bool closed;
    int least_inside;
};

std::vector<Case> cases() {
    std::vector<Case> out{{"torus", shapes::torus(1, 0.3f, 30, 12), true, 300},
                          {"box", shapes::box(1, 2, 3), true, 2900},
                          {"inverted ball", shapes::inverted(shapes::icosphere(2)), true, 1200},
                          {"plate thinner than a voxel", shapes::box(1, 1, 0.001f), true, 2900},
                          {"sheet", shapes::sheet(2, 1, 5), false, 0},
                          {"tetrahedron", shapes::tetrahedron(), true, 400}};
    Mesh gashed = shapes::torus(1, 0.3f, 30, 12); // open: its inside fades
    std::erase_if(gashed.triangles, [](const Triangle& t) { return t[0] % 12 < 2; });
    out.push_back({"gashed torus", gashed, false, 0});
    Mesh overlapping = shapes::icosphere(2);
    shapes::append(overlapping, shapes::moved(shapes::box(1, 1, 1), {0.3f, 0.2f, 0.1f}));
    out.push_back({"overlapping shells", overlapping, true, 1000});
    Mesh shell = shapes::icosphere(2);
    shapes::append(shell, shapes::inverted(shapes::moved(shapes::icosphere(2), {}, 0.9f)));
    out.push_back({"thin shell", shell, true, 200});
    return out;
}

// Cuts about every third piece, and then some of the parts, until nothing gets smaller.
void cut_at_random(Pieces& pieces, Random& random) {
    for (uint32_t piece = 0; piece < pieces.size(); ++piece)
        if (random.uniform() < 0.3 || piece % 16 == 0) pieces.refine(piece);
}

TEST(Pieces, AreTheSolidAndStaySoWhenCut) {
    for (const Case& c : cases()) {
        SCOPED_TRACE(c.name);
        const Winding winding(c.mesh.view());
        Pieces pieces(c.mesh.view(), c.closed, winding, 16);
        EXPECT_GE(expect_whole(c.mesh, pieces, c.closed), c.least_inside);
        Random random(3);
        const uint32_t before = pieces.size();
        cut_at_random(pieces, random);
        EXPECT_GT(pieces.size(), before);
        EXPECT_GE(expect_whole(c.mesh, pieces, c.closed), c.least_inside);
    }
}

TEST(Pieces, LieWithinThePieceThatTheyWereCutFrom) {
    for (const Case& c : cases()) {
        SCOPED_TRACE(c.name);
        Pieces pieces(c.mesh.view(), c.closed, Winding(c.mesh.view()), 12);
        const uint32_t count = pieces.size();
        for (uint32_t piece = 0; piece < count; ++piece) EXPECT_EQ(pieces.cut_from(piece), piece);
        Random random(5);
        for (uint32_t piece = 0; piece < count; piece += 3) {
            const std::vector<Vec> points(pieces.points(piece).begin(), pieces.points(piece).end());
            const uint32_t first = pieces.size();
            if (!pieces.refine(piece)) continue;
            EXPECT_EQ(pieces.cut_from(piece), piece);
            std::vector<uint32_t> parts{piece};
            for (uint32_t part = first; part < pieces.size(); ++part) {
                EXPECT_EQ(pieces.cut_from(part), piece);
                parts.push_back(part);
            }
            EXPECT_LE(parts.size(), 8u);
            // Ellipsoids around the whole hold the parts.
            for (int i = 0; i < 3; ++i) {
                const Vec axis = random_vec(random).normalized();
                const double r = pieces.radius(piece);
                Fit fit = capped(pieces.center(piece), r * r * (Mat::Identity() + 50 * i * axis * axis.transpose()), r);
                fit = fit.scaled(fit.reach(points));
                for (const uint32_t part : parts) EXPECT_LE(fit.reach(pieces.points(part)), 1 + 1e-9);
            }
        }
    }
}

TEST(Pieces, AreCutDownToAQuarterOfAVoxel) {
    const Mesh ball = shapes::icosphere(2);
    Pieces pieces(ball.view(), true, Winding(ball.view()), 12);
    const double voxel = 2.0 / 12, smallest = voxel / 4 * std::sqrt(3.0) / 2;
    uint32_t blocks = 0;
    for (uint32_t piece = 0; piece < pieces.size(); ++piece)
        blocks += pieces.radius(piece) > 1.01 * voxel * std::sqrt(3.0) / 2;
    EXPECT_GT(blocks, 5u); // deep inside
    for (uint32_t piece = 0; piece < pieces.size(); ++piece)
        while (pieces.refine(piece)) {
        }
    for (uint32_t piece = 0; piece < pieces.size(); ++piece) {
        const uint32_t count = pieces.size();
        EXPECT_LE(pieces.radius(piece), smallest * (1 + 1e-9));
        EXPECT_FALSE(pieces.refine(piece));
        EXPECT_EQ(pieces.size(), count);
    }
    EXPECT_GT(expect_whole(ball, pieces, true), 1000);
}

TEST(Pieces, AreFewDeepInside) {
    const Mesh cube = shapes::box();
    const Pieces pieces(cube.view(), true, Winding(cube.view()), 64);
    uint32_t surface = 0;
    for (uint32_t piece = 0; piece < pieces.size(); ++piece) surface += pieces.on_surface(piece);
    EXPECT_GT(surface, 6 * 62 * 62u);
    EXPECT_LT(surface, 6 * 67 * 67u);
    EXPECT_LT(pieces.size() - surface, 64 * 64 * 64 / 8u); // voxels would be 64^3 less the surface
}

TEST(Pieces, KnowTheirSurfacePoints) {
    const Mesh mesh = shapes::torus(1, 0.3f, 40, 20);
    const Winding winding(mesh.view());
    Pieces pieces(mesh.view(), true, winding, 20);
    Random random(7);
    cut_at_random(pieces, random);
    size_t surface = 0, others = 0;
    for (uint32_t piece = 0; piece < pieces.size(); ++piece) {
        std::set<const Vec*> seen;
        pieces.for_each_surface_point(piece, [&](const Vec& p) {
            EXPECT_LT(winding.tree().distance(p), 1e-9);
            seen.insert(&p);
        });
        EXPECT_EQ(seen.empty(), !pieces.on_surface(piece));
        surface += seen.size(), others += pieces.points(piece).size() - seen.size();
        Box box;
        for (const Vec& p : pieces.points(piece)) box.add(p);
        EXPECT_EQ(pieces.center(piece), box.center());
        for (const Vec& p : pieces.points(piece))
            EXPECT_LE((p - pieces.center(piece)).norm(), pieces.radius(piece) * (1 + 1e-12));
    }
    EXPECT_GT(surface, 5000u);
    EXPECT_GT(others, 5000u);
}

TEST(Pieces, NearABoxAreAllFound) {
    const Mesh mesh = shapes::torus(1, 0.3f, 40, 20);
    Pieces pieces(mesh.view(), true, Winding(mesh.view()), 40);
    Random random(9);
    cut_at_random(pieces, random);
    size_t met = 0;
    for (int round = 0; round < 100; ++round) {
        Box region;
        const Vec a = 1.7 * random_vec(random);
        region.add(a), region.add(a + 0.5 * random_vec(random));
        std::vector<uint32_t> seen;
        pieces.for_each_near(region, [&](uint32_t piece) { seen.push_back(piece); });
        std::vector<uint32_t> again;
        pieces.for_each_near(region, [&](uint32_t piece) { again.push_back(piece); });
        EXPECT_EQ(seen, again);
        std::ranges::sort(seen);
        EXPECT_TRUE(std::ranges::adjacent_find(seen) == seen.end()); // each once
        for (uint32_t piece = 0; piece < pieces.size(); ++piece) {
            Box box;
            for (const Vec& p : pieces.points(piece)) box.add(p);
            if ((box.low.array() > region.high.array()).any() || (box.high.array() < region.low.array()).any())
                continue;
            ++met;
            EXPECT_TRUE(std::ranges::binary_search(seen, piece));
        }
    }
    EXPECT_GT(met, 2000u);
}

TEST(FitPieces, EnclosesThemTightly) {
    // A ball's own ellipsoid is known; parts of a torus are checked for enclosure alone.
    const Mesh ball = shapes::icosphere(3);
    const Pieces whole(ball.view(), true, Winding(ball.view()), 24);
    std::vector<uint32_t> all(whole.size());
    std::iota(all.begin(), all.end(), 0u);
    const Fit fit = fit_pieces(whole, all, 1e-5);
    EXPECT_LT(fit.center.norm(), 2e-3);
    EXPECT_NEAR(fit.volume(), Fit().volume(), 6e-3 * Fit().volume());
    const Mesh mesh = shapes::torus(1, 0.3f, 40, 20);
    const Pieces pieces(mesh.view(), true, Winding(mesh.view()), 20);
    Random random(13);
    for (int round = 0; round < 100; ++round) {
        std::vector<uint32_t> members;
        const auto count = 1 + random.bits() % 200;
        for (uint64_t i = 0; i < count; ++i) members.push_back(static_cast<uint32_t>(random.uniform() * pieces.size()));
        const Fit around = fit_pieces(pieces, members, 1e-5);
        for (const uint32_t piece : members) EXPECT_LE(around.reach(pieces.points(piece)), 1 + 1e-9);
    }
}

TEST(Pieces, OfARealMeshAreTheSolid) {
    const std::string path = std::string(PROLATE_SOURCE_DIR) + "/../shared/data/knight.obj";
    if (!std::ifstream(path)) GTEST_SKIP() << "no shared data beside the checkout";
    const auto loaded = load_mesh(path.c_str());
    ASSERT_TRUE(loaded);
    const auto cleaned = clean(loaded->view());
    ASSERT_TRUE(cleaned);
    Mesh mesh = cleaned->mesh;
    Pieces pieces(mesh.view(), cleaned->report.closed, Winding(mesh.view()), 32);
    Random random(15);
    cut_at_random(pieces, random);
    for (size_t t = 0; t < mesh.triangles.size(); t += 7)
        EXPECT_TRUE(somewhere(pieces, random_point(mesh, mesh.triangles[t], random), random));
}

} // namespace
} // namespace prolate
