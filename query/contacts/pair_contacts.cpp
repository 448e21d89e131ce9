#include "query/contacts/pair_contacts.hpp"

#include "query/ellipsoid/gap.hpp"
#include "query/triangle/distance.hpp"
#include "query/triangle/ellipsoid_contact.hpp"

#include <glm/geometric.hpp>

#include <algorithm>

namespace prolate::query {
namespace {

using glm::dvec3;

constexpr double kTolerance = 1e-7; // of the smaller ellipsoid: how exact depths are

// A contact of a pair as a whole: of nodes or triangles, not of features of these.
Contact contact_of_whole(const MeetingPair& pair, const dvec3& normal, const dvec3& middle, double depth) {
    return {.pair = pair,
            .normal = normal,
            .middle = middle,
            .depth = depth,
            .a = whole_of(pair.node_a, pair.triangle_a),
            .b = whole_of(pair.node_b, pair.triangle_b),
            .overlap = depth};
}

} // namespace

bool PairContacts::resolves(const dvec3& n, double depth, const MeetingPair& pair) const noexcept {
    const double high =
        pair.triangle_a != kNoTriangle ? support(bodies_.triangle_a(pair), n) : support(ellipsoid_a(pair), n);
    const double low =
        pair.triangle_b != kNoTriangle ? -support(bodies_.triangle_b(pair), -n) : -support(ellipsoid_b(pair), -n);
    return high - low <= depth + bodies_.same_point;
}

ContactsOfPair PairContacts::along(const dvec3& n, const MeetingPair& pair) const noexcept {
    const bool in_a = pair.triangle_a != kNoTriangle, in_b = pair.triangle_b != kNoTriangle;
    if (in_a && in_b)
        return bodies_.contacts_of(
            contact_along(n, bodies_.triangle_a(pair), bodies_.triangle_b(pair), s_.options.margin), pair);
    const EllipsoidContactAlong found = in_a ? contact_along(n, bodies_.triangle_a(pair), ellipsoid_b(pair))
                                             : contact_along(-n, bodies_.triangle_b(pair), ellipsoid_a(pair));
    ContactsOfPair out;
    out.certain = found.faces;
    if (!found.beside && found.depth >= -s_.options.margin)
        out.add(contact_of_whole(pair, n, found.middle, found.depth));
    return out;
}

ContactsOfPair PairContacts::by_itself(const MeetingPair& pair, const KnownOverlap& known, bool open) const noexcept {
    const bool in_a = pair.triangle_a != kNoTriangle, in_b = pair.triangle_b != kNoTriangle;
    Surrounded a, b;
    if (in_a) a = bodies_.surrounded_a(pair.triangle_a), a.closed = a.closed && !open;
    if (in_b) b = bodies_.surrounded_b(pair.triangle_b), b.closed = b.closed && !open;
    if (in_a && in_b) return bodies_.contacts_of(contact(a, b, s_.options.margin, known), pair);
    ContactsOfPair out;
    out.certain = true;
    if (in_a || in_b) {
        const EllipsoidContact found = in_a ? contact(a, ellipsoid_b(pair)) : contact(b, ellipsoid_a(pair));
        out.certain = found.of_face;
        out.add(contact_of_whole(pair, in_a ? found.normal : -found.normal, found.middle, found.depth));
    } else {
        out.add(of_ellipsoids(pair));
    }
    return out;
}

Contact PairContacts::of_ellipsoids(const MeetingPair& pair) const {
    const PlacedEllipsoid x = ellipsoid_a(pair), y = ellipsoid_b(pair);
    const double tolerance = kTolerance * std::min(x.size, y.size);
    Gap gap = distance_of(x, y, tolerance);
    if (!(gap.lower > 0)) gap = depth_of(x, y, tolerance, gap.normal);
    return contact_of_whole(pair, gap.normal, 0.5 * (gap.point_a + gap.point_b), -gap.lower);
}

Contact PairContacts::last_resort(const MeetingPair& pair) const noexcept {
    if (const ContactsOfPair found = by_itself(pair, {}, true); found.count > 0) return found.contacts[0];
    const TriangleDistance d = distance(bodies_.triangle_a(pair), bodies_.triangle_b(pair));
    return contact_of_whole(pair, {0, 0, 1}, 0.5 * (d.on_a + d.on_b), 0);
}

} // namespace prolate::query
