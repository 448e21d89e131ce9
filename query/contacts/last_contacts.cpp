#include "query/contacts/last_contacts.hpp"

#include <glm/geometric.hpp>

#include <algorithm>

namespace prolate::query {
namespace {

constexpr double kNormalOfPoint = 0.8; // cosine: normals of a point in two queries, if it is the same

uint32_t points_of(const Manifold& manifold) {
    return std::min(manifold.count, kManifoldPoints);
}

} // namespace

LastContacts::LastContacts(const ContactManifolds& last, bool exchanged, const RelativePose& to_world) noexcept
    : last_(last), count_(std::min(last.count, kManifolds)) {
    for (uint32_t i = 0; i < count_; ++i) {
        const Vec3& n = last.manifolds[i].normal;
        const glm::dvec3 here = glm::dvec3(n.x, n.y, n.z) * to_world.rotation; // the transpose times it
        normals_[i] = exchanged ? -here : here;
        for (uint32_t k = 0; k < points_of(last.manifolds[i]); ++k) {
            const ContactPoint& p = last.manifolds[i].points[k];
            const glm::dvec3 middle = 0.5 * (to_double(p.point_a) + to_double(p.point_b));
            points_[point_count_++] = (middle - to_world.translation) * to_world.rotation;
        }
    }
}

bool LastContacts::knows(uint64_t id, const glm::dvec3& normal) const noexcept {
    bool known = false;
    for (uint32_t i = 0; i < count_; ++i) {
        const Manifold& m = last_.manifolds[i];
        const bool alike = glm::dot(normals_[i], normal) > kNormalOfPoint;
        for (uint32_t k = 0; k < points_of(m) && alike; ++k) known = known || m.points[k].id == id;
    }
    return known;
}

void LastContacts::hand_on(Manifold& manifold) const noexcept {
    const auto alike = [](const Vec3& a, const Vec3& b) { return a.x * b.x + a.y * b.y + a.z * b.z > kNormalOfPoint; };
    for (uint32_t i = 0; i < manifold.count; ++i) {
        ContactPoint& p = manifold.points[i];
        for (uint32_t j = 0; j < count_; ++j) {
            const Manifold& m = last_.manifolds[j];
            if (!alike(m.normal, manifold.normal)) continue;
            for (uint32_t k = 0; k < points_of(m); ++k) {
                if (m.points[k].id != p.id) continue;
                p.age = m.points[k].age + 1;
                std::copy_n(m.points[k].impulse, 3, p.impulse);
            }
        }
    }
}

} // namespace prolate::query
