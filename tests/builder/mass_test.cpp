// Mass properties against shapes whose are known, and against integrals in exact integers.
#include "builder/mass.hpp"

#include "tests/scenes.hpp"
#include "tests/shapes.hpp"

#include <prolate/build.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace prolate {
namespace {

using scenes::Random;
__extension__ typedef __int128 Exact; // NOLINT(modernize-use-using): only so does -Wpedantic let it pass

MassProperties mass_of_solid(const Mesh& mesh, bool closed = true, int columns_across = 128) {
    const Winding winding(mesh.view());
    return mass_of(mesh.view(), closed, measuring_columns(mesh.view(), closed, &winding, columns_across));
}

// What is asked of all results: the truth lies within the error, and the error is no larger than `relative` says.
void expect_within(const MassProperties& mass, double volume, const double (&center)[3], const double (&inertia)[6],
                   double relative) {
    const double length = std::cbrt(volume) + std::hypot(center[0], center[1], center[2]);
    EXPECT_LE(std::abs(mass.volume - volume), mass.volume_error);
    EXPECT_LE(mass.volume_error, relative * volume);
    for (size_t i = 0; i < 3; ++i) EXPECT_LE(std::abs(mass.center[i] - center[i]), mass.center_error) << i;
    EXPECT_LE(mass.center_error, relative * length);
    for (size_t i = 0; i < 6; ++i) EXPECT_LE(std::abs(mass.inertia[i] - inertia[i]), mass.inertia_error) << i;
    EXPECT_LE(mass.inertia_error, relative * (inertia[0] + inertia[1] + inertia[2]));
}

void expect_box(const MassProperties& mass, double x, double y, double z, const double (&center)[3], double relative) {
    const double v = x * y * z;
    expect_within(mass, v, center,
                  {v / 12 * (y * y + z * z), v / 12 * (x * x + z * z), v / 12 * (x * x + y * y), 0, 0, 0}, relative);
}

TEST(Mass, OfBoxes) {
    expect_box(mass_of_solid(shapes::box(1, 2, 4)), 1, 2, 4, {0.5, 1, 2}, 1e-12);
    expect_box(mass_of_solid(shapes::moved(shapes::box(1, 2, 4), {1024, -512, 7})), 1, 2, 4, {1024.5, -511, 9}, 1e-12);
}

TEST(Mass, OfATetrahedron) { // about its centre, which is (1, 1, 1) / 4: xx = 6 / 160, xy = 1 / 480
    expect_within(mass_of_solid(shapes::tetrahedron()), 1.0 / 6, {0.25, 0.25, 0.25},
                  {0.0125, 0.0125, 0.0125, 1.0 / 480, 1.0 / 480, 1.0 / 480}, 1e-12);
}

// The integrals of 1, x_i, x_i x_j times 6, 24 and 120, in integers, x relative to (far, far, far).
struct Integrals {
    Exact one = 0, x[3] = {}, xx[3][3] = {};
};
Integrals exact_integrals(const Mesh& mesh, Exact far) {
    Integrals out;
    for (const Triangle& t : mesh.triangles) {
        Exact p[3][3];
        for (size_t k = 0; k < 3; ++k) {
            const Vec3 v = mesh.vertices[t[k]];
            const float x[] = {v.x, v.y, v.z};
            for (size_t i = 0; i < 3; ++i) p[k][i] = static_cast<Exact>(x[i]) - far;
        }
        Exact d = 0;
        for (size_t i = 0; i < 3; ++i)
            d += p[0][i] * (p[1][(i + 1) % 3] * p[2][(i + 2) % 3] - p[1][(i + 2) % 3] * p[2][(i + 1) % 3]);
        out.one += d;
        const auto sum = [&](size_t i) { return p[0][i] + p[1][i] + p[2][i]; };
        for (size_t i = 0; i < 3; ++i) {
            out.x[i] += d * sum(i);
            for (size_t j = 0; j < 3; ++j)
                out.xx[i][j] += d * (sum(i) * sum(j) + p[0][i] * p[0][j] + p[1][i] * p[1][j] + p[2][i] * p[2][j]);
        }
    }
    return out;
}

// Closed meshes of random shape with whole coordinates, near the origin and far from it.
TEST(Mass, OfRandomSolidsAgainstIntegers) {
    Random random(5);
    for (int i = 0; i < 40; ++i) {
        const float size = i % 2 ? 4096 : 64, far = i % 4 < 2 ? 0.0f : 65536.0f;
        Mesh mesh = shapes::torus(1, 0.45f, 24, 12);
        for (Vec3& v : mesh.vertices) {
            const auto whole = [&](float x) {
                return std::round(size * (x + static_cast<float>(random.in(-0.03, 0.03)))) + far;
            };
            v = {whole(v.x), whole(1.5f * v.y + 0.3f * v.x), whole(v.z)};
        }
        const Integrals exact = exact_integrals(mesh, static_cast<Exact>(far));
        const auto real = [](Exact x) { return static_cast<long double>(x); };
        const long double v = real(exact.one) / 6;
        long double c[3], second[3][3];
        for (size_t k = 0; k < 3; ++k) c[k] = real(exact.x[k]) / 24 / v;
        for (size_t k = 0; k < 3; ++k)
            for (size_t l = 0; l < 3; ++l) second[k][l] = real(exact.xx[k][l]) / 120 - v * c[k] * c[l];
        const auto entry = [&](size_t k, size_t l) { return static_cast<double>(second[k][l]); };
        const auto center = [&](size_t k) { return static_cast<double>(c[k] + static_cast<long double>(far)); };
        expect_within(mass_of_solid(mesh), static_cast<double>(v), {center(0), center(1), center(2)},
                      {entry(1, 1) + entry(2, 2), entry(0, 0) + entry(2, 2), entry(0, 0) + entry(1, 1), -entry(0, 1),
                       -entry(0, 2), -entry(1, 2)},
                      1e-10);
    }
}

// Two boxes that overlap: together one box.
TEST(Mass, OverlapsCountOnce) {
    Mesh mesh = shapes::box(2, 1, 1);
    shapes::append(mesh, shapes::moved(shapes::box(2, 1, 1), {1, 0, 0}));
    expect_box(mass_of_solid(mesh), 3, 1, 1, {1.5, 0.5, 0.5}, 0.05);
}

TEST(Mass, HollowsCountAsSuch) {
    const Mesh outer = shapes::icosphere(3), inner = shapes::moved(outer, {}, 0.8f);
    const MassProperties hollow = mass_of_solid(shapes::hollow_ball()), a = mass_of_solid(outer),
                         b = mass_of_solid(inner);
    EXPECT_NEAR(hollow.volume, a.volume - b.volume, 1e-12);
    EXPECT_NEAR(hollow.inertia[0], a.inertia[0] - b.inertia[0], 1e-12);
}

TEST(Mass, ATorusIsNearItsFormula) {
    const double big = 1, small = 0.25, pi = std::numbers::pi, v = 2 * pi * pi * big * small * small;
    const MassProperties mass = mass_of_solid(shapes::torus(1, 0.25f, 400, 200));
    EXPECT_NEAR(mass.volume, v, 1e-3 * v);
    EXPECT_NEAR(mass.inertia[2], v * (big * big + 0.75 * small * small), 2e-3 * v);
    EXPECT_NEAR(mass.inertia[0], v * (big * big / 2 + 0.625 * small * small), 2e-3 * v);
}

TEST(Mass, OfAnOpenMeshByColumns) {
    const MassProperties mass = mass_of_solid(shapes::open_box(), false);
    EXPECT_GT(mass.volume, 0.5); // the generalized winding number leaves out a part near the missing face
    EXPECT_LT(mass.volume, 1.1);
    EXPECT_GT(mass.volume_error, 0);
}

TEST(Mass, SheetsHaveNone) {
    EXPECT_EQ(mass_of_solid(shapes::sheet(1, 1, 4), false), MassProperties{});
}

TEST(Mass, ScaledAndMirroredAsTheMeshWouldBe) {
    Random random(2);
    Mesh mesh = shapes::tetrahedron();
    for (Vec3& v : mesh.vertices) v = {v.x + 0.25f, 2 * v.y + 0.5f * v.x, 3 * v.z - 1};
    const MassProperties mass = mass_of_solid(mesh);
    for (const double scale : {2.0, 0.125, -1.0, -4.0}) {
        Mesh other = mesh;
        for (Vec3& v : other.vertices)
            v = {static_cast<float>(scale) * v.x, static_cast<float>(scale) * v.y, static_cast<float>(scale) * v.z};
        if (scale < 0) other = shapes::inverted(other);
        const MassProperties expected = mass_of_solid(other), got = scaled(mass, scale);
        EXPECT_NEAR(got.volume, expected.volume, 1e-13 * expected.volume);
        for (size_t i = 0; i < 3; ++i) EXPECT_NEAR(got.center[i], expected.center[i], got.center_error) << scale;
        for (size_t i = 0; i < 6; ++i) EXPECT_NEAR(got.inertia[i], expected.inertia[i], got.inertia_error) << scale;
    }
}

TEST(Mass, PlacedAsTheMeshWouldBe) {
    const Mesh mesh = shapes::moved(shapes::box(1, 2, 3), {1, 0, -2});
    const Pose pose{{5, -1, 2}, {1, 1, 1, 1}}; // x -> y -> z -> x
    Mesh other = mesh;
    for (Vec3& v : other.vertices) v = {v.z + 5, v.x - 1, v.y + 2};
    const MassProperties got = placed(mass_of_solid(mesh), pose), expected = mass_of_solid(other);
    for (size_t i = 0; i < 3; ++i) EXPECT_NEAR(got.center[i], expected.center[i], got.center_error);
    for (size_t i = 0; i < 6; ++i) EXPECT_NEAR(got.inertia[i], expected.inertia[i], got.inertia_error);
    EXPECT_TRUE(std::isnan(placed(got, {{0, 0, 0}, {0, 0, 0, 0}}).center[0]));
}

TEST(Mass, PrincipalMomentsRebuildTheTensor) {
    Mesh mesh = shapes::tetrahedron();
    for (Vec3& v : mesh.vertices) v = {v.x + 0.25f, 2 * v.y + 0.5f * v.x, 3 * v.z - 1};
    const MassProperties mass = mass_of_solid(mesh);
    const PrincipalInertia principal = principal_inertia(mass);
    EXPECT_GE(principal.moments[0], principal.moments[1]);
    EXPECT_GE(principal.moments[1], principal.moments[2]);
    MassProperties diagonal;
    diagonal.inertia = {principal.moments[0], principal.moments[1], principal.moments[2], 0, 0, 0};
    const MassProperties back = placed(diagonal, principal.frame);
    for (size_t i = 0; i < 6; ++i) EXPECT_NEAR(back.inertia[i], mass.inertia[i], 1e-6 * principal.moments[0]) << i;
    for (size_t i = 0; i < 3; ++i) EXPECT_NEAR(back.center[i], mass.center[i], 1e-6) << i;
}

// The file tells what was measured, of exact trees and others, mirrored by the import's scale.
TEST(Mass, IsInTheFile) {
    for (const bool exact : {false, true}) {
        const auto built = build(shapes::box(1, 2, 3).view(), {.levels = exact ? 0u : 1u, .exact = exact});
        ASSERT_TRUE(built);
        expect_box(built->mass, 1, 2, 3, {0.5, 1, 1.5}, 1e-12);
        EXPECT_EQ(built->tree.view().bake_info().mass, built->mass);
    }
    const auto open = build(shapes::open_box().view(), {.exact = true});
    ASSERT_TRUE(open);
    EXPECT_EQ(open->tree.view().bake_info().mass, MassProperties{});
}

} // namespace
} // namespace prolate
