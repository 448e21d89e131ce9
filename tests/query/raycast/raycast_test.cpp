// Rays against leaves, in long double; rays against trees, against all their leaves; on every target.
#include "query/raycast/ray.hpp"
#include "tests/exact_scenes.hpp"
#include "tests/reference.hpp"
#include "tests/scenes.hpp"
#include "tests/shapes.hpp"
#include "tests/targets.hpp"

#include <prolate/raycast.hpp>
#include <prolate/tools.hpp>

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <memory>
#include <vector>

namespace prolate {
namespace {

using reference::along;
using reference::length;
using reference::Matrix;
using reference::Real;
using reference::vector;
using reference::Vector;
using reference::operator*;
using reference::operator-;
using scenes::Point;
using scenes::Random;

// A ray in a body's frame, not rounded.
struct TrueRay {
    Vector origin, direction;
    Real max_t;
};
TrueRay placed(const Ray& ray, const Pose& pose) {
    const Matrix back = reference::transposed(reference::rotation(pose.rotation));
    return {back * (vector(ray.origin) - vector(pose.translation)), back * vector(ray.direction), ray.max_t};
}

// First common point with a solid ellipsoid; infinite if none.
Real first(const TrueRay& ray, const Ellipsoid& e) {
    const Matrix to_ball = reference::inverse({{{e.l11, 0, 0}, {e.l21, e.l22, 0}, {e.l31, e.l32, e.l33}}});
    const Vector y = to_ball * (ray.origin - vector(e.center)), v = to_ball * ray.direction;
    const Real vv = reference::dot(v, v), nearest = -reference::dot(y, v) / vv;
    const Vector m = along(y, nearest, v);
    const Real inside = 1 - reference::dot(m, m);
    if (inside < 0) return HUGE_VALL;
    const Real half = std::sqrt(inside / vv);
    if (nearest + half < 0 || nearest - half > ray.max_t) return HUGE_VALL;
    return std::max(nearest - half, Real{0});
}

// First common point with a triangle; infinite if none, also for rays in its plane.
Real first(const TrueRay& ray, const reference::Corners& c) {
    const Vector n = reference::cross(c[1] - c[0], c[2] - c[0]);
    const Real slope = reference::dot(n, ray.direction);
    if (slope == 0) return HUGE_VALL;
    const Real t = reference::dot(n, c[0] - ray.origin) / slope;
    if (t < 0 || t > ray.max_t) return HUGE_VALL;
    for (size_t i = 0; i < 3; ++i) { // the ray's side of each edge, by the volume it spans with it
        const Vector edge = reference::cross(c[i] - ray.origin, c[(i + 1) % 3] - ray.origin);
        if (reference::dot(edge, ray.direction) * slope < 0) return HUGE_VALL;
    }
    return t;
}

query::PlacedRay place(const Ray& ray, const Pose& pose, const query::RayBound& bound, double distance = 0) {
    const query::RelativePose to_frame = query::relative_pose(pose, {ray.origin, {}});
    return query::place(ray, to_frame.rotation, to_frame.translation, to_frame.distance, bound, distance);
}
query::PlacedRay place(const Ray& ray, const Pose& pose, const query::PlacedEllipsoid& bound, double distance = 0) {
    return place(ray, pose, {bound.center, bound.size, bound.reach}, distance);
}

// ---- single leaves ----

struct Scales {
    const char* name;
    double size, offset, direction; // of the body, of its pose in sizes, length of the direction
};
constexpr Scales kScales[] = {{"plain", 1, 1, 1},
                              {"far", 1, 1e4, 1},
                              {"tiny", 1e-12, 10, 1e-12},
                              {"huge", 1e12, 10, 1e3},
                              {"long direction", 1, 1, 1e20},
                              {"short direction", 1, 1, 1e-20}};

// A ray of the world that passes the point `at` of the body within rounding, beginning `before` sizes before it.
Ray ray_through(Random& random, const Pose& pose, const Vector& at, const Vector& direction, const Scales& s) {
    const Matrix r = reference::rotation(pose.rotation);
    const Real k = 1 / length(direction);
    const Vector d = r * Vector{k * direction[0], k * direction[1], k * direction[2]}, p = r * at;
    const Real before = random.in(-0.5, 3) * s.size * random.log_in(1e-3, 1);
    Ray ray;
    const auto narrow = [](Real x) { return static_cast<float>(x); };
    const Vector o = along(along(vector(pose.translation), 1, p), -before, d);
    ray.origin = {narrow(o[0]), narrow(o[1]), narrow(o[2])};
    const Real m = s.direction * random.log_in(0.1, 10);
    ray.direction = {narrow(m * d[0]), narrow(m * d[1]), narrow(m * d[2])};
    if (random.below(3) == 0) ray.max_t = narrow(random.in(0, 3) * s.size / m);
    return ray;
}

struct Counts {
    int rays = 0, met = 0, missed = 0, wrong = 0, early = 0, late = 0;
};

Counts hunt_ellipsoids(uint64_t seed, int count, const Scales& s, double margin) {
    Random random(seed);
    Counts counts;
    for (int n = 0; n < count; ++n) {
        const Point radii = scenes::radii(random, random.log_in(2, 1000)), c = random.in_ball(),
                    away = random.direction();
        const Ellipsoid unit = scenes::ellipsoid(c, radii, random.rotation());
        const auto scaled = [&](float x) { return static_cast<float>(s.size * x); };
        const Ellipsoid e{{scaled(unit.center.x), scaled(unit.center.y), scaled(unit.center.z)},
                          scaled(unit.l11),
                          scaled(unit.l21),
                          scaled(unit.l22),
                          scaled(unit.l31),
                          scaled(unit.l32),
                          scaled(unit.l33)};
        const double far = s.size * s.offset;
        const Pose pose{scenes::to_float({far * away[0], far * away[1], far * away[2]}), random.rotation()};
        // Through a point off the surface, along a tangent, or nearly.
        const Matrix l{{{e.l11, 0, 0}, {e.l21, e.l22, 0}, {e.l31, e.l32, e.l33}}};
        const Point u = random.direction(), w = random.direction();
        const Vector in{u[0], u[1], u[2]}, tangent = reference::cross(in, {w[0], w[1], w[2]});
        const Real off = 1 + random.log_in(1e-12, 1) * (random.below(2) == 0 ? 1 : -1);
        const Real turn = random.below(2) == 0 ? 0 : random.in(-1, 1);
        const Vector at = along(vector(e.center), off, l * in), direction = l * along(tangent, turn, in);
        const Ray ray = ray_through(random, pose, at, direction, s);
        const query::PlacedEllipsoid body = query::place(e);
        const query::PlacedRay placed_ray = place(ray, pose, body);
        const Real truth = first(placed(ray, pose), e);
        const auto hit = placed_ray.empty ? std::nullopt : query::hit(placed_ray, body, margin);
        ++counts.rays, counts.met += std::isfinite(truth), counts.missed += !hit;
        counts.wrong += std::isfinite(truth) && !hit;
        if (!std::isfinite(truth) || !hit) continue;
        // Near a tangent the point of entry moves with the square root of the rounding.
        const Real speed = length(vector(ray.direction)), t = placed_ray.begin + hit->t;
        const Real slack = 1e-5L * s.size + 1e-11L * far;
        counts.early += (t - truth) * speed<-slack, counts.late += (t - truth) * speed> slack;
    }
    return counts;
}

// Rays given in doubles, so that tangents are closer to the surface than rounding is.
int missed_tangents(double margin) {
    Random random(4);
    int wrong = 0;
    for (int n = 0; n < 20'000; ++n) {
        const Ellipsoid e =
            scenes::ellipsoid(random.in_ball(), scenes::radii(random, random.log_in(1, 1000)), random.rotation());
        const Matrix l{{{e.l11, 0, 0}, {e.l21, e.l22, 0}, {e.l31, e.l32, e.l33}}};
        const Point u = random.direction(), w = random.direction();
        const Vector in{u[0], u[1], u[2]};
        const Vector direction = l * reference::cross(in, {w[0], w[1], w[2]});
        const Vector origin = along(along(vector(e.center), 1 - random.log_in(1e-17, 1e-13), l * in), -2, direction);
        query::PlacedRay ray{};
        ray.origin = {static_cast<double>(origin[0]), static_cast<double>(origin[1]), static_cast<double>(origin[2])};
        ray.direction = {static_cast<double>(direction[0]), static_cast<double>(direction[1]),
                         static_cast<double>(direction[2])};
        ray.length = 4, ray.valid = true;
        ray.reach = glm::length(ray.origin) + 4 * glm::length(ray.direction);
        const TrueRay exact{
            {ray.origin.x, ray.origin.y, ray.origin.z}, {ray.direction.x, ray.direction.y, ray.direction.z}, 4};
        wrong += std::isfinite(first(exact, e)) && !query::hit(ray, query::place(e), margin);
    }
    return wrong;
}

TEST(Ray, NeverMissesATangent) {
    EXPECT_EQ(missed_tangents(query::kSeparationMargin), 0);
    EXPECT_GT(missed_tangents(0), 100);
}

TEST(Ray, NeverMissesAnEllipsoidThatItMeets) {
    for (const Scales& s : kScales) {
        const Counts c = hunt_ellipsoids(1, 20'000, s, query::kSeparationMargin);
        EXPECT_EQ(c.wrong, 0) << s.name;
        EXPECT_EQ(c.early, 0) << s.name;
        EXPECT_EQ(c.late, 0) << s.name;
        EXPECT_GT(c.met, c.rays / 5) << s.name;
        EXPECT_GT(c.missed, c.rays / 5) << s.name;
    }
}

// Small integers: rays in planes, through edges and through vertices abound, and truth is exact.
TEST(Ray, MeetsTrianglesOfIntegersExactly) {
    using Int = int64_t;
    using IntPoint = std::array<Int, 3>;
    const auto minus = [](const IntPoint& a, const IntPoint& b) {
        return IntPoint{a[0] - b[0], a[1] - b[1], a[2] - b[2]};
    };
    const auto cross = [](const IntPoint& a, const IntPoint& b) {
        return IntPoint{a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
    };
    const auto dot = [](const IntPoint& a, const IntPoint& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; };
    Random random(2);
    int met = 0, missed = 0, in_plane = 0;
    for (int n = 0; n < 200'000; ++n) {
        const auto point = [&] {
            return IntPoint{Int{random.below(7)} - 3, Int{random.below(7)} - 3, Int{random.below(7)} - 3};
        };
        const IntPoint c[3] = {point(), point(), point()}, o = point(), d = point();
        if (d == IntPoint{}) continue;
        const IntPoint normal = cross(minus(c[1], c[0]), minus(c[2], c[0]));
        const Int slope = dot(normal, d), height = dot(normal, minus(c[0], o));
        // Truth: the first t as a fraction, or none.
        double truth = HUGE_VAL;
        if (slope != 0) {
            bool inside = true;
            for (size_t i = 0; i < 3; ++i)
                inside = inside && dot(cross(minus(c[i], o), minus(c[(i + 1) % 3], o)), d) * slope >= 0;
            if (inside && height * slope >= 0) truth = static_cast<double>(height) / static_cast<double>(slope);
        } else if (height == 0) { // in the plane, or a triangle without area: the edges
            const auto consider = [&](double t) {
                if (t >= 0) truth = std::min(truth, t);
            };
            bool before = false, after = false; // the origin may lie inside
            for (size_t i = 0; i < 3; ++i) {
                const IntPoint a = minus(c[i], o), e = minus(c[(i + 1) % 3], c[i]), ad = cross(a, d), ed = cross(e, d);
                // a + s e parallel to d: (a + s e) x d = 0
                const Int ee = dot(ed, ed);
                double s[2] = {0, 1};
                if (ee != 0) {
                    const Int up = -dot(ad, ed);
                    const IntPoint check{ad[0] * ee + up * ed[0], ad[1] * ee + up * ed[1], ad[2] * ee + up * ed[2]};
                    if (check != IntPoint{} || up < 0 || up > ee) continue;
                    s[0] = s[1] = static_cast<double>(up) / static_cast<double>(ee);
                } else if (ad != IntPoint{}) {
                    continue;
                }
                for (const double at : s) {
                    const double t = (static_cast<double>(dot(a, d)) + at * static_cast<double>(dot(e, d))) /
                                     static_cast<double>(dot(d, d));
                    consider(t), before = before || t <= 0, after = after || t >= 0;
                }
            }
            if (before && after) truth = 0;
            in_plane += std::isfinite(truth);
        }
        query::PlacedTriangle triangle{};
        for (size_t i = 0; i < 3; ++i) {
            triangle.corner[i] = {c[i][0], c[i][1], c[i][2]};
            triangle.reach = std::max(triangle.reach, glm::length(triangle.corner[i]));
        }
        const auto narrow = [](const IntPoint& p) {
            return Vec3{static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])};
        };
        query::PlacedEllipsoid bound = query::place(Ellipsoid{{}, 6, 0, 6, 0, 0, 6});
        const query::PlacedRay ray = place(Ray{narrow(o), narrow(d)}, Pose{}, bound);
        const auto hit = ray.empty ? std::nullopt : query::hit(ray, triangle);
        ASSERT_EQ(hit.has_value(), std::isfinite(truth)) << n;
        if (hit) {
            ASSERT_NEAR(ray.begin + hit->t, truth, 1e-11) << n;
        }
        ++(hit ? met : missed);
    }
    EXPECT_GT(met, 5'000);
    EXPECT_GT(missed, 5'000);
    EXPECT_GT(in_plane, 200);
}

Counts hunt_triangles(uint64_t seed, int count, const Scales& s, double margin) {
    Random random(seed);
    Counts counts;
    for (int n = 0; n < count; ++n) {
        Vec3 corner[3];
        const double sliver = random.below(2) == 0 ? 1 : random.log_in(1e-6, 1);
        const Point a = random.in_ball(), b = random.in_ball(), x = random.in_ball();
        for (size_t i = 0; i < 3; ++i) {
            const double t = i == 1 ? 1 : i == 2 ? 0.5 : 0, u = i == 2 ? sliver : 0;
            corner[i] = scenes::to_float({s.size * (a[0] + t * (b[0] - a[0]) + u * x[0]),
                                          s.size * (a[1] + t * (b[1] - a[1]) + u * x[1]),
                                          s.size * (a[2] + t * (b[2] - a[2]) + u * x[2])});
        }
        const Point away = random.direction(), aim = random.direction();
        const double far = s.size * s.offset;
        const Pose pose{scenes::to_float({far * away[0], far * away[1], far * away[2]}), random.rotation()};
        // Through an edge, a corner or the inside, or a little beside.
        Real w[3] = {random.unit(), random.unit(), random.unit()};
        if (const uint32_t k = random.below(4); k < 3)
            w[k] = random.log_in(1e-14, 1e-2) * (random.below(2) == 0 ? 1 : -1);
        if (random.below(4) == 0) w[random.below(3)] = 0;
        const Real sum = w[0] + w[1] + w[2];
        Vector at{};
        reference::Corners corners;
        query::PlacedTriangle triangle{};
        for (size_t i = 0; i < 3; ++i) {
            corners[i] = vector(corner[i]);
            at = along(at, w[i] / sum, corners[i]);
            triangle.corner[i] = {corner[i].x, corner[i].y, corner[i].z};
            triangle.reach = std::max(triangle.reach, glm::length(triangle.corner[i]));
        }
        const Ray ray = ray_through(random, pose, at, {aim[0], aim[1], aim[2]}, s);
        const auto r = static_cast<float>(2 * s.size);
        const query::PlacedRay placed_ray = place(ray, pose, query::place(Ellipsoid{{}, r, 0, r, 0, 0, r}));
        const TrueRay true_ray = placed(ray, pose);
        const Real truth = first(true_ray, corners);
        const auto hit = placed_ray.empty ? std::nullopt : query::hit(placed_ray, triangle, margin);
        ++counts.rays, counts.met += std::isfinite(truth), counts.missed += !hit;
        counts.wrong += std::isfinite(truth) && !hit;
        if (!hit) continue;
        // The hit is a point of both, to within rounding.
        const Vector p = along(true_ray.origin, placed_ray.begin + hit->t, true_ray.direction);
        const Real miss = reference::distance(corners, {p, p, p});
        counts.late += miss > 1e-5L * s.size + 1e-10L * far;
        // Falsely hit only what is nearer than rounding can tell.
        if (std::isfinite(truth)) continue;
        const Vector end = along(true_ray.origin, std::min<Real>(true_ray.max_t, placed_ray.begin + placed_ray.length),
                                 true_ray.direction);
        counts.early += reference::distance(corners, {true_ray.origin, end, end}) > 1e-11L * (s.size + far);
    }
    return counts;
}

TEST(Ray, NeverMissesATriangleThatItMeets) {
    for (const Scales& s : kScales) {
        const Counts c = hunt_triangles(3, 20'000, s, query::kRayMargin);
        EXPECT_EQ(c.wrong, 0) << s.name;
        EXPECT_EQ(c.early, 0) << s.name;
        EXPECT_EQ(c.late, 0) << s.name;
        EXPECT_GT(c.met, c.rays / 5) << s.name;
        EXPECT_GT(c.missed, c.rays / 5) << s.name;
    }
    EXPECT_GT(hunt_triangles(3, 20'000, kScales[0], -64 * query::kRayMargin).wrong, 0);
}

// ---- within a distance ----

Real distance_of(const Ellipsoid& e, const Vector& x) {
    reference::Pair pair({}, {}, e, {});
    pair.l1 = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}}, pair.r = vector(e.center) - x;
    return reference::projected(pair);
}
Real distance_of(const reference::Corners& c, const Vector& x) {
    return reference::distance(c, {x, x, x});
}

// A ray that passes `x`, a point `distance` + gap off the surface along the unit normal `n`, in the tangent plane or
// across; where it comes from there, the ray comes within `distance` if the gap is negative.
struct Passing {
    Ray ray;
    Real at;     // its parameter there
    bool beside; // in the tangent plane: it comes no nearer to the body than there
};
Passing passing(Random& random, const Vector& x, const Vector& n) {
    const Point w = random.direction();
    const Vector tangent = reference::cross(n, {w[0], w[1], w[2]});
    Passing out{};
    out.beside = random.below(2) == 0;
    const Vector d = along(tangent, out.beside ? 0 : random.in(-2, 2), n);
    const auto narrow = [](const Vector& v) {
        return Vec3{static_cast<float>(v[0]), static_cast<float>(v[1]), static_cast<float>(v[2])};
    };
    out.at = random.in(0, 2);
    out.ray.direction = narrow(d);
    out.ray.origin = narrow(along(x, -out.at, vector(out.ray.direction)));
    if (random.below(3) == 0) out.ray.max_t = static_cast<float>(random.in(0, 3));
    return out;
}

template <class Body, class Placed>
void hunt_within(Counts& c, Random& random, const Body& body, const Placed& leaf, const Vector& surface,
                 const Vector& n, double margin) {
    const double distance = random.log_in(1e-3, 3);
    const Real gap = random.log_in(1e-9, 1) * (random.below(2) == 0 ? 1 : -1);
    const Passing p = passing(random, along(surface, std::max<Real>(distance + gap, 0), n), n);
    const query::PlacedRay ray = place(p.ray, Pose{}, query::place(Ellipsoid{{}, 4, 0, 4, 0, 0, 4}), distance);
    const auto hit = ray.empty ? std::nullopt : query::hit_within(distance, ray, leaf, margin);
    const TrueRay exact = placed(p.ray, {});
    const auto off = [&](Real t) { return distance_of(body, along(exact.origin, t, exact.direction)) - distance; };
    const bool meets = p.at <= exact.max_t && off(p.at) < 0;
    ++c.rays, c.met += meets, c.missed += !hit, c.wrong += meets && !hit;
    // The rounded direction is not quite that of the tangent plane.
    c.early += hit && p.beside && gap > 1e-5;
    if (!hit) return;
    const Real t = ray.begin + hit->t, here = off(t);
    c.wrong += meets && t > p.at + 1e-9L;
    c.wrong += here > 1e-11L;
    if (t == 0) return;
    c.wrong += here < -1e-11L;
    c.late += glm::dot(hit->normal, ray.direction) > 1e-6; // where it leaves
}

Counts hunt_ellipsoids_within(uint64_t seed, int count, double ratio, double margin) {
    Random random(seed);
    Counts c;
    for (int k = 0; k < count; ++k) {
        const Ellipsoid e = scenes::ellipsoid(random.in_ball(), scenes::radii(random, ratio), random.rotation());
        const Matrix l{{{e.l11, 0, 0}, {e.l21, e.l22, 0}, {e.l31, e.l32, e.l33}}};
        const Point d = random.direction();
        const Vector n{d[0], d[1], d[2]}, m = reference::transposed(l) * n;
        const Real s = 1 / length(m);
        const Vector x = along(vector(e.center), 1, l * Vector{s * m[0], s * m[1], s * m[2]});
        hunt_within(c, random, e, query::place(e), x, n, margin);
    }
    return c;
}

Counts hunt_triangles_within(uint64_t seed, int count, double margin) {
    Random random(seed);
    Counts c;
    for (int k = 0; k < count; ++k) {
        query::PlacedTriangle triangle{};
        reference::Corners corners;
        const double sliver = random.below(2) == 0 ? 1 : random.log_in(1e-6, 1);
        const Point a = random.in_ball(), b = random.in_ball(), side = random.in_ball();
        for (size_t i = 0; i < 3; ++i) {
            const double t = i == 1 ? 1 : i == 2 ? 0.5 : 0, u = i == 2 ? sliver : 0;
            const Vec3 p =
                scenes::to_float({a[0] + t * (b[0] - a[0]) + u * side[0], a[1] + t * (b[1] - a[1]) + u * side[1],
                                  a[2] + t * (b[2] - a[2]) + u * side[2]});
            triangle.corner[i] = {p.x, p.y, p.z}, corners[i] = vector(p);
            triangle.reach = std::max(triangle.reach, glm::length(triangle.corner[i]));
        }
        // A face, an edge or a corner that looks along n.
        const Point d = random.direction();
        Vector n{d[0], d[1], d[2]}, x = corners[0];
        const uint32_t kind = random.below(3);
        if (kind == 0) n = reference::cross(corners[1] - x, corners[2] - x);
        if (kind == 1) n = reference::cross(corners[1] - x, n);
        if (kind == 1 && reference::dot(n, corners[2] - x) > 0) n = {-n[0], -n[1], -n[2]};
        for (size_t i = 1; i < 3; ++i)
            if (kind == 2 && reference::dot(n, corners[i] - x) > 0) x = corners[i];
        if (kind < 2) x = along(x, random.in(0, kind == 0 ? 0.5 : 1), corners[1] - corners[0]);
        if (kind == 0) x = along(x, random.in(0, 0.5), corners[2] - corners[0]);
        const Real s = 1 / length(n);
        hunt_within(c, random, corners, triangle, x, {s * n[0], s * n[1], s * n[2]}, margin);
    }
    return c;
}

void expect_good(const Counts& c, const char* what) {
    EXPECT_EQ(c.wrong, 0) << what;
    EXPECT_EQ(c.early, 0) << what;
    EXPECT_EQ(c.late, 0) << what;
    EXPECT_GT(c.met, c.rays / 5) << what;
    EXPECT_GT(c.missed, c.rays / 10) << what;
}

TEST(Ray, NeverMissesWhatItComesWithinADistanceOf) {
    expect_good(hunt_ellipsoids_within(11, 5'000, 3, query::kSeparationMargin), "round");
    expect_good(hunt_ellipsoids_within(11, 5'000, 1000, query::kSeparationMargin), "thin");
    expect_good(hunt_triangles_within(12, 20'000, query::kSeparationMargin), "triangles");
    EXPECT_GT(hunt_ellipsoids_within(11, 1'000, 3, -0x1p-25).wrong, 0);
    EXPECT_GT(hunt_triangles_within(12, 1'000, -0x1p-25).wrong, 0);
}

// ---- trees ----

QueryContext& context() {
    static const auto one = std::make_unique<QueryContext>();
    return *one;
}
RaycastResult cast(const TreeView& tree, const Pose& pose, const Ray& ray, const QueryOptions& options = {}) {
    return raycast(tree, pose, ray, context(), options);
}

// The first hit by all triangles with the shipped test.
struct Brute {
    bool met = false;
    double t = HUGE_VAL;
};
Brute brute_triangles(const TreeView& tree, const Pose& pose, const Ray& ray, double margin = 0) {
    Brute out;
    const query::PlacedRay placed_ray = place(ray, pose, query::ray_bound(tree), margin);
    if (placed_ray.empty) return out;
    for (uint32_t t = 0; t < tree.triangle_count(); ++t) {
        const auto triangle = query::place(tree, t);
        const auto hit =
            margin > 0 ? query::hit_within(margin, placed_ray, triangle) : query::hit(placed_ray, triangle);
        if (hit) out.met = true, out.t = std::min(out.t, placed_ray.begin + hit->t);
    }
    return out;
}

// A ray at the mesh from somewhere around: at a vertex, at the middle of an edge, or anywhere.
Ray aimed(Random& random, const Mesh& mesh, const Pose& pose, double size) {
    const Triangle t = mesh.triangles[random.below(static_cast<uint32_t>(mesh.triangles.size()))];
    const Vector a = vector(mesh.vertices[t[0]]), b = vector(mesh.vertices[t[1]]);
    Vector at = a;
    if (const uint32_t kind = random.below(3); kind == 1)
        at = along(a, 0.5L, b - a);
    else if (kind == 2)
        at = along(at, size * 0.3L, {random.in(-1, 1), random.in(-1, 1), random.in(-1, 1)});
    const Point d = random.direction();
    Scales s{"", size, 0, 1};
    return ray_through(random, pose, at, {d[0], d[1], d[2]}, s);
}

TEST(Raycast, ExactTreesAnswerAsAllTheirTrianglesDo) {
    const std::pair<Mesh, double> meshes[] = {{shapes::torus(1, 0.3f, 40, 16), 1.0},
                                              {shapes::box(4, 4, 4), 4.0},
                                              {shapes::sheet(2, 3, 12), 2.0},
                                              {shapes::moved(shapes::icosphere(3), {1e3f, 0, 0}), 1.0},
                                              {shapes::moved(shapes::torus(1, 0.4f, 30, 12), {}, 1e-20f), 1e-20},
                                              {shapes::moved(shapes::torus(1, 0.4f, 30, 12), {}, 1e10f), 1e10}};
    for (const auto& [mesh, size] : meshes) {
        const auto scene = scenes::exact_tree(mesh);
        const auto tree = *TreeView::open(scene.bytes);
        Random random(5);
        int met = 0, budgets = 0;
        const int count = 500;
        for (int n = 0; n < count; ++n) {
            const Pose pose = scenes::pose_at(random, n % 2 == 0 ? 0 : 100 * size);
            const Ray ray = aimed(random, scene.mesh, pose, size);
            QueryOptions options;
            if (n % 3 == 0) options.margin = static_cast<float>(size * random.log_in(1e-4, 0.3));
            const RaycastResult result = cast(tree, pose, ray, options);
            const Brute truth = brute_triangles(tree, pose, ray, options.margin);
            ASSERT_EQ(result.verdict, truth.met ? Verdict::overlapping : Verdict::separated) << n << ' ' << size;
            const RaycastResult any = raycast_any(tree, pose, ray, context(), options);
            ASSERT_EQ(any.verdict, result.verdict);
            met += truth.met;
            if (!truth.met) {
                ASSERT_EQ(result.clear, ray.max_t);
                continue;
            }
            // Of triangles that come within the margin at once, rounding may tell another first.
            const auto speed = static_cast<double>(length(vector(ray.direction)));
            ASSERT_NEAR(result.t, truth.t, options.margin > 0 ? 1e-9 * size / speed : 0) << n;
            ASSERT_EQ(result.clear, result.t);
            ASSERT_GE(any.t, result.t);
            ASSERT_LE(any.clear, result.t);
            ASSERT_LT(result.triangle, tree.triangle_count());
            ASSERT_NEAR(static_cast<double>(length(vector(result.normal))), 1, 1e-6);
            for (const uint64_t most : {0, 1, 5, 9, 17, 40, 60, 80}) {
                options.max_pair_tests = most;
                const RaycastResult some = cast(tree, pose, ray, options);
                ASSERT_NE(some.verdict, Verdict::separated);
                ASSERT_LE(some.stats.tests(), most);
                ASSERT_LE(some.clear, result.t * (1 + 1e-6));
                ASSERT_GE(some.t, result.t);
                budgets += some.verdict == Verdict::undecided && some.clear > 0;
                // A hit ends the search, also where leaves beside it were beyond the budget.
                const RaycastResult some_any = raycast_any(tree, pose, ray, context(), options);
                ASSERT_NE(some_any.verdict, Verdict::separated);
                ASSERT_LE(some_any.clear, result.t * (1 + 1e-6));
                ASSERT_GE(some_any.t, result.t);
            }
        }
        EXPECT_GT(met, count / 4) << size;
        EXPECT_LT(met, count * 9 / 10) << size;
        EXPECT_GT(budgets, 10) << size;
    }
}

// The ball that rays are cut down to has no room to spare at a cube's corners.
TEST(Raycast, CornersOnTheBoundAreMet) {
    const auto scene = scenes::exact_tree(shapes::moved(shapes::box(2, 2, 2), {-1, -1, -1}));
    const auto tree = *TreeView::open(scene.bytes), larger = *tree.scaled(3);
    for (const float x : {-1.0f, 1.0f})
        for (const float y : {-1.0f, 1.0f})
            for (const float z : {-1.0f, 1.0f}) {
                const Ray inwards{{5 * x, 5 * y, 5 * z}, {-x, -y, -z}}, outwards{{x / 4, y / 4, z / 4}, {x, y, z}};
                EXPECT_NEAR(cast(tree, {}, inwards).t, 4, 1e-12);
                EXPECT_NEAR(cast(tree, {}, outwards).t, 0.75, 1e-12);
                EXPECT_NEAR(cast(larger, {}, inwards).t, 2, 1e-12);
                EXPECT_NEAR(cast(larger, {}, outwards).t, 2.75, 1e-12);
            }
}

// With a scratch for many rays at once, and with one that suffices for one alone.
void expect_batch_as_single(const TreeView& tree, const Mesh& aim, const QueryOptions& options) {
    Random random(8);
    const float nan = std::numeric_limits<float>::quiet_NaN();
    const Pose pose = scenes::pose_at(random, 2);
    std::vector<Ray> rays;
    for (int n = 0; n < 300; ++n) rays.push_back(aimed(random, aim, pose, 1));
    rays[7].origin.x = nan, rays[9].direction = {0, 0, 0}, rays[11].max_t = -1;
    std::vector<std::byte> least(scratch_size(tree));
    for (const Scratch scratch : {Scratch(context()), Scratch(least)}) {
        std::vector<RaycastResult> out(rays.size() + 1);
        raycast(tree, pose, rays, out, scratch, options);
        for (size_t i = 0; i < rays.size(); ++i) {
            const RaycastResult single = cast(tree, pose, rays[i], options);
            ASSERT_EQ(out[i].verdict, single.verdict) << i;
            ASSERT_EQ(out[i].t, single.t);
            ASSERT_EQ(out[i].clear, single.clear);
            ASSERT_EQ(vector(out[i].point), vector(single.point));
            ASSERT_EQ(vector(out[i].normal), vector(single.normal));
            ASSERT_EQ(out[i].node, single.node);
            ASSERT_EQ(out[i].triangle, single.triangle);
            ASSERT_EQ(out[i].stats.tests(), single.stats.tests());
            ASSERT_EQ(out[i].stats.block_tests, single.stats.block_tests);
            ASSERT_EQ(out[i].stats.deepest_level, single.stats.deepest_level);
        }
        EXPECT_EQ(out[7].verdict, Verdict::undecided);
        EXPECT_EQ(out[11].verdict, Verdict::separated);
        EXPECT_EQ(out.back().t, RaycastResult{}.t); // only as many as there are rays
    }
}

TEST(Raycast, ABatchAnswersAsSingleRaysDo) {
    Random random(9);
    const auto scene = scenes::exact_tree(shapes::torus(1, 0.3f, 40, 16));
    const auto cloud = scenes::tree(random, scenes::cloud(random, 900), {.degree = 12, .stop_probability = 0.1});
    for (const auto& bytes : {scene.bytes, cloud.bytes})
        for (const float margin : {0.0f, 0.01f})
            for (const uint64_t budget : {uint64_t{40}, std::numeric_limits<uint64_t>::max()})
                for (const uint32_t level : {2u, kMaxLevels})
                    expect_batch_as_single(*TreeView::open(bytes), scene.mesh,
                                           {.max_level = level, .max_pair_tests = budget, .margin = margin});
}

// Beyond a float's reach nothing is culled, and the doubles say what they can.
TEST(Raycast, FromVeryFarNothingIsSaidToMiss) {
    const auto scene = scenes::exact_tree(shapes::torus(1, 0.3f, 40, 16));
    Random random(10);
    for (const float far : {1e8f, 1e13f, 1e18f, 1e25f, 1e30f})
        for (int i = 0; i < 20; ++i) {
            const auto d = random.direction();
            const Vec3 from = scenes::to_float({double{far} * d[0], double{far} * d[1], double{far} * d[2]});
            const RaycastResult r = cast(*TreeView::open(scene.bytes), {}, {from, {-from.x, -from.y, -from.z}});
            EXPECT_NE(r.verdict, far < 1e9f ? Verdict::undecided : Verdict::separated) << far;
        }
}

TEST(Raycast, ClosedMeshesHaveNoHoles) {
    // From inside, at vertices, edges and anywhere: every ray must meet something.
    const auto scene = scenes::exact_tree(shapes::icosphere(3));
    const auto tree = *TreeView::open(scene.bytes);
    Random random(6);
    for (int n = 0; n < 5'000; ++n) {
        const Pose pose = scenes::pose_at(random, n % 3 == 0 ? 1e4 : 1);
        const Triangle t = scene.mesh.triangles[random.below(static_cast<uint32_t>(scene.mesh.triangles.size()))];
        const Vector a = vector(scene.mesh.vertices[t[0]]), b = vector(scene.mesh.vertices[t[random.below(2)]]);
        const Matrix r = reference::rotation(pose.rotation);
        const Vector d = r * along(a, 0.5L, b - a);
        const Ray ray{pose.translation, {static_cast<float>(d[0]), static_cast<float>(d[1]), static_cast<float>(d[2])}};
        const RaycastResult result = cast(tree, pose, ray);
        ASSERT_EQ(result.verdict, Verdict::overlapping) << n;
        ASSERT_NEAR(result.t, 1, 1e-4);
        ASSERT_GT(reference::dot(vector(result.normal), d), 0.9); // outwards
    }
}

TEST(Raycast, ProxyTreesAnswerAsTheirLeavesDo) {
    Random random(7);
    int met = 0, missed = 0, sticking_out = 0;
    for (int scene_number = 0; scene_number < 10; ++scene_number) {
        const scenes::Scene scene =
            scenes::tree(random, scenes::cloud(random, 2'000), {.levels = 5, .stop_probability = 0.1});
        const auto tree = *TreeView::open(scene.bytes);
        for (int n = 0; n < 300; ++n) {
            const Pose pose = scenes::pose_at(random, 10);
            const Point p = random.in_ball(), d = random.direction();
            const Ray ray = ray_through(random, pose, {p[0], p[1], p[2]}, {d[0], d[1], d[2]}, kScales[0]);
            QueryOptions options;
            if (n % 3 == 0) options.margin = static_cast<float>(random.log_in(1e-3, 0.3));
            const RaycastResult result = cast(tree, pose, ray, options);
            ASSERT_NE(result.verdict, Verdict::undecided);
            // All leaves: what the ray may meet. And where it has met the ancestors of one, too: what it surely meets.
            const TrueRay true_ray = placed(ray, pose);
            const auto first_of = [&](const Ellipsoid& e) -> Real {
                if (options.margin == 0) return first(true_ray, e);
                const auto leaf = query::place(e);
                const query::PlacedRay near = place(ray, pose, leaf, options.margin);
                const auto hit = near.empty ? std::nullopt : query::hit_within(options.margin, near, leaf);
                return hit ? near.begin + hit->t : HUGE_VALL;
            };
            Real surely = HUGE_VALL, maybe = HUGE_VALL;
            std::vector<Real> from(tree.slot_count());
            tree.for_each_node([&](uint32_t node) {
                const Real t = first_of(tree.ellipsoid(node));
                from[node] = std::max(from[node], t);
                const ChildRange children = tree.children(node);
                for (uint32_t i = 0; i < children.count; ++i) from[children.first + i] = from[node];
                if (children.count > 0) return;
                maybe = std::min(maybe, t), surely = std::min(surely, from[node]);
            });
            sticking_out += surely != maybe;
            if (result.verdict == Verdict::separated) {
                ASSERT_FALSE(std::isfinite(surely)) << n;
                ++missed;
                continue;
            }
            ++met;
            ASSERT_TRUE(std::isfinite(maybe)) << n;
            ASSERT_LE(result.t, static_cast<double>(surely) + 1e-5) << n;
            ASSERT_GE(result.t, static_cast<double>(maybe) - 1e-5) << n;
            ASSERT_EQ(result.triangle, kNoTriangle);
            ASSERT_TRUE(tree.is_leaf(result.node));
            for (uint32_t level = 0; level < 6; ++level) {
                options.max_level = level;
                const RaycastResult shallow = cast(tree, pose, ray, options);
                ASSERT_EQ(shallow.verdict, Verdict::overlapping) << "a shallow miss must be a miss at every level";
                ASSERT_LE(shallow.stats.deepest_level, level);
            }
        }
    }
    EXPECT_GT(met, 500);
    EXPECT_GT(missed, 500);
    EXPECT_GT(sticking_out, 0);
}

TEST(Raycast, CutsAreMetWhole) {
    Random random(13);
    int met = 0, missed = 0, cut_off = 0;
    std::vector<scenes::Scene> scenes;
    for (int i = 0; i < 4; ++i)
        scenes.push_back(scenes::tree(random, scenes::cloud(random, 2'000), {.levels = 4, .stop_probability = 0.1}));
    const auto exact = scenes::exact_tree(shapes::torus(0.7f, 0.3f, 20, 10));
    std::vector<TreeView> trees{*TreeView::open(exact.bytes)};
    for (const auto& scene : scenes) trees.push_back(*TreeView::open(scene.bytes));
    for (const TreeView& tree : trees) {
        std::vector<float> growth(tree.slot_count());
        node_growth(tree, growth);
        for (int n = 0; n < 300; ++n) {
            const Pose pose = scenes::pose_at(random, 10);
            const Point p = random.in_ball(), d = random.direction();
            const Ray ray = ray_through(random, pose, {p[0], p[1], p[2]}, {d[0], d[1], d[2]}, kScales[0]);
            const TrueRay true_ray = placed(ray, pose);
            for (uint32_t level = 0; level < tree.level_count(); ++level) {
                Real truth = HUGE_VALL;
                tree.for_each_in_cut(
                    level, [&](uint32_t node) { truth = std::min(truth, first(true_ray, tree.ellipsoid(node))); });
                const QueryOptions options{.max_level = level};
                const RaycastResult result = raycast_cut(tree, pose, ray, growth, context(), options);
                ASSERT_EQ(result.verdict == Verdict::overlapping, std::isfinite(truth)) << n << ' ' << level;
                ++(std::isfinite(truth) ? met : missed);
                const RaycastResult any = raycast_cut_any(tree, pose, ray, growth, context(), options);
                ASSERT_EQ(any.verdict, result.verdict);
                ASSERT_LE(any.stats.pair_tests, result.stats.pair_tests);
                if (!std::isfinite(truth)) continue;
                ASSERT_GE(any.t, result.t);
                ASSERT_NEAR(result.t, static_cast<double>(truth), 1e-5);
                ASSERT_EQ(result.triangle, kNoTriangle);
                cut_off += !(cast(tree, pose, ray, options).t <= result.t * (1 + 1e-5));
            }
        }
    }
    EXPECT_GT(met, 1'000);
    EXPECT_GT(missed, 1'000);
    EXPECT_GT(cut_off, 10); // raycast() need not meet what sticks out
}

TEST(Raycast, GrownNodesHoldAllBelowThemAndNoMore) {
    Random random(14);
    const auto scene = scenes::tree(random, scenes::cloud(random, 1'000), {.levels = 3});
    const auto tree = *TreeView::open(scene.bytes);
    std::vector<float> growth(tree.slot_count());
    node_growth(tree, growth);
    int larger = 0;
    tree.for_each_node([&](uint32_t node) {
        const Ellipsoid outer = tree.ellipsoid(node);
        double most = 1; // of points of those below, seen from the node
        std::vector<uint32_t> open{node};
        while (!open.empty()) {
            const ChildRange children = tree.children(open.back());
            open.pop_back();
            for (uint32_t below = children.first; below < children.first + children.count; ++below) {
                open.push_back(below);
                const Ellipsoid e = tree.ellipsoid(below);
                const Matrix l{{{e.l11, 0, 0}, {e.l21, e.l22, 0}, {e.l31, e.l32, e.l33}}};
                for (int k = 0; k < 300; ++k) {
                    const Point u = random.direction();
                    const Vector x = along(vector(e.center), 1, l * Vector{u[0], u[1], u[2]});
                    const double point[] = {static_cast<double>(x[0]), static_cast<double>(x[1]),
                                            static_cast<double>(x[2])};
                    most = std::max(most, std::sqrt(radial_squared(outer, point)));
                }
            }
        }
        ASSERT_LE(most, growth[node]);
        ASSERT_GE(most, 0.95 * growth[node]);
        larger += growth[node] > 1.01f;
    });
    EXPECT_GT(larger, 5);
}

TEST(Raycast, InsideAnEllipsoidIsAHitAtOnce) {
    Random random(8);
    const scenes::Scene scene = scenes::tree(random, scenes::cloud(random, 500), {.levels = 3});
    const auto tree = *TreeView::open(scene.bytes);
    uint32_t leaf = 0;
    tree.for_each_node([&](uint32_t node) {
        if (tree.is_leaf(node)) leaf = node;
    });
    const RaycastResult result = cast(tree, {}, {tree.ellipsoid(leaf).center, {0, 3, 0}});
    EXPECT_EQ(result.verdict, Verdict::overlapping);
    EXPECT_EQ(result.t, 0);
    EXPECT_EQ(result.normal, (Vec3{0, -1, 0}));
    const RaycastResult near = cast(tree, {}, {tree.ellipsoid(leaf).center, {0, 3, 0}}, {.margin = 0.1f});
    EXPECT_EQ(near.t, 0);
    EXPECT_EQ(near.normal, (Vec3{0, -1, 0}));
}

TEST(Raycast, ABallThatRollsOnAFace) {
    const auto scene = scenes::exact_tree(shapes::box(2, 2, 2));
    const auto tree = *TreeView::open(scene.bytes);
    const auto ball = [&](const Vec3& origin, const Vec3& direction, float radius) {
        return cast(tree, {}, {origin, direction}, {.margin = radius});
    };
    EXPECT_NEAR(ball({1, 1, 5}, {0, 0, -1}, 0.5f).t, 2.5, 1e-12);
    EXPECT_EQ(ball({1, 1, 5}, {0, 0, -1}, 0.5f).normal, (Vec3{0, 0, 1}));
    EXPECT_NEAR(ball({-3, 1, 2.4f}, {1, 0, 0}, 0.5f).t, 3 - 0.3, 1e-6); // at the edge: 0.4 above it
    EXPECT_NEAR(ball({-3, 1, 2.4f}, {1, 0, 0}, 0.5f).normal.z, 0.8, 1e-6);
    EXPECT_EQ(ball({-3, 1, 2.5f}, {1, 0, 0}, 0.5f).verdict, Verdict::overlapping); // touching
    EXPECT_EQ(ball({-3, 1, 2.500001f}, {1, 0, 0}, 0.5f).verdict, Verdict::separated);
    EXPECT_EQ(ball({1, 1, 2.25f}, {1, 0, 0}, 0.5f).t, 0);
}

// Needles, whose areas are rounding alone: which of their edges is nearest shows only from the edges themselves.
TEST(Raycast, ABallMeetsNeedlesWhereItIsNear) {
    Random random(15);
    Mesh mesh;
    for (uint32_t i = 0; i < 200; ++i) {
        const Point a = random.in_ball(), b = random.in_ball(), off = random.in_ball();
        const double at = i % 2 == 0 ? 0.5 : random.below(2), width = i % 5 == 0 ? 0 : random.log_in(1e-9, 1e-6);
        Point c{};
        for (size_t k = 0; k < 3; ++k) c[k] = a[k] + at * (b[k] - a[k]) + width * off[k];
        for (const Point& p : {a, b, c}) mesh.vertices.push_back(scenes::to_float(p));
        mesh.triangles.push_back({3 * i + i % 3, 3 * i + (i + 1) % 3, 3 * i + (i + 2) % 3}); // any two may be the same
    }
    const auto scene = scenes::exact_tree(mesh, {.closed = false});
    const auto tree = *TreeView::open(scene.bytes);
    int met = 0, missed = 0;
    for (int n = 0; n < 3'000; ++n) {
        const Point from = random.direction(), to = random.in_ball();
        const Ray ray{scenes::to_float({2 * from[0], 2 * from[1], 2 * from[2]}),
                      scenes::to_float({to[0] - 2 * from[0], to[1] - 2 * from[1], to[2] - 2 * from[2]})};
        const auto margin = static_cast<float>(random.log_in(1e-4, 0.1));
        const RaycastResult result = cast(tree, {}, ray, {.margin = margin});
        ++(result.verdict == Verdict::overlapping ? met : missed);
        if (result.verdict != Verdict::overlapping) continue;
        const Vector x = along(vector(ray.origin), result.t, vector(ray.direction));
        Real nearest = HUGE_VALL;
        for (const Vec3& v : scene.mesh.vertices) nearest = std::min(nearest, length(x - vector(v)));
        for (const Triangle& t : scene.mesh.triangles)
            for (size_t i = 0; i < 3; ++i) {
                const Vector a = vector(scene.mesh.vertices[t[i]]),
                             edge = vector(scene.mesh.vertices[t[(i + 1) % 3]]) - a;
                const Real s = reference::dot(x - a, edge) / reference::dot(edge, edge);
                if (s > 0 && s < 1) nearest = std::min(nearest, length(x - along(a, s, edge)));
            }
        ASSERT_NEAR(static_cast<double>(nearest), margin, 1e-5) << n;
    }
    EXPECT_GT(met, 500);
    EXPECT_GT(missed, 200);
}

TEST(Raycast, BadInputIsUndecided) {
    const auto scene = scenes::exact_tree(shapes::box());
    const auto tree = *TreeView::open(scene.bytes);
    const float nan = std::numeric_limits<float>::quiet_NaN(), infinity = std::numeric_limits<float>::infinity();
    for (const float max_t : {5.0f, infinity}) { // wherever a ray without a direction begins
        EXPECT_EQ(cast(tree, {}, {{0, 0, -1}, {0, 0, 0}, max_t}).verdict, Verdict::undecided);
        EXPECT_EQ(cast(tree, {}, {{0.5f, 0.5f, 0}, {0, 0, 0}, max_t}).verdict, Verdict::undecided);
    }
    EXPECT_EQ(cast(tree, {}, {{nan, 0, -1}, {0, 0, 1}}).verdict, Verdict::undecided);
    EXPECT_EQ(cast(tree, {}, {{0, 0, -1}, {0, infinity, 1}}).verdict, Verdict::undecided);
    EXPECT_EQ(cast(tree, {}, {{0, 0, -1}, {0, 0, 1}, nan}).verdict, Verdict::undecided);
    EXPECT_EQ(cast(tree, {{}, {0, 0, 0, 0}}, {{0, 0, -1}, {0, 0, 1}}).verdict, Verdict::undecided);
    for (const float bad : {nan, infinity, -infinity}) // also of a ray that ends
        for (const float max_t : {5.0f, infinity}) {
            EXPECT_EQ(cast(tree, {}, {{0, bad, -1}, {0, 0, 1}, max_t}).verdict, Verdict::undecided);
            EXPECT_EQ(cast(tree, {{0, bad, 0}, {}}, {{0, 0, -1}, {0, 0, 1}, max_t}).verdict, Verdict::undecided);
            EXPECT_EQ(cast(tree, {{}, {0, bad, 0, 1}}, {{0, 0, -1}, {0, 0, 1}, max_t}).verdict, Verdict::undecided);
        }
    EXPECT_EQ(cast(tree, {}, {{0.5f, 0.5f, -1}, {0, 0, 1}, -1}).verdict, Verdict::separated);
    EXPECT_EQ(cast(tree, {}, {{0.5f, 0.5f, -1}, {0, 0, 1}, 0.5f}).verdict, Verdict::separated);
    EXPECT_EQ(cast(tree, {}, {{0.5f, 0.5f, -1}, {0, 0, 1}, 1}).verdict, Verdict::overlapping);
    EXPECT_EQ(cast(tree, {}, {{0.5f, 0.5f, -1}, {0, 0, 1}}).t, 1);
    EXPECT_EQ(cast(tree, {}, {{0.5f, 0.5f, 1}, {0, 0, 1}, 0}).t, 0); // on the surface, no length
}

TEST(Raycast, SameBitsOnEveryTarget) {
    const auto scene = scenes::exact_tree(shapes::torus(1, 0.3f, 60, 24), {.degree = 20});
    const auto tree = *TreeView::open(scene.bytes);
    std::vector<float> growth(tree.slot_count());
    node_growth(tree, growth);
    std::vector<uint64_t> expected;
    targets::for_each([&](const char* name) {
        Random random(9);
        std::vector<uint64_t> bits;
        for (int n = 0; n < 300; ++n) {
            const Pose pose = scenes::pose_at(random, 1);
            const Ray ray = aimed(random, scene.mesh, pose, 1);
            const QueryOptions options{.max_level = n % 5 == 0 ? 2 : kMaxLevels, .margin = n % 3 == 0 ? 0.1f : 0.0f};
            const RaycastResult r =
                n % 2 == 0 ? cast(tree, pose, ray, options) : raycast_cut(tree, pose, ray, growth, context(), options);
            bits.insert(bits.end(), {std::bit_cast<uint64_t>(r.t), r.triangle, r.node, r.stats.pair_tests,
                                     r.stats.block_tests, r.stats.triangle_tests, r.stats.deepest_level});
        }
        if (expected.empty()) expected = bits;
        EXPECT_EQ(bits, expected) << name;
    });
}

TEST(Raycast, NodesThatDoNotEncloseAreNoticed) {
    const auto scene = scenes::exact_tree(shapes::torus(1, 0.3f, 40, 16), {.shrink = 0.7});
    const auto tree = *TreeView::open(scene.bytes);
    Random random(10);
    int wrong = 0;
    for (int n = 0; n < 500; ++n) {
        const Ray ray = aimed(random, scene.mesh, {}, 1);
        const RaycastResult result = cast(tree, {}, ray);
        const Brute truth = brute_triangles(tree, {}, ray);
        wrong += result.t != truth.t;
    }
    EXPECT_GT(wrong, 20);
}

} // namespace
} // namespace prolate
