#include "query/contacts/last_contacts.hpp"

#include <glm/geometric.hpp>

#include <algorithm>

namespace prolate::query {
namespace {

constexpr double kNormalOfPoint = 0.8; // cosine: normals of a point in two queries, if it is the same

} // namespace

LastContacts::LastContacts(const ContactManifolds& last, bool exchanged, const RelativePose& to_world) noexcept
    : count_(std::min(last.count, kManifolds)) {
    for (uint32_t i = 0; i < count_; ++i) {
        const Manifold& manifold = last.manifolds[i];
        const glm::dvec3 here = to_double(manifold.normal) * to_world.rotation; // the transpose times it
        normals_[i] = {exchanged ? -here : here, manifold.normal};
        for (uint32_t k = 0; k < std::min(manifold.count, kManifoldPoints); ++k) {
            const ContactPoint& p = manifold.points[k];
            const glm::dvec3 middle = 0.5 * (to_double(p.point_a) + to_double(p.point_b));
            points_[point_count_++] = {(middle - to_world.translation) * to_world.rotation,
                                       p.id,
                                       i,
                                       p.age,
                                       {p.impulse[0], p.impulse[1], p.impulse[2]}};
        }
    }
}

bool LastContacts::knows(uint64_t id, const glm::dvec3& normal) const noexcept {
    return std::any_of(points_, points_ + point_count_, [&](const Point& p) {
        return p.id == id && glm::dot(normals_[p.manifold].here, normal) > kNormalOfPoint;
    });
}

void LastContacts::hand_on(Manifold& manifold) const noexcept {
    const Vec3& n = manifold.normal;
    bool alike[kManifolds];
    for (uint32_t i = 0; i < count_; ++i) {
        const Vec3& m = normals_[i].given;
        alike[i] = m.x * n.x + m.y * n.y + m.z * n.z > kNormalOfPoint;
    }
    for (uint32_t k = 0; k < manifold.count; ++k) {
        ContactPoint& to = manifold.points[k];
        for (uint32_t i = 0; i < point_count_; ++i) {
            const Point& p = points_[i];
            if (p.id != to.id || !alike[p.manifold]) continue;
            to.age = p.age + 1;
            std::copy_n(p.impulse, 3, to.impulse);
        }
    }
}

} // namespace prolate::query
