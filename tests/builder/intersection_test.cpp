// The closed form of (solid ∩ ellipsoid) against integrals, columns, known bodies, and itself.
#include "builder/columns.hpp"
#include "builder/intersection.hpp"
#include "builder/random.hpp"
#include "tests/shapes.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include <array>
#include <cmath>
#include <filesystem>
#include <numbers>

namespace prolate {
namespace {

constexpr double kBall = 4.0 / 3.0 * std::numbers::pi;

Vec random_vec(Random& random) {
    const double x = random.symmetric(), y = random.symmetric(), z = random.symmetric();
    return {x, y, z};
}

// Of about the volume of a ball with this radius; axis ratios up to about 6.
Fit random_ellipsoid(Random& random, const Vec& center, double radius) {
    Mat factor = Mat::Zero();
    for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < i; ++j) factor(i, j) = 0.5 * random.symmetric();
        factor(i, i) = std::pow(2.0, random.symmetric());
    }
    return {center, radius * factor};
}

Fit ball(const Vec& center, double radius) {
    return {center, radius * Mat::Identity()};
}

double inside(const Mesh& mesh, const Fit& fit) {
    return inside_volume(fit, Winding(mesh.view())).volume;
}

Vec3 to_vec3(const Vec& v) {
    return {float(v.x()), float(v.y()), float(v.z())};
}

// The same by the formula that needs no arcs, over all triangles: with Omega the solid angle at the center of
// (triangle ∩ ball), 3 V = 4 pi w(center) + sum of (h A - Omega). Walks each edge: a piece in the disc adds the
// triangle that it spans with the disc's center, one outside of it adds a sector.
double reference(const Mesh& mesh, const Fit& fit) {
    double sum = 0;
    for (const Triangle& t : mesh.triangles) {
        std::array<Vec, 3> y;
        for (size_t i = 0; i < 3; ++i) y[i] = fit.radial(to_vec(mesh.vertices[t[i]]));
        sum += solid_angle(y[0], y[1], y[2], Vec::Zero());
        const Vec n = (y[1] - y[0]).cross(y[2] - y[0]).normalized();
        const double h = n.dot(y[0]), square = 1 - h * h;
        if (square <= 0) continue;
        double area = 0, angle = 0;
        const auto sector = [&](const Vec& p, const Vec& q) {
            const double turn = std::atan2(n.dot(p.cross(q)), (p - h * n).dot(q - h * n));
            area += 0.5 * square * turn;
            angle += turn * (1 - std::abs(h)) * (h < 0 ? -1 : 1);
        };
        for (size_t i = 0; i < 3; ++i) {
            const Vec &p = y[i], &q = y[(i + 1) % 3], e = q - p;
            const double a = e.dot(e), b = p.dot(e), discriminant = b * b - a * (p.dot(p) - 1);
            const double root = std::sqrt(std::max(discriminant, 0.0));
            const double first = std::clamp((-b - root) / a, 0.0, 1.0), last = std::clamp((-b + root) / a, 0.0, 1.0);
            const Vec s = p + first * e, u = p + last * e;
            sector(p, s);
            area += 0.5 * n.dot(s.cross(u));
            angle += solid_angle(h * n, s, u, Vec::Zero());
            sector(u, q);
        }
        sum += h * area - angle;
    }
    return sum / 3 * fit.factor.determinant();
}

// --- each configuration of the paper's Fig. 2 ---------------------------------------------------------------------

// How a triangle in the plane z = 1/2 lies to the circle that the unit sphere cuts out of it.
struct Configuration {
    const char* name;
    std::array<std::array<double, 2>, 3> corners;
    int corners_inside, crossings;
    bool circle_inside;
};
constexpr Configuration kConfigurations[] = {
    {"a: circle in the triangle", {{{-5, -4}, {5, -4}, {0, 6}}}, 0, 0, true},
    {"b: triangle in the circle", {{{-0.3, -0.2}, {0.4, -0.1}, {0, 0.5}}}, 3, 0, false},
    {"c: one edge across, both corners outside", {{{-3, 0.5}, {3, 0.5}, {0, 4}}}, 0, 2, false},
    {"d: one corner inside", {{{0, 0}, {3, 0.5}, {0.5, 3}}}, 1, 2, false},
    {"e: two corners inside", {{{-0.2, 0.1}, {0.4, -0.3}, {3, 3}}}, 2, 2, false},
    {"f: two edges across", {{{-2, 0}, {2, -0.4}, {2, 0.4}}}, 0, 4, false},
    {"g: one corner inside, the edge opposite across", {{{0, 0.6}, {-3, -0.3}, {3, -0.3}}}, 1, 4, false},
    {"h: three edges across", {{{-1.05, -0.6}, {1.05, -0.6}, {0, 1.2}}}, 0, 6, false},
    {"outside, though the plane is not", {{{2, -1}, {3, 0}, {2, 1}}}, 0, 0, false},
};

// The configuration's three figures as they are after rounding and mapping.
Configuration classify(const std::array<Vec, 3>& y) {
    Configuration found{"", {}, 0, 0, true};
    const Vec n = (y[1] - y[0]).cross(y[2] - y[0]).normalized();
    for (size_t i = 0; i < 3; ++i) {
        const Vec &p = y[i], e = y[(i + 1) % 3] - p;
        found.corners_inside += p.norm() < 1;
        const double a = e.dot(e), b = p.dot(e), discriminant = b * b - a * (p.dot(p) - 1);
        for (const double sign : {-1.0, 1.0})
            if (discriminant > 0) {
                const double t = (-b + sign * std::sqrt(discriminant)) / a;
                found.crossings += t > 0 && t < 1;
            }
        found.circle_inside = found.circle_inside && n.dot(p.cross(e)) > 0;
    }
    found.circle_inside = found.circle_inside && found.corners_inside == 0 && found.crossings == 0;
    return found;
}

// Integral over the triangle of f, a function with a kink where |y| = 1, by halving the sides there.
template <class F> double integrate(const Vec& a, const Vec& b, const Vec& c, int depth, F&& f) {
    const Vec center = (a + b + c) / 3, ab = 0.5 * (a + b), bc = 0.5 * (b + c), ca = 0.5 * (c + a);
    const double size = std::max({(a - b).norm(), (b - c).norm(), (c - a).norm()});
    if (depth == 0 || (size < 0.1 && std::abs(center.norm() - 1) > size)) {
        // Degree 5, seven points (Radon 1948).
        const double root = std::sqrt(15.0);
        double sum = 0.225 * f(center);
        for (const double s : {-root, root}) {
            const double inner = (6 - s) / 21, weight = (155 - s) / 1200;
            for (const auto& [u, v, w] : {std::tie(a, b, c), std::tie(b, c, a), std::tie(c, a, b)})
                sum += weight * f(inner * (u + v) + (1 - 2 * inner) * w);
        }
        return 0.5 * (b - a).cross(c - a).norm() * sum;
    }
    return integrate(a, ab, ca, depth - 1, f) + integrate(ab, b, bc, depth - 1, f) +
           integrate(ca, bc, c, depth - 1, f) + integrate(ab, bc, ca, depth - 1, f);
}

class Fig2 : public testing::TestWithParam<Configuration> {};

// The tetrahedron of the triangle and the ellipsoid's center isolates the triangle: its other faces lie in planes
// through the center. In the ball's coordinates its volume in the ball is the integral of h / |y|^3 * min(1, |y|)^3
// / 3.
TEST_P(Fig2, AgreesWithTheIntegralOverItsTriangle) {
    const Configuration& wanted = GetParam();
    Random random(1);
    for (int round = 0; round < 12; ++round) {
        const Vec axis = random_vec(random).normalized();
        const Mat turn = Eigen::AngleAxisd(3 * random.uniform(), axis).toRotationMatrix();
        const Fit fit = round == 0 ? Fit() : random_ellipsoid(random, Vec(1, -0.5, 0.25), 2);
        Mesh mesh;
        for (const auto& [u, v] : wanted.corners) {
            const Vec shaken = Vec(u, v, 0.5) + 0.03 * random_vec(random);
            mesh.vertices.push_back(to_vec3(fit.center + fit.factor * (turn * shaken)));
        }
        mesh.vertices.push_back(to_vec3(fit.center)); // exact in float
        mesh.triangles = {{0, 1, 2}, {0, 3, 1}, {1, 3, 2}, {2, 3, 0}};
        std::array<Vec, 3> y;
        for (size_t i = 0; i < 3; ++i) y[i] = fit.radial(to_vec(mesh.vertices[i]));
        const Configuration found = classify(y);
        ASSERT_EQ(found.corners_inside, wanted.corners_inside);
        ASSERT_EQ(found.crossings, wanted.crossings);
        ASSERT_EQ(found.circle_inside, wanted.circle_inside);

        const Vec normal = (y[1] - y[0]).cross(y[2] - y[0]).normalized();
        const double scale = fit.factor.determinant(), h = normal.dot(y[0]);
        const double integral = integrate(
            y[0], y[1], y[2], 9, [&](const Vec& at) { return h / 3 * std::min(1.0, 1 / std::pow(at.norm(), 3)); });
        ASSERT_GT(std::abs(integral), 1e-3);
        EXPECT_NEAR(inside(mesh, fit), scale * integral, 1e-6 * scale) << "round " << round;
        EXPECT_NEAR(inside(shapes::inverted(mesh), fit), -scale * integral, 1e-6 * scale) << "round " << round;
    }
}

INSTANTIATE_TEST_SUITE_P(Configurations, Fig2, testing::ValuesIn(kConfigurations), [](const auto& one) {
    return std::string(one.param.name).substr(0, 1) == "o" ? "outside" : std::string(1, one.param.name[0]);
});

// --- known bodies -------------------------------------------------------------------------------------------------

TEST(InsideVolume, OfAHugeBallIsTheMeshs) {
    for (const Mesh& mesh : {shapes::tetrahedron(), shapes::torus(1, 0.3f, 64, 32), shapes::icosphere(4)}) {
        const double exact = shapes::enclosed_volume(mesh);
        for (const double radius : {4.0, 100.0, 1e6})
            EXPECT_NEAR(inside(mesh, ball({0.1, -0.2, 0.3}, radius)), exact, 1e-12 * exact);
    }
}

TEST(InsideVolume, OfTetrahedraInsidePartlyInsideAndOutside) {
    const Mesh corner = shapes::tetrahedron();
    EXPECT_NEAR(inside(corner, ball({0.3, 0.3, 0.3}, 0.95)), 1.0 / 6, 1e-14);     // wholly in the ball
    EXPECT_NEAR(inside(corner, ball({0, 0, 0}, 0.5)), kBall / 64, 1e-14);         // an octant of the ball
    EXPECT_NEAR(inside(corner, ball({0.2, 0.2, 0.2}, 0.1)), kBall / 1000, 1e-14); // around the ball
    EXPECT_NEAR(inside(corner, ball({1, 1, 1}, 1.1)), 0, 1e-14);                  // out of reach
    EXPECT_NEAR(inside(corner, ball({-0.2, 0.1, 0.1}, 0.3)), reference(corner, ball({-0.2, 0.1, 0.1}, 0.3)), 1e-14);
    const Mesh big = shapes::moved(corner, {-0.5f, -0.5f, -0.5f}, 4);
    Random random(2);
    int partly = 0;
    for (int round = 0; round < 2000; ++round) {
        const Fit fit = random_ellipsoid(random, 2 * random_vec(random), 0.7);
        const double volume = inside(big, fit);
        EXPECT_NEAR(volume, reference(big, fit), 1e-12);
        partly += volume > 1e-3 && volume < fit.volume() - 1e-3;
    }
    EXPECT_GT(partly, 500);
}

// A ball of radius r around the center of the unit cube: less six caps, as long as they do not meet.
TEST(InsideVolume, OfACubeAroundABallThroughTangentPlanesEdgesAndCorners) {
    const Mesh cube = shapes::moved(shapes::box(), {-0.5f, -0.5f, -0.5f});
    const auto exact = [](double r) {
        const double cap = std::max(0.0, r - 0.5);
        return kBall * r * r * r - 6 * std::numbers::pi * cap * cap * (r - cap / 3);
    };
    for (const double r : {1e-9, 0.25, 0.5, 0.6, 0.7, std::sqrt(0.5)}) // 0.5: tangent to six planes; sqrt: to 12 edges
        EXPECT_NEAR(inside(cube, ball({0, 0, 0}, r)), exact(r), 1e-15 + 1e-14 * r);
    for (const double above : {1e-15, 1e-12, 1e-9, 1e-6, 1e-3}) { // the discs' radii tend to 0
        EXPECT_NEAR(inside(cube, ball({0, 0, 0}, 0.5 + above)), exact(0.5 + above), 1e-14);
        EXPECT_NEAR(inside(cube, ball({0, 0, 0}, 0.5 - above)), exact(0.5 - above), 1e-14);
        const double cap = std::numbers::pi * above * above * (0.5 + above - above / 3);
        EXPECT_NEAR(inside(cube, ball({0, 1, 0}, 0.5 + above)), cap, 1e-14);
    }
    EXPECT_NEAR(inside(cube, ball({0, 1, 0}, 0.5)), 0, 1e-14);             // tangent from outside
    EXPECT_NEAR(inside(cube, ball({0, 0, 0}, std::sqrt(0.75))), 1, 1e-14); // corners on the sphere
    EXPECT_NEAR(inside(cube, ball({0, 0, 0}, std::sqrt(0.75) * (1 - 1e-9))), 1, 1e-14);
}

TEST(InsideVolume, OfBallsCenteredOnFacesEdgesAndCorners) {
    const Mesh cube = shapes::box();
    for (const double r : {1e-6, 0.2, 0.4}) {
        const double whole = kBall * r * r * r, rounding = 1e-15 / r * whole;
        EXPECT_NEAR(inside(cube, ball({0.5, 0.5, 1}, r)), whole / 2, rounding); // on a diagonal of the face
        EXPECT_NEAR(inside(cube, ball({0.45, 0.55, 1}, r)), whole / 2, rounding);
        EXPECT_NEAR(inside(cube, ball({0.5, 1, 1}, r)), whole / 4, rounding);
        EXPECT_NEAR(inside(cube, ball({1, 1, 1}, r)), whole / 8, rounding);
        EXPECT_NEAR(inside(cube, ball({0, 0, 0}, r)), whole / 8, rounding);
    }
}

TEST(InsideVolume, IsContinuousThroughEveryCoincidence) {
    // Centers on corners and edges, and corners and edges on the surface: the value is that of a place close by.
    const Mesh mesh = shapes::icosphere(1);
    const Winding winding(mesh.view());
    Random random(3);
    for (int round = 0; round < 3000; ++round) {
        const Triangle& t = mesh.triangles[random.bits() % mesh.triangles.size()];
        const Vec a = to_vec(mesh.vertices[t[0]]), b = to_vec(mesh.vertices[t[1]]), c = to_vec(mesh.vertices[t[2]]);
        const Vec center = round % 3 == 0 ? a : round % 3 == 1 ? Vec(0.5 * (a + b)) : Vec((a + b + c) / 3);
        const Vec touched = to_vec(mesh.vertices[random.bits() % mesh.vertices.size()]);
        const double reach = (touched - center).norm(), radius = reach > 0 ? reach : 0.5;
        const EllipsoidVolume here = inside_volume(ball(center, radius), winding);
        const Vec step = 1e-9 * random_vec(random);
        const EllipsoidVolume there = inside_volume(ball(center + step, radius * (1 + step.x())), winding);
        ASSERT_NEAR(here.volume, there.volume, 1e-7);
        ASSERT_LT((here.d_center - there.d_center).norm(), 1e-4); // the gradient has roots in it near tangents
        ASSERT_LT((here.d_shape - there.d_shape).norm(), 1e-4);
        ASSERT_GT(here.volume, -1e-13);
        ASSERT_LT(here.volume, kBall * radius * radius * radius + 1e-13);
    }
}

TEST(InsideVolume, OfEllipsoidsFarSmallerThanATriangle) {
    const float side = 1 << 20;
    const Mesh cube = shapes::box(side, side, side);
    for (const double r : {1.0, 1e-2}) {
        const double whole = kBall * r * r * r, size = side / r;
        EXPECT_NEAR(inside(cube, ball({3e5, 7e5, side}, r)), whole / 2, 1e-15 * size * whole);
        EXPECT_NEAR(inside(cube, ball({3e5, side, side}, r)), whole / 4, 1e-15 * size * whole);
        EXPECT_NEAR(inside(cube, ball({5e5, 5e5, side}, r)), whole / 2, 1e-15 * size * whole); // on the diagonal
        EXPECT_NEAR(inside(cube, ball({3e5, 7e5, 5e5}, r)), whole, 1e-15 * size * whole);
        EXPECT_NEAR(inside(cube, ball({3e5, 7e5, side + 2.0}, r)), 0, 1e-15 * size * whole);
    }
}

TEST(InsideVolume, CountsOverlapsTwiceAndTurnsSignWithTheMesh) {
    Mesh two = shapes::box();
    shapes::append(two, shapes::moved(shapes::box(), {0.5f, 0.25f, 0.125f}));
    const Fit fit = ball({0.75, 0.6, 0.6}, 0.2); // in both
    EXPECT_NEAR(inside(two, fit), 2 * fit.volume(), 1e-14);
    EXPECT_NEAR(inside(shapes::inverted(two), fit), -2 * fit.volume(), 1e-14);
    EXPECT_NEAR(inside(two, ball({0.5, 0.5, 0.5}, 10)), 2, 1e-12);

    // Columns tell which meshes are so.
    const ColumnLattice lattice{-0.0123, -0.0123, 0.0101, 0.0101, 160, 160};
    const auto defect = [&](const Mesh& mesh) { return Columns(mesh.view(), true, nullptr, lattice).winding_defect(); };
    EXPECT_EQ(defect(shapes::box()), 0);
    EXPECT_NEAR(defect(shapes::inverted(shapes::box())), 2, 0.05);
    EXPECT_NEAR(defect(two), 0.5 * 0.75 * 0.875, 0.02); // of the overlap
    Mesh turned = shapes::box();
    shapes::append(turned, shapes::moved(shapes::inverted(shapes::box(0.5f, 0.5f, 0.5f)), {1.01f, 0, 0}));
    EXPECT_NEAR(defect(turned), 2 * 0.125, 0.02);
}

// --- against other ways -------------------------------------------------------------------------------------------

// By columns through the ellipsoid, which are exact along z.
double by_columns(const Mesh& mesh, const Winding& winding, const Fit& fit, int across) {
    const Vec half = fit.half_extents(), low = fit.center - half;
    const double dx = 2 * half.x() / across, dy = 2 * half.y() / across;
    const ColumnLattice lattice{low.x() + 0.5 * dx, low.y() + 0.5 * dy, dx, dy, across, across};
    const Columns columns(mesh.view(), true, &winding, lattice);
    double length = 0;
    for (int i = 0; i < across; ++i)
        for (int j = 0; j < across; ++j) {
            const Vec w = fit.radial({lattice.x0 + i * dx, lattice.y0 + j * dy, fit.center.z()}),
                      u = fit.inverse.col(2);
            const double uw = u.dot(w), uu = u.dot(u), discriminant = uw * uw - uu * (w.dot(w) - 1);
            if (discriminant <= 0) continue;
            const double root = std::sqrt(discriminant), middle = fit.center.z() - uw / uu;
            for (const Interval& s : columns.column(i, j))
                length += std::max(0.0, std::min(s.high, middle + root / uu) - std::max(s.low, middle - root / uu));
        }
    return length * dx * dy;
}

void expect_as_by_columns(Mesh mesh, uint64_t seed) {
    // Columns converge slowly along walls.
    const Mat turn = Eigen::AngleAxisd(1, Vec(1, 2, 3).normalized()).toRotationMatrix();
    for (Vec3& v : mesh.vertices) v = to_vec3(turn * to_vec(v));
    const Winding winding(mesh.view());
    Box box;
    for (const Vec3& v : mesh.vertices) box.add(to_vec(v));
    Random random(seed);
    for (const double radius : {0.02, 0.05, 0.1, 0.25}) {
        const Vec on_surface = to_vec(mesh.vertices[random.bits() % mesh.vertices.size()]);
        const double size = radius * box.size().norm();
        const Fit fit = random_ellipsoid(random, on_surface + 0.3 * size * random_vec(random), size);
        const double volume = inside_volume(fit, winding).volume;
        EXPECT_GT(volume, 0.01 * fit.volume()); // neither nothing nor all, or the test is void
        EXPECT_LT(volume, 0.99 * fit.volume());
        EXPECT_NEAR(volume, by_columns(mesh, winding, fit, 1500), 1e-6 * fit.volume());
        EXPECT_NEAR(volume, reference(mesh, fit), 1e-12 * fit.volume());
    }
}

TEST(InsideVolume, AgreesWithColumns) {
    expect_as_by_columns(shapes::torus(1, 0.3f, 64, 32), 4);
    expect_as_by_columns(shapes::icosphere(4), 5);
}

TEST(InsideVolume, AgreesWithColumnsOnRealMeshes) {
    const std::filesystem::path folder = std::filesystem::path(PROLATE_SOURCE_DIR) / "../shared/data";
    if (!std::filesystem::exists(folder)) GTEST_SKIP() << "no meshes in " << folder;
    for (const char* name : {"knight.obj", "homer.obj", "horse.obj"}) {
        SCOPED_TRACE(name);
        const auto loaded = load_mesh((folder / name).string().c_str());
        ASSERT_TRUE(loaded);
        const auto cleaned = clean(loaded->view());
        ASSERT_TRUE(cleaned);
        expect_as_by_columns(cleaned->mesh, 6);
    }
}

TEST(InsideVolume, IsThatOfTheReference) {
    const Mesh mesh = shapes::torus(1, 0.3f, 48, 24);
    const Winding winding(mesh.view());
    Random random(7);
    int partly = 0;
    for (int round = 0; round < 3000; ++round) {
        const double radius = 0.03 * std::pow(40.0, random.uniform());
        const Fit fit = random_ellipsoid(random, 1.3 * random_vec(random), radius);
        const double volume = inside_volume(fit, winding).volume;
        ASSERT_NEAR(volume, reference(mesh, fit), 1e-12 * fit.volume());
        partly += volume > 1e-3 * fit.volume() && volume < 0.999 * fit.volume();
    }
    EXPECT_GT(partly, 1000);
}

// --- laws ---------------------------------------------------------------------------------------------------------

// Coordinates in few bits, so that the maps below are exact in float.
Mesh on_a_grid(Mesh mesh) {
    for (Vec3& v : mesh.vertices)
        v = {std::round(v.x * 256) / 256, std::round(v.y * 256) / 256, std::round(v.z * 256) / 256};
    return mesh;
}

TEST(InsideVolume, IsInvariantUnderAffineMaps) {
    const Mesh mesh = on_a_grid(shapes::torus(1, 0.3f, 24, 12));
    const Winding winding(mesh.view());
    Random random(8);
    for (int round = 0; round < 300; ++round) {
        Mat map;
        do
            for (int i = 0; i < 9; ++i) map(i / 3, i % 3) = std::round(4 * random.symmetric());
        while (map.determinant() < 0.5);
        const Vec shift = (16 * random_vec(random)).array().round();
        Mesh mapped = mesh;
        for (Vec3& v : mapped.vertices) v = to_vec3(map * to_vec(v) + shift);
        const Fit fit = random_ellipsoid(random, 1.2 * random_vec(random), 0.4);
        const Mat factor = map * fit.factor, lower = (factor * factor.transpose()).llt().matrixL();
        const Fit image(map * fit.center + shift, lower);
        const EllipsoidVolume before = inside_volume(fit, winding);
        const EllipsoidVolume after = inside_volume(image, Winding(mapped.view()));
        const double scale = map.determinant() * fit.volume();
        ASSERT_NEAR(after.volume, map.determinant() * before.volume, 1e-11 * scale);
        // In the frame of L the gradients agree; the frames of map * L and of the image differ by a rotation.
        const Mat turn = lower.triangularView<Eigen::Lower>().solve(factor);
        ASSERT_LT((after.d_center - map.determinant() * turn * before.d_center).norm(), 1e-9 * scale);
        ASSERT_LT((after.d_shape - map.determinant() * turn * before.d_shape * turn.transpose()).norm(), 1e-9 * scale);
    }
}

Mesh subdivided(const Mesh& mesh) {
    Mesh finer{mesh.vertices, {}};
    for (const Triangle& t : mesh.triangles) {
        const auto base = static_cast<uint32_t>(finer.vertices.size());
        for (size_t i = 0; i < 3; ++i)
            finer.vertices.push_back(
                to_vec3(0.5 * (to_vec(mesh.vertices[t[i]]) + to_vec(mesh.vertices[t[(i + 1) % 3]]))));
        finer.triangles.insert(
            finer.triangles.end(),
            {{t[0], base, base + 2}, {t[1], base + 1, base}, {t[2], base + 2, base + 1}, {base, base + 1, base + 2}});
    }
    return finer;
}

TEST(InsideVolume, IsTheSameOfASubdividedMesh) {
    const Mesh mesh = on_a_grid(shapes::torus(1, 0.3f, 16, 8)), finer = subdivided(subdivided(mesh));
    const Winding winding(mesh.view()), finer_winding(finer.view());
    Random random(9);
    for (int round = 0; round < 500; ++round) {
        const Fit fit = random_ellipsoid(random, 1.2 * random_vec(random), 0.4);
        const EllipsoidVolume one = inside_volume(fit, winding), other = inside_volume(fit, finer_winding);
        ASSERT_NEAR(one.volume, other.volume, 1e-12 * fit.volume());
        ASSERT_LT((one.d_center - other.d_center).norm(), 1e-11 * fit.volume());
        ASSERT_LT((one.d_shape - other.d_shape).norm(), 1e-11 * fit.volume());
    }
}

TEST(InsideVolume, AddsUpOverTheSolid) {
    const Mesh lower = shapes::box(1, 1, 0.5f), upper = shapes::moved(lower, {0, 0, 0.5f}), whole = shapes::box();
    Random random(10);
    for (int round = 0; round < 300; ++round) {
        const Fit fit = random_ellipsoid(random, Vec(0.5, 0.5, 0.5) + 0.5 * random_vec(random), 0.4);
        ASSERT_NEAR(inside(lower, fit) + inside(upper, fit), inside(whole, fit), 1e-13);
    }
}

TEST(InsideVolume, GradientIsTheLimitOfDifferences) {
    Mesh mesh = shapes::torus(1, 0.3f, 48, 24);
    const Winding winding(mesh.view());
    Random random(11);
    constexpr double kStep = 1e-5;
    const auto slope = [&](const Fit& low, const Fit& high) {
        return (inside_volume(high, winding).volume - inside_volume(low, winding).volume) / (2 * kStep);
    };
    double largest = 0;
    for (int round = 0; round < 100; ++round) {
        const Fit fit = random_ellipsoid(random, random_vec(random).cwiseProduct(Vec(1.2, 1.2, 0.3)), 0.3);
        const EllipsoidVolume at = inside_volume(fit, winding);
        const double tolerance = 1e-6 * fit.volume();
        largest = std::max(largest, at.d_center.norm() / fit.volume());
        for (int i = 0; i < 3; ++i) {
            const Vec s = kStep * fit.factor.col(i);
            EXPECT_NEAR(at.d_center[i], slope({fit.center - s, fit.factor}, {fit.center + s, fit.factor}), tolerance);
            for (int j = 0; j <= i; ++j) {
                Mat g = Mat::Zero();
                g(i, j) = kStep;
                EXPECT_NEAR(at.d_shape(i, j),
                            slope({fit.center, fit.factor - fit.factor * g}, {fit.center, fit.factor + fit.factor * g}),
                            tolerance);
                // By the elements of the factor, as the header has it.
                Mat e = Mat::Zero();
                e(i, j) = kStep;
                EXPECT_NEAR((fit.inverse.transpose() * at.d_shape)(i, j),
                            slope({fit.center, fit.factor - e}, {fit.center, fit.factor + e}),
                            tolerance * fit.inverse.norm());
            }
        }
    }
    EXPECT_GT(largest, 0.1);
}

TEST(InsideVolume, GradientByThePapersParameters) {
    const Mesh mesh = shapes::torus(1, 0.3f, 48, 24);
    const Winding winding(mesh.view());
    Random random(12);
    constexpr double kStep = 1e-5;
    const auto ellipsoid = [](const Vec& center, const Mat& turn, const Vec& radii) {
        const Mat q = turn * radii.cwiseProduct(radii).asDiagonal() * turn.transpose();
        return Fit(center, q.llt().matrixL());
    };
    for (int round = 0; round < 30; ++round) {
        const Vec center = random_vec(random).cwiseProduct(Vec(1.2, 1.2, 0.3));
        const Mat turn = Eigen::AngleAxisd(3 * random.uniform(), random_vec(random).normalized()).toRotationMatrix();
        const Vec radii = Vec(0.2, 0.3, 0.5) + 0.1 * random_vec(random);
        const Fit fit = ellipsoid(center, turn, radii);
        const EllipsoidVolume at = inside_volume(fit, winding);
        const Mat inverse = radii.cwiseInverse().asDiagonal();
        const Mat b = inverse * turn.transpose() * fit.factor * at.d_shape * fit.factor.transpose() * turn * inverse;
        for (int k = 0; k < 3; ++k) {
            const int i = (k + 1) % 3, j = (k + 2) % 3;
            const auto slope = [&](const Fit& low, const Fit& high) {
                return (inside_volume(high, winding).volume - inside_volume(low, winding).volume) / (2 * kStep);
            };
            const Vec step = kStep * Vec::Unit(k);
            EXPECT_NEAR(b(k, k) / radii[k],
                        slope(ellipsoid(center, turn, radii - step), ellipsoid(center, turn, radii + step)), 1e-6);
            const auto turned = [&](double angle) {
                return ellipsoid(center, turn * Eigen::AngleAxisd(angle, Vec::Unit(k)).toRotationMatrix(), radii);
            };
            EXPECT_NEAR(b(i, j) * (radii[i] / radii[j] - radii[j] / radii[i]), slope(turned(-kStep), turned(kStep)),
                        1e-6);
        }
    }
}

TEST(OutsideVolume, IsTheRestWithItsGradient) {
    const Mesh mesh = shapes::torus(1, 0.3f, 48, 24);
    const Winding winding(mesh.view());
    Random random(13);
    const Fit fit = random_ellipsoid(random, Vec(1, 0, 0.2), 0.4);
    const auto at = [&](const Fit& f) { return outside_volume(f, inside_volume(f, winding)); };
    const EllipsoidVolume here = at(fit);
    EXPECT_NEAR(here.volume + inside_volume(fit, winding).volume, fit.volume(), 1e-15);
    Mat g = Mat::Zero();
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j <= i; ++j) g(i, j) = 1e-5 * random.symmetric();
    const Vec s = 1e-5 * random_vec(random);
    const Fit high(fit.center + fit.factor * s, fit.factor + fit.factor * g);
    const Fit low(fit.center - fit.factor * s, fit.factor - fit.factor * g);
    const double expected = 2 * (here.d_center.dot(s) + here.d_shape.cwiseProduct(g).sum());
    EXPECT_NEAR(at(high).volume - at(low).volume, expected, 1e-6 * std::abs(expected));
}

} // namespace
} // namespace prolate
