// build() and verify(): cover at every level, for every kind of mesh; and that verify() finds what does not cover.
#include "builder/border.hpp"
#include "builder/fit.hpp"
#include "builder/random.hpp"
#include "builder/winding.hpp"
#include "src/block.hpp"
#include "src/bytes.hpp"
#include "src/format.hpp"
#include "src/hash.hpp"
#include "tests/builder/bakes.hpp"
#include "tests/shapes.hpp"

#include <prolate/build.hpp>
#include <prolate/verify.hpp>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <numbers>

namespace prolate {
namespace {

// An independent look: random points of the solid against each level.
void expect_covered(const Mesh& mesh, const Build& built) {
    const TreeView tree = built.tree.view();
    const Winding winding(mesh.view());
    Box box;
    for (const Vec3& v : mesh.vertices) box.add(to_vec(v));
    Random random(4);
    std::vector<Vec> points;
    const size_t stride = std::max<size_t>(1, mesh.triangles.size() / 3000);
    for (size_t i = 0; i < mesh.triangles.size(); i += stride) {
        const Triangle& t = mesh.triangles[i];
        double u = random.uniform(), v = random.uniform();
        if (u + v > 1) u = 1 - u, v = 1 - v;
        const Vec a = to_vec(mesh.vertices[t[0]]), b = to_vec(mesh.vertices[t[1]]), c = to_vec(mesh.vertices[t[2]]);
        points.push_back(a + u * (b - a) + v * (c - a));
        points.push_back(a);
    }
    for (int i = 0; i < 3000 && !built.surface_mode; ++i) {
        const double x = random.uniform(), y = random.uniform(), z = random.uniform();
        const Vec p = box.low + Vec(x, y, z).cwiseProduct(box.size());
        if (std::abs(winding(p)) > 0.75) points.push_back(p);
    }
    for (uint32_t l = 0; l < tree.level_count(); ++l) {
        std::vector<Fit> cut;
        tree.for_each_in_cut(l, [&](uint32_t n) { cut.emplace_back(tree.ellipsoid(n)); });
        for (const Vec& p : points)
            EXPECT_TRUE(std::ranges::any_of(cut, [&](const Fit& f) { return f.radial_squared(p) <= 1; }))
                << p.transpose() << " on level " << l;
    }
}

void expect_proved(const Mesh& mesh, const Build& built) {
    const auto proof = verify(built.tree.view(), mesh.view());
    ASSERT_TRUE(proof);
    EXPECT_TRUE(proof->covered);
    for (const LevelReport& level : built.levels) EXPECT_TRUE(level.covered);
}

struct Model {
    const char* name;
    Mesh mesh;
};
void PrintTo(const Model& model, std::ostream* out) {
    *out << model.name;
}

class BuildOf : public testing::TestWithParam<Model> {};

bool is_ball(const Ellipsoid& e) {
    return e.l11 == e.l22 && e.l22 == e.l33 && e.l21 == 0 && e.l31 == 0 && e.l32 == 0;
}

TEST_P(BuildOf, CoversEveryCut) {
    const Mesh& mesh = GetParam().mesh;
    const Build built = must_build(mesh, quick(2));
    EXPECT_EQ(built.levels.size(), built.tree.view().level_count());
    expect_proved(mesh, built);
    expect_covered(mesh, built);
    if (built.solid_volume > 0 && built.levels.size() > 1) { // of a shell, levels between may have more outside
        EXPECT_LT(built.levels.back().outside_ratio, built.levels[0].outside_ratio);
    }
}

// The same with balls, and a tree that grows from its leaves.
TEST_P(BuildOf, CoversWithSpheresOfAGivenNumber) {
    const Mesh& mesh = GetParam().mesh;
    BuildOptions options = quick(0);
    options.ellipsoids = 21;
    options.degree = 3;
    options.primitive = Primitive::sphere;
    const Build built = must_build(mesh, options);
    EXPECT_EQ(built.levels.back().nodes, 21u);
    EXPECT_LE(built.levels.size(), 8u); // no child has more than two thirds of its parent's leaves
    expect_proved(mesh, built);
    expect_covered(mesh, built);
    built.tree.view().for_each_node([&](uint32_t n) { EXPECT_TRUE(is_ball(built.tree.view().ellipsoid(n))) << n; });
}

Mesh dust() { // more separate parts than initial pieces
    Mesh mesh;
    Random random(1);
    for (int i = 0; i < 400; ++i)
        shapes::append(mesh, shapes::moved(shapes::tetrahedron(),
                                           {float(random.uniform()), float(random.uniform()), float(random.uniform())},
                                           0.01f));
    return mesh;
}

Mesh overlapping() { // two balls and a box that cross each other
    Mesh mesh = shapes::icosphere(2);
    shapes::append(mesh, shapes::moved(shapes::icosphere(2), {1, 0.3f, 0}));
    shapes::append(mesh, shapes::moved(shapes::box(2, 0.2f, 0.2f), {-0.5f, 0, 0.5f}));
    return mesh;
}

Mesh duplicated() { // each triangle twice, corners not shared
    const Mesh once = shapes::torus(1, 0.3f, 24, 12);
    Mesh mesh = once;
    shapes::append(mesh, once);
    return mesh;
}

Mesh half_inverted() { // separate parts, one inside out
    Mesh mesh = shapes::box(1, 1, 1);
    shapes::append(mesh, shapes::inverted(shapes::moved(shapes::box(1, 2, 1), {2, 0, 0})));
    return mesh;
}

Mesh needles() { // an open fan of very thin triangles, and a closed spike
    Mesh mesh{{{0, 0, 0}}, {}};
    for (uint32_t i = 0; i < 40; ++i) {
        const float angle = 0.15f * static_cast<float>(i);
        mesh.vertices.push_back({std::cos(angle), std::sin(angle), 0.1f});
        mesh.vertices.push_back({std::cos(angle + 1e-4f), std::sin(angle + 1e-4f), 0.1f});
        mesh.triangles.push_back({0, 2 * i + 1, 2 * i + 2});
    }
    shapes::append(mesh, shapes::moved(shapes::box(1e-4f, 1e-4f, 2), {0, 0, -1}));
    return mesh;
}

Mesh gashed() { // open: its inside fades
    Mesh mesh = shapes::torus(1, 0.3f, 32, 16);
    std::erase_if(mesh.triangles, [](const Triangle& t) { return t[0] % 16 < 3; });
    return mesh;
}

Mesh shells() { // one in another, alternating
    Mesh mesh;
    for (const float radius : {1.0f, 0.7f, 0.4f})
        shapes::append(mesh, radius == 0.7f ? shapes::inverted(shapes::moved(shapes::icosphere(2), {}, radius))
                                            : shapes::moved(shapes::icosphere(2), {}, radius));
    return mesh;
}

INSTANTIATE_TEST_SUITE_P(
    Meshes, BuildOf,
    testing::Values(Model{"torus", shapes::torus(1, 0.3f, 48, 24)}, Model{"box", shapes::box(1, 2, 3)},
                    Model{"tetrahedron", shapes::tetrahedron()},
                    Model{"inside_out", shapes::inverted(shapes::icosphere(3))}, Model{"hollow", shapes::hollow_ball()},
                    Model{"two_pieces", shapes::two_pieces()},
                    Model{"plate", shapes::box(1, 1, 0.001f)}, // far thinner than a cell
                    Model{"needle", shapes::box(1, 0.001f, 0.001f)}, Model{"sheet", shapes::sheet(1, 1, 8)},
                    Model{"open_box", shapes::open_box()}, Model{"dust", dust()}, Model{"overlapping", overlapping()},
                    Model{"duplicated", duplicated()}, Model{"half_inverted", half_inverted()},
                    Model{"needles", needles()}, Model{"gashed", gashed()}, Model{"shells", shells()},
                    Model{"coplanar", shapes::box(1, 1, 0)},
                    Model{"millimetres", shapes::moved(overlapping(), {}, 1e3f)},
                    Model{"one_triangle", Mesh{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}}},
                    Model{"micrometres", shapes::moved(shapes::torus(1, 0.3f, 24, 12), {}, 1e-6f)},
                    Model{"kilometres", shapes::moved(shapes::torus(1, 0.3f, 24, 12), {}, 1e6f)},
                    Model{"far_away", shapes::moved(shapes::torus(1, 0.3f, 24, 12), {1e4f, -1e4f, 5e3f})}),
    [](const auto& model) { return std::string(model.param.name); });

TEST(Build, SurfaceModeIsAnnounced) {
    EXPECT_TRUE(must_build(shapes::open_box(), quick(1)).surface_mode);
    EXPECT_TRUE(must_build(shapes::open_box(), quick(1)).tree.view().bake_info().surface_mode);
    EXPECT_FALSE(must_build(shapes::box(), quick(1)).surface_mode);
}

TEST(Build, SameBytesForAnyNumberOfThreads) {
    const Mesh mesh = shapes::torus(1, 0.3f, 24, 12);
    BuildOptions options = quick(2);
    options.threads = 1;
    const Build one = must_build(mesh, options);
    for (const uint32_t threads : {2u, 8u}) {
        options.threads = threads;
        const Build many = must_build(mesh, options);
        ASSERT_EQ(one.tree.bytes().size(), many.tree.bytes().size());
        EXPECT_TRUE(std::equal(one.tree.bytes().begin(), one.tree.bytes().end(), many.tree.bytes().begin()));
    }
    options.seed = 2;
    const Build other = must_build(mesh, options);
    EXPECT_NE(other.tree.view().bake_info().options_hash, one.tree.view().bake_info().options_hash);
    EXPECT_EQ(other.tree.view().bake_info().source_hash, one.tree.view().bake_info().source_hash);
}

TEST(Build, FiguresAreThoseOfTheFile) {
    const Mesh mesh = shapes::torus(1, 0.3f, 48, 24);
    const Build built = must_build(mesh, quick(2));
    const TreeView tree = built.tree.view();
    const BakeInfo info = tree.bake_info();
    EXPECT_TRUE(info.proved);
    EXPECT_TRUE(info.goal_reached);
    EXPECT_EQ(info.solid_volume, built.solid_volume);
    EXPECT_EQ(info.diagonal, built.diagonal);
    EXPECT_LE(std::abs(built.solid_volume - shapes::enclosed_volume(mesh)), built.solid_volume_error);
    for (uint32_t l = 0; l < tree.level_count(); ++l) {
        const LevelFigures &file = tree.level(l), &report = built.levels[l];
        EXPECT_EQ(file.union_volume, report.union_volume);
        for (const auto figure :
             {&LevelFigures::outside_ratio, &LevelFigures::outside_ratio_error, &LevelFigures::sum_outside_ratio,
              &LevelFigures::surface_error, &LevelFigures::hausdorff_max, &LevelFigures::hausdorff_mean,
              &LevelFigures::hausdorff_p99}) {
            EXPECT_EQ(file.*figure, static_cast<float>(report.*figure));
            EXPECT_TRUE(std::isfinite(file.*figure));
        }
        EXPECT_LT(report.outside_ratio_error, 1e-3);
        // Of a cover: what is outside is the union less the solid; alone, each sticks out by more in sum.
        EXPECT_NEAR(report.outside_ratio, report.union_volume / built.solid_volume - 1, report.outside_ratio_error);
        EXPECT_GE(report.sum_outside_ratio, report.outside_ratio);
        EXPECT_GT(report.hausdorff_mean, 0);
        EXPECT_GT(report.hausdorff_p99, report.hausdorff_mean);
        EXPECT_GT(report.hausdorff_max, report.hausdorff_p99);
    }
    // The root's poles are the farthest from the ring.
    EXPECT_NEAR(built.levels[0].hausdorff_max, std::hypot(1, tree.ellipsoid(0).l33) - 0.3, 0.01);
    // The root's own outside volume is that of its decoded ellipsoid.
    EXPECT_NEAR(built.levels[0].sum_outside_ratio, volume(tree.ellipsoid(0)) / built.solid_volume - 1,
                built.levels[0].outside_ratio_error);
}

// One sphere around a cube about the origin: its center is 0, up to rounding, and says nothing of a lattice.
TEST(Build, ABoxHoldsItsNodeEvenIfAllCentersCoincide) {
    for (const Primitive primitive : {Primitive::ellipsoid, Primitive::sphere}) {
        BuildOptions options;
        options.quality = Quality::fast, options.ellipsoids = 1, options.primitive = primitive;
        const Build built = must_build(shapes::box(1, 1, 1), options);
        const TreeView tree = built.tree.view();
        const LatticeInfo lattice = tree.raw().lattice();
        const Ellipsoid e = tree.ellipsoid(0);
        const double center[] = {e.center.x, e.center.y, e.center.z};
        const double half[] = {e.l11, std::hypot(e.l21, e.l22), std::hypot(e.l31, e.l32, e.l33)};
        const std::byte* const block = tree.raw().block(0);
        for (size_t i = 0; i < 3; ++i) {
            EXPECT_LT(std::ldexp(half[i], -lattice.step_exponent), 0x1p21);
            const double origin = double(lattice.origin[i]) + load_le<int32_t>(block + kBlockBoxOrigin + 4 * i);
            const double step = std::ldexp(1.0, load_le<uint8_t>(block + kBlockBoxExponent + i));
            const auto side = [&](size_t array) {
                return std::ldexp(origin + step * load_le<uint8_t>(block + array + kBlockLanes * i),
                                  lattice.step_exponent);
            };
            EXPECT_LE(side(kBlockBoxLow), center[i] - half[i]);
            EXPECT_GE(side(kBlockBoxHigh), center[i] + half[i]);
        }
    }
}

// If this fails because the algorithm has changed: increment kBuilderVersion and put the new hash here. Caches take
// equal versions for equal bytes.
TEST(Build, BytesChangeOnlyWithTheBuildersVersion) {
    const Build built = must_build(shapes::torus(1, 0.3f, 24, 12), quick(1));
    EXPECT_EQ(kBuilderVersion, 18u);
    EXPECT_EQ(hash_bytes(built.tree.bytes()), 2150742941869736914u);
    BuildOptions exact;
    exact.exact = true;
    EXPECT_EQ(hash_bytes(must_build(shapes::torus(1, 0.3f, 24, 12), exact).tree.bytes()), 11702347709430345517u);
}

// Corners strewn by up to 2 mm: they are joined, and what is covered and proved is the triangles as they were read.
TEST(Build, AWeldedMeshIsCoveredWhereItStood) {
    const Mesh whole = shapes::torus(1, 0.3f, 24, 12);
    Mesh loose;
    uint32_t seed = 1;
    const auto noise = [&seed] {
        return 4e-3f * (static_cast<float>((seed = seed * 1664525 + 1013904223) >> 8) / 0x1p24f - 0.5f);
    };
    for (const Triangle& t : whole.triangles) {
        const auto base = static_cast<uint32_t>(loose.vertices.size());
        for (const uint32_t corner : t) {
            const Vec3& v = whole.vertices[corner];
            loose.vertices.push_back({v.x + noise(), v.y + noise(), v.z + noise()});
        }
        loose.triangles.push_back({base, base + 1, base + 2});
    }
    for (const bool exact : {false, true}) {
        BuildOptions options = exact ? BuildOptions{} : quick(2);
        options.exact = exact;
        options.weld = 0.01f;
        const Build built = must_build(loose, options);
        EXPECT_TRUE(built.mesh.closed);
        EXPECT_GT(built.mesh.weld_distance, 2e-3);
        const TreeView tree = built.tree.view();
        EXPECT_EQ(tree.bake_info().weld, 0.01f);
        EXPECT_TRUE(verify(tree, loose.view())->covered);
        if (exact) continue; // whose answers are those of the welded triangles
        for (uint32_t l = 0; l < tree.level_count(); ++l)
            for (const Triangle& t : loose.triangles)
                for (const auto& [u, v] :
                     {std::pair{0., 0.}, {1., 0.}, {0., 1.}, {0.4, 0.3}, {0.5, 0.}, {0., 0.5}, {0.5, 0.5}}) {
                    const Vec3 &a = loose.vertices[t[0]], &b = loose.vertices[t[1]], &c = loose.vertices[t[2]];
                    const double p[3] = {a.x + u * (double{b.x} - a.x) + v * (double{c.x} - a.x),
                                         a.y + u * (double{b.y} - a.y) + v * (double{c.y} - a.y),
                                         a.z + u * (double{b.z} - a.z) + v * (double{c.z} - a.z)};
                    bool held = false;
                    tree.for_each_in_cut(l,
                                         [&](uint32_t node) { held |= radial_squared(tree.ellipsoid(node), p) <= 1; });
                    ASSERT_TRUE(held) << "level " << l;
                }
    }
}

TEST(Build, CountsAreExact) {
    const Mesh flat{{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}, {{0, 1, 2}, {0, 2, 3}}};
    for (const Mesh& mesh : {shapes::torus(1, 0.3f, 48, 24), shapes::tetrahedron(), flat})
        for (const uint32_t count : {1u, 2u, 7u, 33u, 64u}) {
            BuildOptions options = quick(0);
            options.ellipsoids = count;
            const Build built = must_build(mesh, options);
            EXPECT_TRUE(built.goal_reached);
            EXPECT_EQ(built.levels.back().nodes, count);
            uint32_t leaves = 0;
            built.tree.view().for_each_node([&](uint32_t n) { leaves += built.tree.view().is_leaf(n); });
            EXPECT_EQ(leaves, count);
            expect_proved(mesh, built);
            expect_covered(mesh, built);
        }
}

TEST(Build, LevelsHaveUpToDegreeChildren) {
    const Mesh mesh = shapes::torus(1, 0.3f, 48, 24);
    for (const uint32_t degree : {5u, 6u}) {
        BuildOptions options = quick(3);
        options.degree = degree;
        const Build built = must_build(mesh, options);
        const TreeView tree = built.tree.view();
        EXPECT_EQ(tree.level_count(), 4u);
        tree.for_each_node([&](uint32_t n) { EXPECT_LE(tree.children(n).count, degree); });
        for (uint32_t l = 1; l < 4; ++l) {
            EXPECT_LT(built.levels[l].outside_ratio, built.levels[l - 1].outside_ratio);
            EXPECT_GT(built.levels[l].nodes, 0.6 * std::pow(degree, l));
        }
        expect_covered(mesh, built);
    }
}

TEST(Build, OneNodeFitsAnEllipsoidTightly) {
    Mesh mesh = shapes::icosphere(4);
    for (Vec3& v : mesh.vertices) v = {2 * v.x + 0.5f * v.y + 7, v.y - 0.2f * v.z, 0.4f * v.z + 0.3f * v.x};
    for (const Method method : {Method::voxel, Method::analytic}) {
        BuildOptions options = quick(0);
        options.ellipsoids = 1;
        options.method = method;
        const Build built = must_build(mesh, options);
        EXPECT_LT(built.levels[0].outside_ratio, 0.02); // 0.003 of which the mesh is smaller than its own ellipsoid
        EXPECT_GT(built.levels[0].outside_ratio, 0.002);
    }
}

TEST(Build, LeavesOfSimpleShapesAreTight) {
    const auto ratio = [](const Mesh& mesh, uint32_t count, Primitive primitive = Primitive::ellipsoid) {
        BuildOptions options = quick(0);
        options.ellipsoids = count;
        options.primitive = primitive;
        const Build built = must_build(mesh, options);
        expect_proved(mesh, built);
        return built.levels.back().outside_ratio;
    };
    Mesh balls = shapes::icosphere(3);
    shapes::append(balls, shapes::moved(shapes::icosphere(3), {3, 1, 0}, 0.5f));
    EXPECT_LT(ratio(balls, 2), 0.06);
    EXPECT_LT(ratio(balls, 2, Primitive::sphere), 0.06);
    EXPECT_LT(ratio(shapes::torus(1, 0.3f, 48, 24), 8), 0.3);
    EXPECT_LT(ratio(shapes::torus(1, 0.3f, 48, 24), 8, Primitive::sphere), 1.6);
    // The smallest ellipsoid around a cube has pi / 2 * sqrt(3) times its volume.
    const double around_a_cube = std::numbers::pi / 2 * std::sqrt(3.0) - 1;
    EXPECT_NEAR(ratio(shapes::box(), 1), around_a_cube, 0.02);
    EXPECT_NEAR(ratio(shapes::box(), 1, Primitive::sphere), around_a_cube, 0.02);
    EXPECT_LT(ratio(shapes::box(), 8), 0.6 * around_a_cube);
}

// The smallest ellipsoid around any box has pi / 2 * sqrt(3) times its volume. Centers of a tree with children lie on a
// lattice that reaches across it, and one that is off by a good part of a sheet's thickness makes the root as much
// thicker.
TEST(Build, RootsOfThinBoxesAreNearlyAsSmallAsCanBe) {
    const double smallest = std::numbers::pi / 2 * std::sqrt(3.0) - 1;
    Random random(21);
    for (const double thickness : {1e-2, 1e-3, 1e-4})
        for (int attitude = 0; attitude < 3; ++attitude) {
            const Eigen::Quaterniond turn(random.uniform() - 0.5, random.uniform() - 0.5, random.uniform() - 0.5,
                                          random.uniform() - 0.5);
            const Vec away(3.7 * random.uniform(), -1.3 * random.uniform(), 0.31 * random.uniform());
            Mesh mesh = shapes::box(1, 1, static_cast<float>(thickness));
            for (Vec3& v : mesh.vertices) {
                const Vec p = away + (attitude == 0 ? to_vec(v) : turn.normalized() * to_vec(v));
                v = {static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(p.z())};
            }
            const Build built = must_build(mesh, quick(attitude == 0 ? 2 : 1));
            expect_proved(mesh, built);
            ASSERT_GT(built.levels.size(), 1u);
            EXPECT_GT(built.levels[1].nodes, 1u);
            const double ratio = volume(built.tree.view().root()) / built.solid_volume - 1;
            EXPECT_LT(ratio, 1.1 * smallest) << thickness << ' ' << attitude;
            EXPECT_GT(ratio, 0.98 * smallest) << thickness << ' ' << attitude; // floats move corners
        }
}

TEST(Build, AnalyticMethodNeedsAClosedMeshThatDoesNotOverlap) {
    BuildOptions options = quick(1);
    options.method = Method::analytic;
    for (const Mesh& mesh :
         {shapes::torus(1, 0.3f, 24, 12), shapes::inverted(shapes::icosphere(2)), shells(), half_inverted()}) {
        const Build built = must_build(mesh, options);
        EXPECT_EQ(built.tree.view().bake_info().method, Method::analytic);
        if (built.levels.size() > 1) { // a ball's ellipsoid is the best there is
            EXPECT_LT(built.levels[1].outside_ratio, built.levels[0].outside_ratio);
        }
        expect_proved(mesh, built);
        expect_covered(mesh, built);
    }
    for (const Mesh& mesh : {shapes::open_box(), overlapping()}) {
        const auto built = build(mesh.view(), options);
        ASSERT_FALSE(built);
        EXPECT_EQ(built.error().code, ErrorCode::bad_mesh);
    }
}

TEST(Build, ToleranceIsMet) {
    const Mesh mesh = shapes::torus(1, 0.3f, 48, 24);
    BuildOptions options = quick(0);
    options.tolerance = 0.2f;
    const Build built = must_build(mesh, options);
    EXPECT_TRUE(built.goal_reached);
    EXPECT_LE(built.levels.back().outside_ratio, 0.2 * 1.01);
    EXPECT_GT(built.levels[built.levels.size() - 2].outside_ratio, 0.2);
    options.tolerance = 0.2f;
    const auto flat = build(shapes::sheet(1, 1, 4).view(), options);
    ASSERT_FALSE(flat);
    EXPECT_EQ(flat.error().code, ErrorCode::bad_mesh);
}

TEST(Build, DistanceIsMet) {
    BuildOptions options = quick(0);
    options.distance = 4;
    for (const Mesh& mesh : {shapes::torus(1, 0.3f, 48, 24), shapes::sheet(1, 1, 4)}) {
        const Build built = must_build(mesh, options);
        EXPECT_TRUE(built.goal_reached);
        EXPECT_LE(built.levels.back().hausdorff_max, 0.04 * 1.01 * built.diagonal);
        EXPECT_GT(built.levels.front().hausdorff_max, 0.04 * built.diagonal);
        EXPECT_EQ(built.tree.view().bake_info().distance, 4.0f);
        expect_proved(mesh, built);
    }
    // Both limits hold if both are given.
    options.tolerance = 0.3f;
    const Build both = must_build(shapes::torus(1, 0.3f, 48, 24), options);
    EXPECT_LE(both.levels.back().hausdorff_max, 0.04 * 1.01 * both.diagonal);
    EXPECT_LE(both.levels.back().outside_ratio, 0.3 * 1.01);
    // A sheet's own ellipsoid is as close as the sheet is flat.
    options.tolerance = 0, options.distance = 50;
    EXPECT_EQ(must_build(shapes::sheet(1, 1, 4), options).levels.size(), 1u);
}

TEST(Build, GoalsThatCannotBeMetAreAdmitted) {
    // A sliver meets a few hundred cells at the finest resolution: no more leaves than that.
    const Mesh mesh{{{0, 0, 0}, {1, 0, 0}, {0.5f, 1e-4f, 0}}, {{0, 1, 2}}};
    BuildOptions options = quick(0);
    options.ellipsoids = 2000;
    const Build built = must_build(mesh, options);
    EXPECT_FALSE(built.goal_reached);
    EXPECT_LT(built.levels.back().nodes, 2000u);
    EXPECT_GT(built.levels.back().nodes, 100u);
}

TEST(Build, RefusesBadOptionsByName) {
    const Mesh mesh = shapes::box();
    const auto code = [&](auto&& change) {
        BuildOptions options;
        change(options);
        const auto built = build(mesh.view(), options);
        return built ? ErrorCode{} : built.error().code;
    };
    EXPECT_EQ(code([](BuildOptions& o) { o.degree = 1; }), ErrorCode::bad_options);
    EXPECT_EQ(code([](BuildOptions& o) { o.degree = 65; }), ErrorCode::bad_options);
    EXPECT_EQ(code([](BuildOptions& o) { o.levels = 2, o.ellipsoids = 5; }), ErrorCode::bad_options);
    EXPECT_EQ(code([](BuildOptions& o) { o.tolerance = -1; }), ErrorCode::bad_options);
    EXPECT_EQ(code([](BuildOptions& o) { o.tolerance = NAN; }), ErrorCode::bad_options);
    EXPECT_EQ(code([](BuildOptions& o) { o.distance = -1; }), ErrorCode::bad_options);
    EXPECT_EQ(code([](BuildOptions& o) { o.distance = 1, o.levels = 2; }), ErrorCode::bad_options);
    EXPECT_EQ(code([](BuildOptions& o) { o.alpha = 0, o.beta = 0; }), ErrorCode::bad_options);
}

TEST(Build, ReportsProgressAndCanBeCancelled) {
    const Mesh mesh = shapes::sheet(1, 1, 4);
    double last = 0;
    int calls = 0;
    ASSERT_TRUE(build(mesh.view(), quick(2), [&](const BuildProgress& p) {
        EXPECT_GE(p.fraction, last);
        EXPECT_LE(p.fraction, 1);
        last = p.fraction;
        return ++calls > 0;
    }));
    EXPECT_GT(calls, 10);
    EXPECT_GT(last, 0.9);
    for (int stop_at = 1; stop_at < calls; stop_at += calls / 3) {
        int seen = 0;
        const auto built = build(mesh.view(), quick(2), [&](const BuildProgress&) { return ++seen < stop_at; });
        ASSERT_FALSE(built);
        EXPECT_EQ(built.error().code, ErrorCode::cancelled);
    }
}

// Do all mesh vertices, and points of its triangles, lie in each cut?
bool samples_covered(const Mesh& mesh, const TreeView& tree) {
    Random random(8);
    std::vector<Vec> points;
    for (const Triangle& t : mesh.triangles) {
        const Vec a = to_vec(mesh.vertices[t[0]]), b = to_vec(mesh.vertices[t[1]]), c = to_vec(mesh.vertices[t[2]]);
        points.push_back(a);
        for (int i = 0; i < 20; ++i) {
            const double u = random.uniform(), v = (1 - u) * random.uniform();
            points.push_back(a + u * (b - a) + v * (c - a));
        }
    }
    for (uint32_t l = 0; l < tree.level_count(); ++l)
        for (const Vec& p : points) {
            bool covered = false;
            tree.for_each_in_cut(
                l, [&](uint32_t n) { covered = covered || radial_squared(tree.ellipsoid(n), p.data()) <= 1; });
            if (!covered) return false;
        }
    return true;
}

// The tree with the ellipsoid of `node` scaled about its center.
Tree with_scaled(const TreeView& tree, uint32_t node, double by) {
    Box centers;
    tree.for_each_node([&](uint32_t n) { centers.add(to_vec(tree.ellipsoid(n).center)); });
    const format::Lattice lattice = format::lattice_for(centers.low.data(), centers.high.data());
    std::vector<format::PackedLevel> levels(tree.level_count());
    for (uint32_t l = 0; l < tree.level_count(); ++l)
        tree.for_each_node(l, [&](uint32_t n) {
            const Fit fit = Fit(tree.ellipsoid(n)).scaled(n == node ? by : 1);
            const double factor[6] = {fit.factor(0, 0), fit.factor(1, 0), fit.factor(1, 1),
                                      fit.factor(2, 0), fit.factor(2, 1), fit.factor(2, 2)};
            format::PackedNode packed;
            format::quantise(packed, lattice, fit.center.data(), factor);
            packed.child_count = static_cast<uint8_t>(tree.children(n).count);
            levels[l].nodes.push_back(packed);
        });
    auto out = Tree::open(format::encode(tree.bake_info(), tree.degree(), lattice, levels));
    if (!out) throw std::runtime_error(out.error().what);
    return std::move(*out);
}

TEST(Verify, FailsWhenABoundingVolumeHoldsTooLittle) {
    const Mesh mesh = shapes::torus(1, 0.3f, 24, 12);
    const Build built = must_build(mesh, quick(2));
    const TreeView tree = built.tree.view();
    const auto report = verify(tree, mesh.view());
    ASSERT_TRUE(report);
    EXPECT_TRUE(report->covered && report->bounded);
    const auto with = [&](size_t at, int more) { // a byte of the root's bounding block
        std::vector<std::byte> bytes(tree.bytes().begin(), tree.bytes().end());
        std::byte& byte = bytes[static_cast<size_t>(tree.raw().bounding_block(0) - tree.bytes().data()) + at];
        byte = static_cast<std::byte>(static_cast<int>(byte) + more);
        const auto changed = TreeView::open(bytes, {.check_hash = false});
        EXPECT_TRUE(changed);
        return *verify(*changed, mesh.view());
    };
    const std::pair<size_t, int> changes[] = {{49, -2},   // l11 of the root: 2 % less
                                              {1, 2},     // its center
                                              {192, 2},   // its box, from below
                                              {216, -2}}; // and from above
    for (const auto& [at, more] : changes) {
        const VerifyReport smaller = with(at, more);
        EXPECT_FALSE(smaller.bounded) << at;
        EXPECT_FALSE(smaller.covered) << at;
        EXPECT_EQ(smaller.unbounded_node, 0u) << at;
        for (const LevelProof& level : smaller.levels) EXPECT_TRUE(level.covered) << at; // the ellipsoids are the same
    }
}

TEST(Verify, FailsWhenOneEllipsoidShrinksByOnePercent) {
    const Mesh mesh = shapes::torus(1, 0.3f, 24, 12);
    const Build built = must_build(mesh, quick(2));
    const TreeView tree = built.tree.view();
    // The repacked tree itself still covers: what the test finds is the shrinking.
    const auto same = verify(with_scaled(tree, 0, 1).view(), mesh.view());
    ASSERT_TRUE(same);
    EXPECT_TRUE(same->covered);
    // A shrunk node fails the proof unless its neighbours cover what it lost. Who is right is seen by dense samples.
    std::vector<uint32_t> nodes;
    tree.for_each_node([&](uint32_t n) { nodes.push_back(n); });
    uint32_t refuted = 0, exposed = 0;
    for (size_t i = 0; i < nodes.size(); i += i < 9 ? 1 : 4) {
        const uint32_t node = nodes[i];
        const Tree shrunk = with_scaled(tree, node, 0.99);
        const auto proof = verify(shrunk.view(), mesh.view());
        ASSERT_TRUE(proof);
        refuted += !proof->covered;
        if (!samples_covered(mesh, shrunk.view())) {
            ++exposed;
            EXPECT_FALSE(proof->covered) << node;
        }
        for (uint32_t l = 0; l < tree.level_count(); ++l) {
            const LevelProof& level = proof->levels[l];
            if (!level.has_counterexample) continue;
            // The counterexample is one: in no ellipsoid of the cut, and on the solid.
            shrunk.view().for_each_in_cut(
                l, [&](uint32_t n) { EXPECT_GT(radial_squared(shrunk.view().ellipsoid(n), level.point), 1); });
            const Vec p(level.point[0], level.point[1], level.point[2]);
            // A little towards the ring's middle line it is inside.
            const double ring = std::hypot(p.x(), p.y());
            const Vec inwards = Vec(p.x() / ring, p.y() / ring, 0) - p;
            EXPECT_GT(std::abs(Winding(mesh.view())(p + 1e-6 * inwards, HUGE_VAL)), 0.5);
            EXPECT_GT(level.depth, 0);
            EXPECT_LT(level.depth, 0.02);
        }
        if (node == 0) {
            EXPECT_FALSE(proof->covered); // alone on its level
        }
    }
    EXPECT_GE(refuted, 3u);
    EXPECT_GE(exposed, 2u); // the root among them
}

TEST(Verify, FindsAHoleInTheMiddle) {
    // Six discs cover the surface of a ball but not its center.
    const Mesh ball = shapes::icosphere(3);
    std::vector<format::PackedLevel> levels(2);
    const double low[3] = {-1, -1, -1}, high[3] = {1, 1, 1};
    const format::Lattice lattice = format::lattice_for(low, high);
    const auto node = [&](const Vec& c, const Vec& radii) {
        format::PackedNode packed;
        const double factor[6] = {radii.x(), 0, radii.y(), 0, 0, radii.z()};
        format::quantise(packed, lattice, c.data(), factor);
        return packed;
    };
    levels[0].nodes = {node(Vec::Zero(), Vec::Constant(1.1))};
    levels[0].nodes[0].child_count = 6;
    for (int a = 0; a < 3; ++a)
        for (const double side : {-1.0, 1.0}) {
            Vec radii = Vec::Constant(1.25);
            radii[a] = 0.62;
            levels[1].nodes.push_back(node(0.7 * side * Vec::Unit(a), radii));
        }
    const auto tree = Tree::open(format::encode({}, 8, lattice, levels));
    ASSERT_TRUE(tree);
    const auto proof = verify(tree->view(), ball.view());
    ASSERT_TRUE(proof);
    EXPECT_TRUE(proof->levels[0].covered);
    EXPECT_FALSE(proof->levels[1].covered);
    EXPECT_TRUE(proof->levels[1].has_counterexample);
    EXPECT_LT(Vec(proof->levels[1].point[0], proof->levels[1].point[1], proof->levels[1].point[2]).norm(), 0.6);
}

TEST(Verify, DecidesALongSeamInAFewPieces) {
    // Two balls over a square bar, askew, that meet a little outside of its edges, or a little inside.
    constexpr double kOffset = 0.25;
    constexpr float kWidth = 0.04f;
    const double edge_squared = 0.5 * double{kWidth} * kWidth;
    Random random(5);
    for (int round = 0; round < 20; ++round) {
        const Mat turn = random_rotation(random);
        Mesh bar = shapes::box(0.9f, kWidth, kWidth);
        for (Vec3& v : bar.vertices) {
            const Vec turned = turn * (to_vec(v) - Vec(0.45, kWidth / 2, kWidth / 2));
            v = {static_cast<float>(turned.x()), static_cast<float>(turned.y()), static_cast<float>(turned.z())};
        }
        for (const double excess : {0.3, -0.3}) {
            const double radius = std::sqrt(kOffset * kOffset + edge_squared * (1 + excess));
            std::vector<format::PackedLevel> levels(2);
            const double low[3] = {-1, -1, -1}, high[3] = {1, 1, 1};
            const format::Lattice lattice = format::lattice_for(low, high);
            const auto ball = [&](const Vec& center, double r) {
                format::PackedNode packed;
                const double factor[6] = {r, 0, r, 0, 0, r};
                format::quantise(packed, lattice, center.data(), factor);
                return packed;
            };
            levels[0].nodes = {ball(Vec::Zero(), 1)};
            levels[0].nodes[0].child_count = 2;
            for (const double side : {-1.0, 1.0}) levels[1].nodes.push_back(ball(side * kOffset * turn.col(0), radius));
            const auto tree = Tree::open(format::encode({}, 2, lattice, levels));
            ASSERT_TRUE(tree);
            const auto proof = verify(tree->view(), bar.view());
            ASSERT_TRUE(proof);
            EXPECT_EQ(proof->levels[1].covered, excess > 0) << round;
            EXPECT_EQ(proof->levels[1].has_counterexample, excess < 0) << round;
            EXPECT_LT(proof->levels[1].pieces, 3000u) << round;
        }
    }
}

// Outside ratios of the naive k-means + minimum-ellipsoid hierarchy, judged independently: ours must not be worse.
struct Naive {
    const char* model;
    double ratio[3];
};

TEST(Build, BeatsTheNaiveHierarchyOnRealMeshes) {
    const std::string folder = std::string(PROLATE_SOURCE_DIR) + "/../shared/data/";
    if (!std::ifstream(folder + "knight.obj")) GTEST_SKIP() << "no shared data beside the checkout";
    for (const Naive& naive : {Naive{"knight", {1.96, 0.77, 0.34}}, Naive{"homer", {1.00, 0.42, 0.25}}}) {
        const auto mesh = load_mesh((folder + naive.model + ".obj").c_str());
        ASSERT_TRUE(mesh);
        BuildOptions options;
        options.levels = 3;
        options.quality = Quality::fast;
        const Build built = must_build(*mesh, options);
        for (size_t l = 0; l < 3; ++l) EXPECT_LE(built.levels[l + 1].outside_ratio, naive.ratio[l]) << naive.model;
        EXPECT_LE(built.tree.view().node_count(), 1u + 8 + 64 + 512);
        EXPECT_LE(built.tree.bytes().size(), 1024 + kBlockBytes * (1u + 1 + 8 + 64 + 1 + 1 + 8)); // and bounding blocks
    }
}

} // namespace
} // namespace prolate
