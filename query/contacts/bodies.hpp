// Two bodies that touch: what a contact of theirs is, and how far their surfaces reach into each other around two
// triangles. For what pairs have by themselves (pair_contacts.hpp) and all of them together (one_way.hpp). All in the
// frame of body A, in double precision.
#pragma once

#include "query/contacts/last_contacts.hpp"
#include "query/contacts/manifold.hpp"
#include "query/node/limits.hpp"
#include "query/node/order.hpp"
#include "query/node/scratch.hpp"
#include "query/triangle/contact.hpp"

#include <prolate/query.hpp>

#include <glm/vec3.hpp>

#include <cstdint>
#include <optional>

namespace prolate::query {

/// What of one body touches, for an id.
struct Part {
    enum class Kind : uint32_t { vertex = 1, edge, face, triangle, node } kind;
    uint32_t first, second; ///< indices: of a vertex, of an edge's two, of a triangle or node; else 0
};
uint64_t id_of(const Part& a, const Part& b) noexcept;
/// A triangle, or the node, if there is none.
Part whole_of(uint32_t node, uint32_t triangle) noexcept;

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
/// Takes contacts one by one, by a function object that outlives it: lists of them would be on the stack.
class ContactSink {
public:
    template <class Take>
    ContactSink(const Take& take) noexcept
        : take_([](const void* user, const Contact& c) { (*static_cast<const Take*>(user))(c); }), user_(&take) {}
    void operator()(const Contact& contact) const { take_(user_, contact); }

private:
    void (*take_)(const void* user, const Contact& contact);
    const void* user_;
};

/// What patches keep of contacts.
struct Candidates {
    const LastContacts& last;
    const bool exchanged; ///< the caller has the bodies the other way round

    Candidate of(const Contact& contact) const noexcept;
};

/// A way to separate the bodies.
struct Way {
    glm::dvec3 normal; ///< of length 1, from A to B
    double depth;
};

/// The tests of a query, which those of bodies are among.
struct Budget {
    const QueryStats& searched;
    uint64_t& others;
    uint64_t most;

    uint64_t left() const noexcept { return tests_left(most, searched.tests() + others); }
};

class TouchingBodies {
public:
    /// Points nearer to each other than `same_point`, metres, are one. All that is referred to must outlive it. Between
    /// two traversals the rays use the least scratch; the climbs always the rest.
    TouchingBodies(const OrderedBodies<Pose>& bodies, const RelativePose& b_to_a, float margin, const Budget& budget,
                   const DividedScratch& scratch, double same_point) noexcept;

    const TreeView &tree_a, &tree_b;
    const RelativePose& b_to_a;
    const double margin, same_point;
    bool closed_a, closed_b; ///< faces have outsides

    PlacedTriangle triangle_a(const MeetingPair& pair) const noexcept { return place(tree_a, pair.triangle_a); }
    PlacedTriangle triangle_b(const MeetingPair& pair) const noexcept { return place(tree_b, pair.triangle_b, b_to_a); }
    Surrounded surrounded_a(uint32_t triangle) const noexcept;
    Surrounded surrounded_b(uint32_t triangle) const noexcept;
    /// Of a pair of triangles: one, or all.
    Contact contact_of(const TriangleContact& found, uint32_t point, const MeetingPair& pair) const noexcept;
    ContactsOfPair contacts_of(const TriangleContact& found, const MeetingPair& pair) const noexcept;

    /// What the bodies overlap by along n around a pair of triangles; what is above `enough` may be too little.
    double overlap(const glm::dvec3& n, const MeetingPair& pair, double enough) const noexcept;
    /// The normal along which the bodies overlap least around a pair of triangles, within 25 degrees of this one. The
    /// given one, with infinite depth, if along it they overlap by more than `most`.
    Way shortest_way(const glm::dvec3& from, const MeetingPair& pair, double most) const noexcept;
    /// The same of a patch: its mean, where all have one normal.
    glm::dvec3 shortest_way(const Patch& patch) const noexcept;
    /// From where one is nearest to the other, if they are apart: as deep as that is below 0. Not during a traversal.
    std::optional<Way> between_nearest() noexcept;
    /// What of either body is deepest in the other along the way, and no deeper than it, around the pairs of a patch:
    /// of a finely meshed body it meets no triangle. Of each body at most two vertices for each of the patch's points:
    /// the tops of the hills around them. Not during a traversal.
    void deepest(const Patch& patch, const Way& way, const ContactSink& out) noexcept;
    /// The same, of vertices that can be reached from a patch's pairs without leaving the other body, each deeper than
    /// the last one, up to 64 of each body. Not during a traversal.
    struct Inside {
        glm::dvec3 face; ///< outward normal of what the deepest one would leave through, of length 1; 0: there is none
        double overlap;  ///< of the deepest ones of both bodies; if one has none, the depth of the other's
    };
    Inside deepest_inside(const Patch& patch, const Way& way, const ContactSink& out) noexcept;

private:
    double overlap(const glm::dvec3& n, uint32_t& vertex_a, uint32_t& vertex_b, double enough) const noexcept;
    struct Exit {
        double depth;        // below 0: the vertex does not lie in the other body
        glm::dvec3 face, at; // its outward normal, of length 1; the vertex
    };
    Exit add_depth_of(uint32_t vertex, bool of_a, const MeetingPair& pair, const Way& way, const ContactSink& out);

    const Pose &place_a_, &place_b_;
    const Budget budget_;
    Scratch context_;
    const Hills hills_a_, hills_b_;
};

} // namespace prolate::query
