// build() and verify(): cover at every level, for every kind of mesh; and that verify() finds what does not cover.
#include "builder/fit.hpp"
#include "builder/random.hpp"
#include "builder/winding.hpp"
#include "src/format.hpp"
#include "tests/shapes.hpp"

#include <prolate/build.hpp>
#include <prolate/verify.hpp>

#include <gtest/gtest.h>

#include <fstream>

namespace prolate {
namespace {

BuildOptions quick(uint32_t levels = 2) {
    BuildOptions options;
    options.levels = levels;
    options.quality = Quality::fast;
    return options;
}

Build must_build(const Mesh& mesh, const BuildOptions& options) {
    auto built = build(mesh.view(), options);
    if (!built) throw std::runtime_error(built.error().what);
    return std::move(*built);
}

// An independent look: random points of the solid against each level.
void expect_covered(const Mesh& mesh, const Build& built) {
    const Winding winding(mesh.view());
    Box box;
    for (const Vec3& v : mesh.vertices) box.add(to_vec(v));
    Random random(4);
    for (uint32_t l = 0; l < built.tree.view().level_count(); ++l) {
        std::vector<Fit> fits;
        built.tree.view().for_each_in_cut(l, [&](uint32_t n) { fits.emplace_back(built.tree.view().ellipsoid(n)); });
        const auto covered = [&](const Vec& p) {
            return std::any_of(fits.begin(), fits.end(), [&](const Fit& f) { return f.radial_squared(p) <= 1; });
        };
        for (const Triangle& t : mesh.triangles) {
            double u = random.uniform(), v = random.uniform();
            if (u + v > 1) u = 1 - u, v = 1 - v;
            const Vec a = to_vec(mesh.vertices[t[0]]), b = to_vec(mesh.vertices[t[1]]), c = to_vec(mesh.vertices[t[2]]);
            EXPECT_TRUE(covered(a + u * (b - a) + v * (c - a))) << "level " << l;
            EXPECT_TRUE(covered(a)) << "level " << l;
        }
        for (int i = 0; i < 3000; ++i) {
            const Vec p = box.low + Vec(random.uniform(), random.uniform(), random.uniform()).cwiseProduct(box.size());
            if (!built.surface_mode && std::abs(winding(p)) > 0.75) {
                EXPECT_TRUE(covered(p)) << "level " << l;
            }
        }
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

TEST_P(BuildOf, CoversEveryLevel) {
    const Mesh& mesh = GetParam().mesh;
    const Build built = must_build(mesh, quick());
    EXPECT_EQ(built.levels.size(), built.tree.view().level_count());
    expect_proved(mesh, built);
    expect_covered(mesh, built);
    for (size_t l = 1; l < built.levels.size(); ++l)
        if (built.solid_volume > 0) {
            EXPECT_LT(built.levels[l].outside_ratio, built.levels[l - 1].outside_ratio);
        }
}

Mesh two_pieces() {
    Mesh mesh = shapes::icosphere(2);
    shapes::append(mesh, shapes::moved(shapes::icosphere(2), {5, 0, 0}, 0.5f));
    return mesh;
}

Mesh hollow_ball() {
    Mesh mesh = shapes::icosphere(3);
    shapes::append(mesh, shapes::inverted(shapes::moved(shapes::icosphere(3), {}, 0.8f)));
    return mesh;
}

Mesh open_box() {
    Mesh mesh = shapes::box();
    mesh.triangles.resize(10);
    return mesh;
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

INSTANTIATE_TEST_SUITE_P(
    Meshes, BuildOf,
    testing::Values(Model{"torus", shapes::torus(1, 0.3f, 48, 24)}, Model{"box", shapes::box(1, 2, 3)},
                    Model{"tetrahedron", shapes::tetrahedron()},
                    Model{"inside_out", shapes::inverted(shapes::icosphere(3))}, Model{"hollow", hollow_ball()},
                    Model{"two_pieces", two_pieces()},
                    Model{"plate", shapes::box(1, 1, 0.001f)}, // far thinner than a cell
                    Model{"needle", shapes::box(1, 0.001f, 0.001f)}, Model{"sheet", shapes::sheet(1, 1, 8)},
                    Model{"open_box", open_box()}, Model{"dust", dust()},
                    Model{"one_triangle", Mesh{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}}},
                    Model{"micrometres", shapes::moved(shapes::torus(1, 0.3f, 24, 12), {}, 1e-6f)},
                    Model{"kilometres", shapes::moved(shapes::torus(1, 0.3f, 24, 12), {}, 1e6f)},
                    Model{"far_away", shapes::moved(shapes::torus(1, 0.3f, 24, 12), {1e4f, -1e4f, 5e3f})}),
    [](const auto& model) { return std::string(model.param.name); });

TEST(Build, SurfaceModeIsAnnounced) {
    EXPECT_TRUE(must_build(open_box(), quick(1)).surface_mode);
    EXPECT_TRUE(must_build(open_box(), quick(1)).tree.view().bake_info().surface_mode);
    EXPECT_FALSE(must_build(shapes::box(), quick(1)).surface_mode);
}

TEST(Build, SameBytesForAnyNumberOfThreads) {
    const Mesh mesh = shapes::torus(1, 0.3f, 24, 12);
    BuildOptions options = quick();
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

TEST(Build, CountsAreExact) {
    const Mesh mesh = shapes::torus(1, 0.3f, 48, 24);
    for (const uint32_t count : {1u, 2u, 7u, 20u, 33u}) {
        BuildOptions options = quick(0);
        options.ellipsoids = count;
        const Build built = must_build(mesh, options);
        EXPECT_TRUE(built.goal_reached);
        EXPECT_EQ(built.levels.back().nodes, count);
        expect_proved(mesh, built);
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
    EXPECT_EQ(code([](BuildOptions& o) { o.alpha = 0, o.beta = 0; }), ErrorCode::bad_options);
    EXPECT_EQ(code([](BuildOptions& o) { o.method = Method::analytic; }), ErrorCode::unsupported);
    EXPECT_EQ(code([](BuildOptions& o) { o.primitive = Primitive::sphere; }), ErrorCode::unsupported);
}

TEST(Build, ReportsProgressAndCanBeCancelled) {
    const Mesh mesh = shapes::sheet(1, 1, 4);
    double last = 0;
    int calls = 0;
    ASSERT_TRUE(build(mesh.view(), quick(), [&](const BuildProgress& p) {
        EXPECT_GE(p.fraction, last);
        EXPECT_LE(p.fraction, 1);
        last = p.fraction;
        return ++calls > 0;
    }));
    EXPECT_GT(calls, 10);
    EXPECT_GT(last, 0.9);
    for (int stop_at = 1; stop_at < calls; stop_at += calls / 3) {
        int seen = 0;
        const auto built = build(mesh.view(), quick(), [&](const BuildProgress&) { return ++seen < stop_at; });
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
    for (uint32_t n = 0; n < tree.node_count(); ++n) centers.add(to_vec(tree.ellipsoid(n).center));
    const format::Lattice lattice = format::lattice_for(centers.low.data(), centers.high.data());
    std::vector<format::PackedLevel> levels(tree.level_count());
    for (uint32_t l = 0; l < tree.level_count(); ++l)
        for (uint32_t i = 0; i < tree.level(l).node_count; ++i) {
            const uint32_t n = tree.level(l).first_node + i;
            const Fit fit = Fit(tree.ellipsoid(n)).scaled(n == node ? by : 1);
            const double factor[6] = {fit.factor(0, 0), fit.factor(1, 0), fit.factor(1, 1),
                                      fit.factor(2, 0), fit.factor(2, 1), fit.factor(2, 2)};
            format::PackedNode packed;
            format::quantise(packed, lattice, fit.center.data(), factor);
            packed.child_count = static_cast<uint8_t>(tree.children(n).count);
            levels[l].nodes.push_back(packed);
        }
    auto out = Tree::open(format::encode(tree.bake_info(), tree.degree(), lattice, levels));
    if (!out) throw std::runtime_error(out.error().what);
    return std::move(*out);
}

TEST(Verify, FailsWhenOneEllipsoidShrinksByOnePercent) {
    const Mesh mesh = shapes::torus(1, 0.3f, 24, 12);
    const Build built = must_build(mesh, quick());
    const TreeView tree = built.tree.view();
    // The repacked tree itself still covers: what the test finds is the shrinking.
    const auto same = verify(with_scaled(tree, 0, 1).view(), mesh.view());
    ASSERT_TRUE(same);
    EXPECT_TRUE(same->covered);
    // A shrunk node fails the proof unless its neighbours cover what it lost. Who is right is seen by dense samples.
    uint32_t refuted = 0, exposed = 0;
    for (uint32_t node = 0; node < tree.node_count(); node += node < 9 ? 1 : 4) {
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
            // The counterexample is one: on no ellipsoid of the cut, and on the solid.
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
        EXPECT_LE(built.tree.bytes().size(), 128 + 4 * 32 + 24 * (1 + 8 + 64 + 512));
    }
}

} // namespace
} // namespace prolate
