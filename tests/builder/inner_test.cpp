// Inner covers: what grows inside the solid stays there, fills much of it, and is proved.
#include "builder/inscribed.hpp"
#include "builder/obstacles.hpp"
#include "builder/verify_inner.hpp"
#include "tests/builder/bakes.hpp"
#include "tests/scenes.hpp"
#include "tests/shapes.hpp"

#include <prolate/build.hpp>
#include <prolate/verify.hpp>
#include <prolate/version.hpp>

#include <Eigen/LU>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

namespace prolate {
namespace {

using scenes::Random;

BuildOptions with_inner(uint32_t count) {
    BuildOptions options = quick(0);
    options.ellipsoids = 1, options.inner = count;
    return options;
}

Mesh two_balls() { // overlapping: triangles inside the solid
    Mesh mesh = shapes::icosphere(2);
    shapes::append(mesh, shapes::moved(shapes::icosphere(2), {1, 0.1f, 0}, 0.7f));
    return mesh;
}

double share(const Build& built) {
    const TreeView inner = *built.tree.view().inner();
    return inner.level(inner.level_count() - 1).union_volume / built.solid_volume;
}

// No point of any node's ellipsoid is outside: by the generalized winding number, on the ellipsoid's surface.
void expect_inside(const TreeView& inner, const Mesh& mesh) {
    const Winding winding(mesh.view());
    Random random(5);
    inner.for_each_node([&](uint32_t node) {
        const Fit fit(inner.ellipsoid(node));
        for (int i = 0; i < 60; ++i) {
            const auto u = random.direction();
            const Vec p = fit.center + fit.factor * Vec(u[0], u[1], u[2]);
            ASSERT_GT(std::abs(winding(p, HUGE_VAL)), 0.5) << "node " << node;
        }
    });
}

struct Model {
    const char* name;
    Mesh mesh;
    double share; // of the solid that 16 ellipsoids hold at least
};
void PrintTo(const Model& model, std::ostream* out) {
    *out << model.name;
}
class InnerOf : public testing::TestWithParam<Model> {};

TEST_P(InnerOf, LiesInsideAndFillsMuch) {
    const Mesh& mesh = GetParam().mesh;
    const Build built = must_build(mesh, with_inner(10));
    const auto inner = built.tree.view().inner();
    ASSERT_TRUE(inner);
    EXPECT_TRUE(inner->bake_info().inner && inner->bake_info().proved);
    EXPECT_GE(share(built), GetParam().share);
    EXPECT_LE(share(built), 1);
    expect_inside(*inner, mesh);
    for (uint32_t l = 1; l < inner->level_count(); ++l) // deeper levels hold those above
        EXPECT_GE(inner->level(l).union_volume, inner->level(l - 1).union_volume * (1 - 1e-12));
    const auto proof = verify(built.tree.view(), mesh.view());
    ASSERT_TRUE(proof);
    EXPECT_TRUE(proof->covered && proof->has_inner && proof->inner_inside);
}

INSTANTIATE_TEST_SUITE_P(
    Meshes, InnerOf,
    testing::Values(Model{"box", shapes::box(), 0.7}, Model{"ball", shapes::icosphere(2), 0.9},
                    Model{"torus", shapes::torus(1, 0.3f, 24, 12), 0.75}, Model{"plate", shapes::box(1, 1, 0.05f), 0.6},
                    Model{"tetrahedron", shapes::tetrahedron(), 0.6}, Model{"hollow_ball", shapes::hollow_ball(), 0.2},
                    Model{"inside_out", shapes::inverted(shapes::icosphere(2)), 0.9},
                    Model{"two_pieces", shapes::two_pieces(), 0.6}, Model{"overlapping", two_balls(), 0.6}),
    [](const auto& model) { return std::string(model.param.name); });

TEST(Inner, TheTreeItselfStaysAsItIs) {
    const Mesh mesh = shapes::torus(1, 0.3f, 24, 12);
    BuildOptions options = with_inner(0);
    const Build without = must_build(mesh, options);
    options.inner = 12, options.threads = 1;
    const Build with = must_build(mesh, options);
    EXPECT_EQ(without.tree.view().format_version(), kPlainFormatVersion);
    EXPECT_EQ(with.tree.view().format_version(), kFormatVersion);
    const TreeView a = without.tree.view(), b = with.tree.view();
    ASSERT_EQ(a.slot_count(), b.slot_count());
    a.for_each_node([&](uint32_t node) { EXPECT_EQ(a.ellipsoid(node), b.ellipsoid(node)); });
    EXPECT_NE(a.bake_info().options_hash, b.bake_info().options_hash);
    options.threads = 3; // the same bytes for any number of threads
    EXPECT_TRUE(std::ranges::equal(must_build(mesh, options).tree.bytes(), with.tree.bytes()));
}

TEST(Inner, BallsAreBalls) {
    BuildOptions options = with_inner(12);
    options.primitive = Primitive::sphere;
    const Mesh mesh = shapes::box(1, 0.6f, 0.4f);
    const Build built = must_build(mesh, options);
    expect_inside(*built.tree.view().inner(), mesh);
    built.tree.view().inner()->for_each_node([&](uint32_t node) {
        const PrincipalAxes axes = principal_axes(built.tree.view().inner()->ellipsoid(node));
        EXPECT_NEAR(axes.radii[0] / axes.radii[2], 1, 1e-3);
    });
}

TEST(Inner, GoesWithExactTrees) {
    BuildOptions options;
    options.exact = true, options.inner = 10;
    const Mesh torus = shapes::torus(1, 0.3f, 24, 12);
    const Build exact = must_build(torus, options);
    EXPECT_TRUE(exact.tree.view().has_triangles());
    expect_inside(*exact.tree.view().inner(), torus);
    const auto proof = verify(exact.tree.view(), torus.view());
    EXPECT_TRUE(proof && proof->covered && proof->has_inner);
}

TEST(Inner, RefusesWhatHasNoInside) {
    for (const auto& [mesh, code] : {std::pair(shapes::open_box(), ErrorCode::bad_mesh)}) {
        const auto built = build(mesh.view(), with_inner(8));
        ASSERT_FALSE(built);
        EXPECT_EQ(built.error().code, code);
        EXPECT_NE(std::string(built.error().what).find("inner cover"), std::string::npos);
    }
    const auto thin = build(shapes::box(1, 1, 1e-5f).view(), with_inner(8));
    ASSERT_FALSE(thin);
    EXPECT_EQ(thin.error().code, ErrorCode::bad_mesh);
    BuildOptions many = with_inner(65537);
    EXPECT_EQ(validate(many).error().code, ErrorCode::bad_options);
}

TEST(Inner, VerifyFindsWhatSticksOut) {
    const Build built = must_build(shapes::icosphere(2), with_inner(3));
    // Of a slightly smaller ball, and of one with a triangle in it, the same ellipsoids do not lie inside.
    for (const Mesh& other : {shapes::moved(shapes::icosphere(2), {}, 0.98f), shapes::hollow_ball()}) {
        const auto proof = verify(built.tree.view(), other.view());
        ASSERT_TRUE(proof);
        EXPECT_FALSE(proof->inner_inside);
        EXPECT_FALSE(proof->covered);
    }
    const auto larger = verify(built.tree.view(), shapes::moved(shapes::icosphere(2), {}, 1.001f).view());
    EXPECT_TRUE(larger && larger->inner_inside);
}

TEST(Obstacles, PlanesShutOutAllTriangles) {
    const Mesh mesh = shapes::torus(1, 0.3f, 30, 16);
    const TriangleTree surface(mesh.view());
    Random random(2);
    for (int i = 0; i < 50; ++i) {
        const double angle = random.in(0, 6.28);
        const double size = random.in(0.1, 0.2);
        const Fit fit(Vec(std::cos(angle), std::sin(angle), 0), size * Mat::Identity());
        const std::vector<Obstacle> planes = obstacles(fit, surface, 4, 1000);
        ASSERT_FALSE(planes.empty());
        EXPECT_NEAR(planes[0].height, clearance(fit, surface, 100), 1e-12);
        EXPECT_NEAR(planes[0].height * size, surface.distance(fit.center), 1e-6 * size);
        for (const Triangle& t : mesh.triangles) { // each is beyond a plane, or wholly beyond the reach
            bool out = false;
            double nearest = HUGE_VAL;
            for (const Obstacle& o : planes) {
                double least = HUGE_VAL;
                for (const uint32_t v : t) least = std::min(least, o.normal.dot(fit.radial(to_vec(mesh.vertices[v]))));
                out = out || least >= o.height * (1 - 1e-8);
            }
            nearest = nearest_point(Vec::Zero(), fit.radial(to_vec(mesh.vertices[t[0]])),
                                    fit.radial(to_vec(mesh.vertices[t[1]])), fit.radial(to_vec(mesh.vertices[t[2]])))
                          .norm();
            ASSERT_TRUE(out || nearest >= 4 * (1 - 1e-9));
        }
    }
}

TEST(Inscribed, IsTheLargestOfBoxesAndLiesInside) {
    const auto plane = [](double x, double y, double z, double height) {
        const Vec n(x, y, z);
        return Obstacle{n.normalized(), height};
    };
    const std::vector<Obstacle> box{plane(1, 0, 0, 1), plane(-1, 0, 0, 2), plane(0, 1, 0, 1.5), plane(0, 0, -1, 1)};
    const Fit fit = largest_inscribed(box, 3, false);
    const double best = 1.5 * 2.25 * 2; // half sides of the box
    EXPECT_GE(fit.factor.determinant(), 0.93 * best);
    EXPECT_LE(fit.factor.determinant(), best);
    EXPECT_NEAR(largest_inscribed(box, 3, true).factor(0, 0), 1.5, 0.05);
    Random random(4);
    for (int i = 0; i < 100; ++i) {
        std::vector<Obstacle> planes;
        for (uint32_t k = 4 + random.below(30); k > 0; --k) {
            const auto d = random.direction();
            planes.push_back(plane(d[0], d[1], d[2], random.in(1, 2)));
        }
        for (const bool ball : {false, true}) {
            const Fit inside = largest_inscribed(planes, 3, ball);
            EXPECT_GE(inside.factor.determinant(), ball ? 0.85 : 0.9);
            for (const Obstacle& o : planes)
                EXPECT_LE(o.normal.dot(inside.center) + (inside.factor.transpose() * o.normal).norm(), o.height);
        }
    }
}

} // namespace
} // namespace prolate
