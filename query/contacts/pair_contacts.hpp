// How pairs of leaves, or of their triangles, that meet touch: points with a normal (query/triangle/contact.hpp,
// query/triangle/ellipsoid_contact.hpp, query/ellipsoid/gap.hpp). All in the frame of body A, in double precision.
#pragma once

#include "query/collide/search.hpp"
#include "query/contacts/bodies.hpp"

#include <glm/vec3.hpp>

#include <cstdint>

namespace prolate::query {

class PairContacts {
public:
    /// Both must outlive it.
    PairContacts(const CollideSearch& search, const TouchingBodies& bodies) noexcept : s_(search), bodies_(bodies) {}

    /// The contacts along the normal that the pair has by itself; none, if it is not about as short a way out as the
    /// known one. `open`: through whatever side.
    ContactsOfPair by_itself(const MeetingPair& pair, const KnownOverlap& known = {}, bool open = false) const noexcept;
    /// The contacts of a pair with triangles along a given normal. If that is not `certain` there are none, and the
    /// pair should speak for itself.
    ContactsOfPair along(const glm::dvec3& normal, const MeetingPair& pair) const noexcept;
    /// Some contact of a pair, through whatever side.
    Contact last_resort(const MeetingPair& pair) const noexcept;

    /// Is the pair separated once the bodies are moved by this depth along n?
    bool resolves(const glm::dvec3& n, double depth, const MeetingPair& pair) const noexcept;

private:
    PlacedEllipsoid ellipsoid_a(const MeetingPair& pair) const {
        return place(s_.a.tree.ellipsoid(pair.node_a), s_.a.tree.scale());
    }
    PlacedEllipsoid ellipsoid_b(const MeetingPair& pair) const {
        return place(s_.b.tree.ellipsoid(pair.node_b), s_.b.tree.scale(), s_.b_to_a);
    }
    Contact of_ellipsoids(const MeetingPair& pair) const;

    const CollideSearch& s_;
    const TouchingBodies& bodies_;
};

} // namespace prolate::query
