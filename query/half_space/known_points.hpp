// What the last query knew of contacts with the ground: ids of points, with their ages and impulses.
#pragma once

#include "query/ellipsoid/placed.hpp"

#include <prolate/contacts.hpp>

#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include <algorithm>
#include <cstdint>

namespace prolate::query {

class KnownPoints {
public:
    /// Copies the points of manifolds that have about this normal, in the world.
    KnownPoints(const ContactManifolds& last, const glm::dvec3& normal) noexcept {
        constexpr double kSameNormal = 0.8; // cosine
        for (uint32_t i = 0; i < std::min(last.count, kManifolds); ++i) {
            const Manifold& manifold = last.manifolds[i];
            if (!(glm::dot(to_double(manifold.normal), normal) > kSameNormal)) continue;
            for (uint32_t k = 0; k < std::min(manifold.count, kManifoldPoints); ++k) {
                const ContactPoint& p = manifold.points[k];
                points_[count_++] = {p.id, p.age, {p.impulse[0], p.impulse[1], p.impulse[2]}};
            }
        }
    }

    bool has(uint64_t id) const noexcept {
        return std::any_of(points_, points_ + count_, [&](const Point& p) { return p.id == id; });
    }
    /// Calls visit(id) for each point.
    template <class Visit> void for_each_id(Visit&& visit) const {
        for (uint32_t i = 0; i < count_; ++i) visit(points_[i].id);
    }
    /// Gives a point that was known the age and the impulse that it had.
    void hand_on(ContactPoint& to) const noexcept {
        const Point* const p = std::find_if(points_, points_ + count_, [&](const Point& q) { return q.id == to.id; });
        if (p == points_ + count_) return;
        to.age = p->age + 1;
        std::copy_n(p->impulse, 3, to.impulse);
    }

private:
    struct Point {
        uint64_t id;
        uint32_t age;
        float impulse[3];
    };
    uint32_t count_ = 0;
    Point points_[kManifolds * kManifoldPoints];
};

} // namespace prolate::query
