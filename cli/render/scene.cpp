#include "cli/render/scene.hpp"

#include <algorithm>
#include <cmath>

namespace prolate::cli {

using glm::dvec3;

void Box::add(const dvec3& a, const dvec3& b) {
    low = glm::min(low, a);
    high = glm::max(high, b);
}

void Box::add(MeshView mesh) {
    for (const Vec3& p : mesh.vertices) add({p.x, p.y, p.z}, {p.x, p.y, p.z});
}

void Box::add(const Ellipsoid& e) {
    const dvec3 center(e.center.x, e.center.y, e.center.z);
    const dvec3 half(e.l11, std::hypot(double{e.l21}, double{e.l22}),
                     std::hypot(double{e.l31}, double{e.l32}, double{e.l33}));
    add(center - half, center + half);
}

Frame Box::frame() const {
    return {dvec3(glm::vec3((low + high) / 2.0)), 2.0 / glm::length(high - low)};
}

void Window::add(const Window& other) {
    u0 = std::min(u0, other.u0);
    u1 = std::max(u1, other.u1);
    v0 = std::min(v0, other.v0);
    v1 = std::max(v1, other.v1);
}

Reach HalfSpace::clip(const dvec3& origin, const dvec3& direction) const {
    const double room = offset - glm::dot(normal, origin), approach = glm::dot(normal, direction);
    if (room >= 0) return approach > 0 ? Reach{0, room / approach} : Reach{};
    return approach < 0 ? Reach{room / approach} : Reach{0, 0};
}

} // namespace prolate::cli
