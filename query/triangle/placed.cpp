#include "query/triangle/placed.hpp"

#include <glm/geometric.hpp>

#include <algorithm>

namespace prolate::query {

PlacedTriangle place(const TreeView& tree, uint32_t triangle) noexcept {
    PlacedTriangle out{};
    const Triangle corners = tree.triangle(triangle);
    for (size_t i = 0; i < 3; ++i) {
        out.corner[i] = position(tree, corners[i]);
        out.reach = std::max(out.reach, glm::length(out.corner[i]));
    }
    return out;
}

PlacedTriangle place(const TreeView& tree, uint32_t triangle, const RelativePose& b_to_a) noexcept {
    PlacedTriangle out = place(tree, triangle);
    for (glm::dvec3& corner : out.corner) corner = b_to_a.rotation * corner + b_to_a.translation;
    out.reach += b_to_a.distance;
    return out;
}

glm::dvec3 face_normal(const PlacedTriangle& t) noexcept {
    return glm::cross(t.corner[1] - t.corner[0], t.corner[2] - t.corner[0]);
}

double support(const PlacedTriangle& t, const glm::dvec3& n) noexcept {
    return std::max({glm::dot(n, t.corner[0]), glm::dot(n, t.corner[1]), glm::dot(n, t.corner[2])});
}

} // namespace prolate::query
