// How pairs of leaves, or of their triangles, that meet touch: points with a normal (query/triangle/contact.hpp,
// query/triangle/ellipsoid_contact.hpp, query/ellipsoid/gap.hpp), the shortest way out of curved bodies, and the
// deepest points around a pair. All in the frame of body A, in double precision.
#pragma once

#include "query/collide/search.hpp"
#include "query/contacts/manifold.hpp"
#include "query/node/scratch.hpp"
#include "query/triangle/contact.hpp"

#include <glm/vec3.hpp>

#include <cstdint>

namespace prolate::query {

/// What of one body touches, for an id.
struct Part {
    enum class Kind : uint32_t { vertex = 1, edge, face, triangle, node } kind;
    uint32_t first, second; ///< indices: of a vertex, of an edge's two, of a triangle or node; else 0
};
uint64_t id_of(const Part& a, const Part& b) noexcept;

/// A way in which a pair touches.
struct Contact {
    MeetingPair pair;
    glm::dvec3 normal; ///< of length 1, from A to B
    glm::dvec3 middle; ///< between the surfaces
    double depth;
    Part a, b;
    double overlap; ///< of the bodies around the pair
};
template <uint32_t kMost> struct ContactList {
    uint32_t count = 0;
    Contact contacts[kMost];

    void add(const Contact& contact) noexcept { contacts[count++] = contact; }
    const Contact* begin() const noexcept { return contacts; }
    const Contact* end() const noexcept { return contacts + count; }
};
/// All contacts of one pair, along one normal.
struct ContactsOfPair : ContactList<TriangleContact::kPoints> {
    /// The normal is a face's, or that of two ellipsoids; not one of edges, corners or closest points, which neighbours
    /// may contradict.
    bool certain = false;
};
/// Takes contacts one by one: lists of them would be on the stack.
struct ContactSink {
    void (*take)(void* user, const Contact& contact);
    void* user;
};

class PairContacts {
public:
    /// Points nearer to each other than `same_point`, metres, are one. The search must outlive it. The search and,
    /// between two traversals, the rays use the least scratch; the climbs the rest.
    PairContacts(CollideSearch& search, const DividedScratch& scratch, double same_point) noexcept;

    /// The contacts along the normal that the pair has by itself; none, if it is not about as short a way out as the
    /// known one.
    ContactsOfPair by_itself(const MeetingPair& pair, const KnownOverlap& known = {}) const noexcept;
    /// The contacts of a pair with triangles along a given normal. If that is not `certain` there are none, and the
    /// pair should speak for itself.
    ContactsOfPair along(const glm::dvec3& normal, const MeetingPair& pair) const noexcept;
    /// Some contact of a pair, through whatever side.
    Contact last_resort(const MeetingPair& pair) noexcept;

    /// Is the pair separated once the bodies are moved by this depth along n?
    bool resolves(const glm::dvec3& n, double depth, const MeetingPair& pair) const noexcept;
    /// The normal along which the bodies overlap least around a patch.
    glm::dvec3 shortest_way(const Patch& patch) const noexcept;
    /// What of either body is deepest in the other along n, around the pairs of a patch: of a finely meshed body it
    /// meets no triangle. Of each body at most two vertices for each of the patch's points.
    void deepest(const Patch& patch, const glm::dvec3& n, const ContactSink& out) noexcept;

private:
    PlacedTriangle triangle_a(const MeetingPair& pair) const { return place(s_.a.tree, pair.triangle_a); }
    PlacedTriangle triangle_b(const MeetingPair& pair) const { return place(s_.b.tree, pair.triangle_b, s_.b_to_a); }
    PlacedEllipsoid ellipsoid_a(const MeetingPair& pair) const {
        return place(s_.a.tree.ellipsoid(pair.node_a), s_.a.tree.scale());
    }
    PlacedEllipsoid ellipsoid_b(const MeetingPair& pair) const {
        return place(s_.b.tree.ellipsoid(pair.node_b), s_.b.tree.scale(), s_.b_to_a);
    }
    Surrounded surrounded_a(uint32_t triangle) const;
    Surrounded surrounded_b(uint32_t triangle) const;
    ContactsOfPair points(const TriangleContact& found, const MeetingPair& pair) const;
    Contact of_ellipsoids(const MeetingPair& pair) const;
    double overlap(const glm::dvec3& n, uint32_t& vertex_a, uint32_t& vertex_b, double enough) const;
    void add_depth_of(uint32_t vertex, bool of_a, const MeetingPair& pair, const glm::dvec3& n, double most,
                      const ContactSink& out);

    CollideSearch& s_;
    Scratch context_;
    const double same_point_;
    bool closed_a_, closed_b_;
    const Hills hills_a_, hills_b_;
};

} // namespace prolate::query
