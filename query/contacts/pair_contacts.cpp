#include "query/contacts/pair_contacts.hpp"

#include "query/ellipsoid/gap.hpp"
#include "query/triangle/distance.hpp"
#include "query/triangle/ellipsoid_contact.hpp"

#include <prolate/raycast.hpp>

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <cmath>

namespace prolate::query {
namespace {

using glm::dvec3;

constexpr double kTolerance = 1e-7;                   // of the smaller ellipsoid: how exact depths are
constexpr double kFirstTilt = 0.1, kLeastTilt = 1e-3; // radians, about: steps of the search for the shortest way
constexpr int kTiltRounds = 8;

// The finisher of SplitMix64 (Steele, Lea, Flood 2014).
uint64_t mixed(uint64_t x) {
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
    return x ^ (x >> 31);
}

Part part_of(const TreeView& tree, uint32_t triangle, Feature feature) {
    const Triangle v = tree.triangle(triangle);
    if (feature < kFirstEdge) return {Part::Kind::vertex, v[feature], 0};
    if (feature == kFace) return {Part::Kind::face, 0, 0};
    const size_t i = feature - kFirstEdge;
    const auto [first, second] = std::minmax(v[i], v[(i + 1) % 3]);
    return {Part::Kind::edge, first, second};
}
Part whole(uint32_t node, uint32_t triangle) {
    return triangle != kNoTriangle ? Part{Part::Kind::triangle, triangle, 0} : Part{Part::Kind::node, node, 0};
}
// A contact of a pair as a whole: of nodes or triangles, not of features of these.
Contact contact_of_whole(const MeetingPair& pair, const dvec3& normal, const dvec3& middle, double depth) {
    return {.pair = pair,
            .normal = normal,
            .middle = middle,
            .depth = depth,
            .a = whole(pair.node_a, pair.triangle_a),
            .b = whole(pair.node_b, pair.triangle_b),
            .overlap = depth};
}

bool is_closed(const TreeView& tree) {
    return tree.has_triangles() && !tree.surface_mode();
}

dvec3 perpendicular(const dvec3& n) {
    return glm::normalize(glm::cross(n, std::abs(n.x) < 0.6 ? dvec3(1, 0, 0) : dvec3(0, 1, 0)));
}

} // namespace

uint64_t id_of(const Part& a, const Part& b) noexcept {
    uint64_t h = 0;
    for (const Part& p : {a, b}) {
        h = mixed(h + 0x9e3779b97f4a7c15u + static_cast<uint32_t>(p.kind));
        h = mixed(h ^ (uint64_t{p.first} << 32 | p.second));
    }
    return h;
}

PairContacts::PairContacts(CollideSearch& search, const DividedScratch& scratch, double same_point) noexcept
    : s_(search), context_(scratch.least), same_point_(same_point), closed_a_(is_closed(search.a.tree)),
      closed_b_(is_closed(search.b.tree)), hills_a_(search.a.tree, search.other_tests, search.options.max_pair_tests,
                                                    scratch.rest.first(scratch.rest.size() / 2)),
      hills_b_(search.b.tree, search.other_tests, search.options.max_pair_tests,
               scratch.rest.subspan(scratch.rest.size() / 2)) {}

Surrounded PairContacts::surrounded_a(uint32_t triangle) const {
    return {.triangle = place(s_.a.tree, triangle),
            .closed = closed_a_,
            .hills = &hills_a_,
            .corners = s_.a.tree.triangle(triangle)};
}

Surrounded PairContacts::surrounded_b(uint32_t triangle) const {
    return {.triangle = place(s_.b.tree, triangle, s_.b_to_a),
            .closed = closed_b_,
            .hills = &hills_b_,
            .corners = s_.b.tree.triangle(triangle),
            .rotation = &s_.b_to_a.rotation};
}

bool PairContacts::resolves(const dvec3& n, double depth, const MeetingPair& pair) const noexcept {
    const double high = pair.triangle_a != kNoTriangle ? support(triangle_a(pair), n) : support(ellipsoid_a(pair), n);
    const double low =
        pair.triangle_b != kNoTriangle ? -support(triangle_b(pair), -n) : -support(ellipsoid_b(pair), -n);
    return high - low <= depth + same_point_;
}

// ---- one pair ----

ContactsOfPair PairContacts::points(const TriangleContact& found, const MeetingPair& pair) const {
    ContactsOfPair out;
    out.certain = found.faces;
    for (uint32_t i = 0; i < found.count; ++i) {
        const TriangleContact::Point& p = found.points[i];
        const bool beside = p.of_a == kFace && p.of_b == kFace;
        const auto part = [beside](const TreeView& tree, uint32_t triangle, Feature feature) {
            return beside ? whole(0, triangle) : part_of(tree, triangle, feature);
        };
        out.add({.pair = pair,
                 .normal = found.normal,
                 .middle = 0.5 * (p.on_a + p.on_b),
                 .depth = p.depth,
                 .a = part(s_.a.tree, pair.triangle_a, p.of_a),
                 .b = part(s_.b.tree, pair.triangle_b, p.of_b),
                 .overlap = found.overlap});
    }
    return out;
}

ContactsOfPair PairContacts::along(const dvec3& n, const MeetingPair& pair) const noexcept {
    const bool in_a = pair.triangle_a != kNoTriangle, in_b = pair.triangle_b != kNoTriangle;
    if (in_a && in_b) return points(contact_along(n, triangle_a(pair), triangle_b(pair), s_.options.margin), pair);
    const EllipsoidContactAlong found = in_a ? contact_along(n, triangle_a(pair), ellipsoid_b(pair))
                                             : contact_along(-n, triangle_b(pair), ellipsoid_a(pair));
    ContactsOfPair out;
    out.certain = found.faces;
    if (!found.beside && found.depth >= -s_.options.margin)
        out.add(contact_of_whole(pair, n, found.middle, found.depth));
    return out;
}

ContactsOfPair PairContacts::by_itself(const MeetingPair& pair, const KnownOverlap& known) const noexcept {
    const bool in_a = pair.triangle_a != kNoTriangle, in_b = pair.triangle_b != kNoTriangle;
    if (in_a && in_b)
        return points(contact(surrounded_a(pair.triangle_a), surrounded_b(pair.triangle_b), s_.options.margin, known),
                      pair);
    ContactsOfPair out;
    out.certain = true;
    if (in_a || in_b) {
        const EllipsoidContact found = in_a ? contact(surrounded_a(pair.triangle_a), ellipsoid_b(pair))
                                            : contact(surrounded_b(pair.triangle_b), ellipsoid_a(pair));
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

Contact PairContacts::last_resort(const MeetingPair& pair) noexcept {
    closed_a_ = closed_b_ = false;
    if (const ContactsOfPair found = by_itself(pair); found.count > 0) return found.contacts[0];
    const TriangleDistance d = distance(triangle_a(pair), triangle_b(pair));
    return contact_of_whole(pair, {0, 0, 1}, 0.5 * (d.on_a + d.on_b), 0);
}

// ---- the way out of curved bodies ----

// What the bodies overlap by along n around two of their vertices, which it moves to the tops of their climbs; what is
// above `enough` may be too little.
double PairContacts::overlap(const dvec3& n, uint32_t& vertex_a, uint32_t& vertex_b, double enough) const {
    Climb a{&hills_a_, n, vertex_a, vertex_a, kClimbSteps},
        b{&hills_b_, -(n * s_.b_to_a.rotation), vertex_b, vertex_b, kClimbSteps};
    const dvec3 at_a = position(s_.a.tree, vertex_a),
                at_b = s_.b_to_a.rotation * position(s_.b.tree, vertex_b) + s_.b_to_a.translation;
    double sum = glm::dot(n, at_a - at_b);
    while (sum <= enough && a.steps_left > 0) sum += a.step();
    while (sum <= enough && b.steps_left > 0) sum += b.step();
    vertex_a = a.vertex, vertex_b = b.vertex;
    return sum;
}

// Finely meshed curved bodies have as many normals as triangles that meet, all around the place where they are deepest:
// from their mean on, the direction is turned to where they overlap least, by the parabolas through the overlaps of a
// pattern of directions (Hooke and Jeeves 1961, with the step of Powell 1964).
dvec3 PairContacts::shortest_way(const Patch& patch) const noexcept {
    const dvec3 mean = patch.normal();
    const MeetingPair& pair = patch.deepest().pair;
    if (!patch.mixed() || pair.triangle_a == kNoTriangle || pair.triangle_b == kNoTriangle) return mean;
    const Surrounded a = surrounded_a(pair.triangle_a), b = surrounded_b(pair.triangle_b);
    dvec3 best = mean;
    uint32_t vertex_a = a.corners[a.highest(best)], vertex_b = b.corners[b.highest(-best)];
    const double most = patch.overlap() + same_point_;
    double least = overlap(best, vertex_a, vertex_b, most);
    if (!(least <= most)) return mean; // around here the bodies are not convex
    double tilt = kFirstTilt;
    for (int round = 0; round < kTiltRounds && tilt > kLeastTilt; ++round) {
        const dvec3 center = best, x = perpendicular(center), y = glm::cross(center, x);
        const double here = least;
        const auto look = [&](double along_x, double along_y) {
            const dvec3 n = glm::normalize(center + along_x * x + along_y * y);
            uint32_t of_a = vertex_a, of_b = vertex_b;
            const double found = overlap(n, of_a, of_b, 4 * std::abs(here) + same_point_);
            if (found < least && glm::dot(n, mean) > kFacing) best = n, least = found, vertex_a = of_a, vertex_b = of_b;
            return found;
        };
        const auto lowest = [&](double before, double after) { // of the parabola
            const double bend = before + after - 2 * here;
            return bend > 0 ? std::clamp(tilt * (before - after) / (2 * bend), -tilt, tilt) : 0;
        };
        const double left = look(-tilt, 0), right = look(tilt, 0), below = look(0, -tilt), above = look(0, tilt);
        look(lowest(left, right), lowest(below, above));
        if (glm::dot(best, center) > 1 - tilt * tilt / 8) tilt /= 4; // moved by less than half of it
    }
    return best;
}

// ---- the deepest points ----

// From the pairs of a patch the bodies are climbed along its normal to what is deepest around there, and a ray from it
// finds the other body's surface.
void PairContacts::deepest(const Patch& patch, const dvec3& n, const ContactSink& out) noexcept {
    for (const bool of_a : {true, false}) {
        uint32_t seen[2 * Patch::kSieve], count = 0; // vertices
        const auto look = [&](const MeetingPair& pair, const dvec3& along) {
            const Surrounded around = of_a ? surrounded_a(pair.triangle_a) : surrounded_b(pair.triangle_b);
            const dvec3 up = of_a ? along : -along; // out of the body
            Climb climb = around.climb(around.highest(up), up);
            while (climb.steps_left > 0) climb.step();
            if (std::find(seen, seen + count, climb.vertex) != seen + count) return;
            seen[count++] = climb.vertex;
            add_depth_of(climb.vertex, of_a, pair, n, patch.overlap(), out);
        };
        const Candidate* all[Patch::kSieve];
        const uint32_t all_count = patch.kept(all);
        for (uint32_t i = 0; i < all_count; ++i) {
            const Candidate& c = *all[i];
            if (c.pair.triangle_a == kNoTriangle || c.pair.triangle_b == kNoTriangle) continue;
            look(c.pair, n);
            if (!(glm::dot(c.normal, n) > kSameAsFace)) look(c.pair, c.normal); // in a hollow of faces
        }
    }
}

// Of a vertex of the one body that lies in the other by at most `most`.
void PairContacts::add_depth_of(uint32_t vertex, bool of_a, const MeetingPair& pair, const dvec3& n, double most,
                                const ContactSink& out) {
    const dvec3 up = of_a ? n : -n;
    const dvec3 here = position((of_a ? s_.a : s_.b).tree, vertex);
    const dvec3 at = of_a ? here : s_.b_to_a.rotation * here + s_.b_to_a.translation;
    // Cast in the other body's frame, against `up`.
    const RelativePose a_to_b = inverse(s_.b_to_a);
    const dvec3 start = of_a ? a_to_b.rotation * at + a_to_b.translation : at;
    const dvec3 direction = of_a ? -(a_to_b.rotation * up) : -up;
    const RaycastResult hit =
        raycast((of_a ? s_.b : s_.a).tree, Pose{}, {to_float(start), to_float(direction), static_cast<float>(most) + 1},
                context_, {.max_pair_tests = s_.left()});
    s_.other_tests += hit.stats.pair_tests + hit.stats.triangle_tests;
    if (hit.triangle == kNoTriangle) return;
    MeetingPair found = pair;
    (of_a ? found.triangle_b : found.triangle_a) = hit.triangle;
    const PlacedTriangle t = of_a ? triangle_b(found) : triangle_a(found);
    const dvec3 face = face_normal(t);
    const double facing = -glm::dot(face, up); // of the outside, which the ray must leave through
    if (!((of_a ? closed_b_ : closed_a_) ? facing > 0 : facing != 0)) return;
    const double depth = glm::dot(face, t.corner[0] - at) / facing;
    if (!(depth >= 0 && depth <= most + same_point_)) return;
    const Part part{Part::Kind::vertex, vertex, 0}, other{Part::Kind::face, 0, 0};
    out.take(out.user, {.pair = pair,
                        .normal = n,
                        .middle = at - 0.5 * depth * up,
                        .depth = depth,
                        .a = of_a ? part : other,
                        .b = of_a ? other : part,
                        .overlap = depth});
}

} // namespace prolate::query
