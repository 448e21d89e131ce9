#include "query/triangle/ellipsoid_contact.hpp"

#include "query/triangle/ellipsoid_distance.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace prolate::query {
namespace {

using glm::dvec3;

// The point of the ellipsoid that lies farthest against n.
dvec3 lowest_point(const PlacedEllipsoid& e, const dvec3& n) {
    const dvec3 w = n * e.factor;
    return e.center - e.factor * (w / glm::length(w));
}

// The way out along which a triangle and an ellipsoid that are in each other overlap least.
class LeastOverlap {
public:
    LeastOverlap(const Surrounded& around, const PlacedEllipsoid& ellipsoid)
        : around_(around), ellipsoid_(ellipsoid), face_(face_normal(around.triangle)), deepest_(ellipsoid.center) {}

    EllipsoidContact find() {
        consider(face_, true);
        if (!around_.closed) consider(-face_, true);
        for (size_t i = 0; i < 3; ++i) {
            const dvec3 &corner = around_.triangle.corner[i], edge = around_.triangle.corner[(i + 1) % 3] - corner,
                        from = ellipsoid_.center - corner;
            const double square = glm::dot(edge, edge);
            const double s = square > 0 ? std::clamp(glm::dot(from, edge) / square, 0.0, 1.0) : 0;
            const dvec3 away = from - s * edge;
            if (!around_.closed || glm::dot(away, face_) > 0) consider(away, false);
        }
        return {.normal = normal_, .middle = deepest_ + 0.5 * least_ * normal_, .depth = least_};
    }

private:
    // A face is not climbed from, as in contact.hpp.
    void consider(const dvec3& direction, bool of_face) {
        const double length = glm::length(direction);
        if (!(length > 0)) return;
        const dvec3 n = direction / length;
        double depth =
            support(around_.triangle, n) - (glm::dot(n, ellipsoid_.center) - glm::length(n * ellipsoid_.factor));
        Climb climb = around_.climb(around_.highest(n), n);
        while (!of_face && depth < least_ && climb.steps_left > 0) depth += climb.step();
        if (depth < least_) least_ = depth, normal_ = n, deepest_ = lowest_point(ellipsoid_, n);
    }

    const Surrounded& around_;
    const PlacedEllipsoid& ellipsoid_;
    const dvec3 face_;
    double least_ = HUGE_VAL;
    dvec3 normal_{0, 0, 1}, deepest_;
};

} // namespace

EllipsoidContact contact(const Surrounded& around, const PlacedEllipsoid& ellipsoid) noexcept {
    const TriangleDistance d = distance(around.triangle, ellipsoid);
    const dvec3 between = d.on_b - d.on_a;
    const double length = glm::length(between);
    EllipsoidContact out =
        d.lower > 0 ? EllipsoidContact{.normal = between / length, .middle = 0.5 * (d.on_a + d.on_b), .depth = -length}
                    : LeastOverlap(around, ellipsoid).find();
    const dvec3 face = face_normal(around.triangle);
    out.of_face = std::abs(glm::dot(out.normal, face)) > kSameAsFace * glm::length(face);
    return out;
}

EllipsoidContactAlong contact_along(const dvec3& normal, const PlacedTriangle& triangle,
                                    const PlacedEllipsoid& ellipsoid) noexcept {
    const dvec3 face = face_normal(triangle);
    const double facing = glm::dot(face, normal);
    EllipsoidContactAlong out;
    out.faces = std::abs(facing) > kFacing * glm::length(face);
    if (!out.faces) return out;
    const dvec3 lowest = lowest_point(ellipsoid, normal);
    out.depth = glm::dot(face, triangle.corner[0] - lowest) / facing;
    const dvec3 below = lowest + out.depth * normal;
    out.middle = 0.5 * (lowest + below);
    out.beside = false;
    for (size_t i = 0; i < 3; ++i) {
        const dvec3 &from = triangle.corner[i], &to = triangle.corner[(i + 1) % 3];
        if (glm::dot(face, glm::cross(to - from, below - from)) < 0) out.beside = true;
    }
    return out;
}

} // namespace prolate::query
