#include "query/shapes/rounded_box.hpp"

#include "query/ellipsoid/placed.hpp"
#include "query/node/limits.hpp"

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

namespace prolate::query {
namespace {

using glm::dmat3;
using glm::dvec3;

constexpr uint32_t kMaxSteps = 64;
/// A step that gains less than this share of |v|^2 is the last.
constexpr double kSmallestGain = 0x1p-50;
/// Nearer than this share of S, the origin counts as held.
constexpr double kNearest = 0x1p-50;

// Any orthonormal columns, the first of them along `x`.
dmat3 frame_along(const dvec3& x) {
    const double length = glm::length(x);
    if (length == 0) return dmat3(1);
    const dvec3 u = x / length;
    const dvec3 across = std::abs(u.x) < 0.6 ? dvec3(1, 0, 0) : dvec3(0, 1, 0);
    const dvec3 v = glm::normalize(glm::cross(u, across));
    return {u, v, glm::cross(u, v)};
}

// The vertices of a simplex, and the point of it that is nearest to the origin.
struct Simplex {
    dvec3 vertices[4];
    size_t count = 0;
};
struct Nearest {
    dvec3 point;
    double square = std::numeric_limits<double>::infinity();
    Simplex face; ///< the least one that the point lies in
};

void consider(Nearest& best, const dvec3& point, std::initializer_list<dvec3> face) {
    const double square = glm::dot(point, point);
    if (!(square < best.square)) return;
    best.point = point, best.square = square, best.face.count = 0;
    for (const dvec3& v : face) best.face.vertices[best.face.count++] = v;
}

void nearest_on_edge(Nearest& best, const dvec3& a, const dvec3& b) {
    const dvec3 ab = b - a;
    const double t = -glm::dot(a, ab), square = glm::dot(ab, ab);
    if (!(t > 0)) return consider(best, a, {a});
    if (!(t < square)) return consider(best, b, {b});
    consider(best, a + (t / square) * ab, {a, b});
}

void nearest_on_triangle(Nearest& best, const dvec3& a, const dvec3& b, const dvec3& c) {
    const dvec3 n = glm::cross(b - a, c - a);
    const double square = glm::dot(n, n);
    const auto within = [&](const dvec3& p, const dvec3& q) { return glm::dot(n, glm::cross(p, q)) > 0; };
    if (square > 0 && within(a, b) && within(b, c) && within(c, a))
        return consider(best, (glm::dot(n, a) / square) * n, {a, b, c});
    nearest_on_edge(best, a, b), nearest_on_edge(best, b, c), nearest_on_edge(best, c, a);
}

// Does the tetrahedron hold the origin?
bool holds_origin(const dvec3& a, const dvec3& b, const dvec3& c, const dvec3& d) {
    const auto same_side = [](const dvec3& p, const dvec3& q, const dvec3& r, const dvec3& opposite) {
        const dvec3 n = glm::cross(q - p, r - p);
        return glm::dot(n, p) * glm::dot(n, opposite - p) < 0;
    };
    return same_side(a, b, c, d) && same_side(b, c, d, a) && same_side(c, d, a, b) && same_side(d, a, b, c);
}

Nearest nearest_of(const Simplex& s) {
    const auto& v = s.vertices;
    Nearest best;
    switch (s.count) {
    case 1:
        consider(best, v[0], {v[0]});
        break;
    case 2:
        nearest_on_edge(best, v[0], v[1]);
        break;
    case 3:
        nearest_on_triangle(best, v[0], v[1], v[2]);
        break;
    default:
        if (holds_origin(v[0], v[1], v[2], v[3])) {
            best.point = dvec3(0), best.square = 0;
            break;
        }
        nearest_on_triangle(best, v[0], v[1], v[2]), nearest_on_triangle(best, v[0], v[1], v[3]);
        nearest_on_triangle(best, v[0], v[2], v[3]), nearest_on_triangle(best, v[1], v[2], v[3]);
    }
    return best;
}

// The point of the box, seen from its center, that is farthest along n.
dvec3 corner(const RoundedBox& box, const dvec3& n) {
    dvec3 out(0);
    for (glm::length_t i = 0; i < 3; ++i)
        out += (glm::dot(n, box.axes[i]) < 0 ? -box.half[i] : box.half[i]) * box.axes[i];
    return out;
}
// And how far that is.
double width(const RoundedBox& box, const dvec3& n) {
    double out = 0;
    for (glm::length_t i = 0; i < 3; ++i) out += std::abs(glm::dot(n, box.axes[i] * box.half[i]));
    return out;
}

// Bodies as the search sees them, from the box's center: a point, how far the body begins along n, and where.
struct TriangleBody {
    dvec3 corners[3];
    double reach;
    TriangleBody(const PlacedTriangle& t, const dvec3& origin) : reach(t.reach) {
        for (size_t i = 0; i < 3; ++i) corners[i] = t.corner[i] - origin;
    }
    dvec3 middle() const { return corners[0]; }
    double begin(const dvec3& n) const {
        return std::min({glm::dot(n, corners[0]), glm::dot(n, corners[1]), glm::dot(n, corners[2])});
    }
    dvec3 first(const dvec3& n) const {
        const double h[3] = {glm::dot(n, corners[0]), glm::dot(n, corners[1]), glm::dot(n, corners[2])};
        return corners[std::min_element(h, h + 3) - h];
    }
};
struct EllipsoidBody {
    dvec3 center;
    const dmat3& factor;
    double reach;
    EllipsoidBody(const PlacedEllipsoid& e, const dvec3& origin)
        : center(e.center - origin), factor(e.factor), reach(e.reach) {}
    dvec3 middle() const { return center; }
    double begin(const dvec3& n) const { return glm::dot(n, center) - glm::length(n * factor); }
    dvec3 first(const dvec3& n) const {
        const dvec3 m = n * factor;
        return center - factor * (m / glm::length(m));
    }
};

// (1) of the header, for a unit vector.
template <class Convex> bool separates(const dvec3& n, const Convex& body, const RoundedBox& box, double margin) {
    return body.begin(n) - width(box, n) - box.radius > margin * (body.reach + box.reach);
}

enum class Outcome : uint8_t { separated, meet, unresolved };

template <class Convex> Outcome gjk(const Convex& body, const RoundedBox& box, double margin) {
    const double scale = body.reach + box.reach;
    Simplex simplex;
    dvec3 v = body.middle();
    for (uint32_t step = 0; step < kMaxSteps; ++step) {
        const double length = glm::length(v);
        if (!(length > kNearest * scale)) return step == 0 ? Outcome::meet : Outcome::unresolved;
        const dvec3 n = v / length;
        if (separates(n, body, box, margin)) return Outcome::separated;
        if (step > 0 && length <= box.radius) return Outcome::meet;
        const dvec3 w = body.first(n) - corner(box, n);
        if (step > 0 && !(glm::dot(v, v - w) > kSmallestGain * length * length)) return Outcome::unresolved;
        simplex.vertices[simplex.count++] = w;
        const Nearest nearest = nearest_of(simplex);
        if (nearest.square == 0) return nearest.face.count == 0 ? Outcome::meet : Outcome::unresolved;
        if (step > 0 && !(nearest.square < length * length)) return Outcome::unresolved;
        v = nearest.point, simplex = nearest.face;
    }
    return Outcome::unresolved;
}

// Directions that do not lose digits when the bodies nearly touch: the normals of faces, and the products of edges.
bool separated_by_features(const PlacedTriangle& triangle, const RoundedBox& box, double margin) {
    const TriangleBody body(triangle, box.center);
    const auto either = [&](const dvec3& direction) {
        const double length = glm::length(direction);
        if (!(length > 0)) return false;
        const dvec3 n = direction / length;
        return separates(n, body, box, margin) || separates(-n, body, box, margin);
    };
    const auto& c = triangle.corner;
    const dvec3 edges[3] = {c[1] - c[0], c[2] - c[1], c[0] - c[2]}, normal = glm::cross(edges[0], edges[1]);
    if (either(normal)) return true;
    for (glm::length_t i = 0; i < 3; ++i) {
        if (either(box.axes[i])) return true;
        for (const dvec3& edge : edges)
            if (either(glm::cross(edge, box.axes[i]))) return true;
    }
    return false;
}

} // namespace

RoundedBox place(const Sphere& sphere, const Pose& pose, double margin) noexcept {
    const RelativePose to_frame = relative_pose(pose, {sphere.center, {}});
    const double radius = sound_length(double{sphere.radius}) + margin;
    return {to_frame.translation, dmat3(1), dvec3(0), radius, to_frame.distance + radius};
}

RoundedBox place(const Capsule& capsule, const Pose& pose, double margin) noexcept {
    const RelativePose to_frame = relative_pose(pose, {capsule.a, {}});
    const dvec3 half = to_frame.rotation * (0.5 * (to_double(capsule.b) - to_double(capsule.a)));
    const double radius = sound_length(double{capsule.radius}) + margin, length = glm::length(half);
    return {to_frame.translation + half,
            frame_along(half),
            {length, 0, 0},
            radius,
            to_frame.distance + 2 * length + radius};
}

RoundedBox place(const Box& box, const Pose& pose, double margin) noexcept {
    const RelativePose to_frame = relative_pose(pose, box.pose);
    const dvec3 half(sound_length(double{box.half.x}), sound_length(double{box.half.y}),
                     sound_length(double{box.half.z}));
    return {to_frame.translation, to_frame.rotation, half, margin,
            to_frame.distance + half.x + half.y + half.z + margin};
}

PlacedHalfSpace place(const HalfSpace& half_space, const Pose& pose, double margin) noexcept {
    return place(half_space, world_pose(pose), margin);
}

PlacedHalfSpace place(const HalfSpace& half_space, const RelativePose& to_world, double margin) noexcept {
    const dvec3 n = to_double(half_space.normal), unit = n / glm::length(n);
    const double offset = half_space.offset + margin;
    return {unit * to_world.rotation, // the transpose times it
            offset - glm::dot(unit, to_world.translation), std::abs(offset) + to_world.distance};
}

bool separated(const PlacedTriangle& triangle, const RoundedBox& box, double margin) noexcept {
    const Outcome outcome = gjk(TriangleBody(triangle, box.center), box, margin);
    return outcome == Outcome::separated ||
           (outcome == Outcome::unresolved && separated_by_features(triangle, box, margin));
}

bool separated(const PlacedEllipsoid& ellipsoid, const RoundedBox& box, double margin) noexcept {
    return gjk(EllipsoidBody(ellipsoid, box.center), box, margin) == Outcome::separated;
}

bool separated(const PlacedTriangle& triangle, const PlacedHalfSpace& h, double margin) noexcept {
    return TriangleBody(triangle, dvec3(0)).begin(h.normal) - h.offset > margin * (triangle.reach + h.reach);
}

bool separated(const PlacedEllipsoid& ellipsoid, const PlacedHalfSpace& h, double margin) noexcept {
    return EllipsoidBody(ellipsoid, dvec3(0)).begin(h.normal) - h.offset > margin * (ellipsoid.reach + h.reach);
}

} // namespace prolate::query
