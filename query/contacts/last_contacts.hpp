// What the last query knew of the contacts of two bodies: ids of points by which they are known again, with their ages
// and impulses.
#pragma once

#include "query/ellipsoid/placed.hpp"

#include <prolate/contacts.hpp>

#include <glm/vec3.hpp>

#include <algorithm>
#include <cstdint>

namespace prolate::query {

class LastContacts {
public:
    /// Copies what it needs. `exchanged`: the caller has the bodies the other way round. `to_world`: from A's frame.
    LastContacts(const ContactManifolds& last, bool exchanged, const RelativePose& to_world) noexcept;

    uint32_t count() const noexcept { return count_; } ///< of manifolds
    /// Of a manifold, in A's frame, from A to B.
    const glm::dvec3& normal(uint32_t manifold) const noexcept { return normals_[manifold].here; }
    /// Was there a point of which holds(middle) is true? In A's frame, where the last poses had it in the world.
    template <class Holds> bool any(Holds&& holds) const {
        return std::any_of(points_, points_ + point_count_, [&](const Point& p) { return holds(p.middle); });
    }
    /// Calls visit(id) for each point.
    template <class Visit> void for_each_id(Visit&& visit) const {
        for (uint32_t i = 0; i < point_count_; ++i) visit(points_[i].id);
    }
    /// Was there a point of this id, and about this normal?
    bool knows(uint64_t id, const glm::dvec3& normal) const noexcept;
    /// Gives the points of a new manifold that are known the age and the impulse that they had.
    void hand_on(Manifold& manifold) const noexcept;

private:
    struct Normal {
        glm::dvec3 here; // in A's frame, from A to B
        Vec3 given;      // in the world, as the caller has the bodies
    };
    struct Point {
        glm::dvec3 middle;
        uint64_t id;
        uint32_t manifold, age;
        float impulse[3];
    };
    uint32_t count_, point_count_ = 0;
    Normal normals_[kManifolds];
    Point points_[kManifolds * kManifoldPoints];
};

} // namespace prolate::query
