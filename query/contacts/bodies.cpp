#include "query/contacts/bodies.hpp"

#include <prolate/distance.hpp>
#include <prolate/raycast.hpp>

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <cmath>

namespace prolate::query {
namespace {

using glm::dvec3;

constexpr double kFirstTilt = 0.1, kLeastTilt = 1e-3; // radians, about: steps of the search for the shortest way
constexpr int kTiltRounds = 8;
constexpr uint32_t kInside = 64, kNeighbours = 16; // vertices: as many are looked at

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
dvec3 perpendicular(const dvec3& n) {
    return glm::normalize(glm::cross(n, std::abs(n.x) < 0.6 ? dvec3(1, 0, 0) : dvec3(0, 1, 0)));
}
bool is_closed(const TreeView& tree) {
    return tree.has_triangles() && !tree.surface_mode();
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

Part whole_of(uint32_t node, uint32_t triangle) noexcept {
    return triangle != kNoTriangle ? Part{Part::Kind::triangle, triangle, 0} : Part{Part::Kind::node, node, 0};
}

Candidate Candidates::of(const Contact& c) const noexcept {
    const uint64_t id = exchanged ? id_of(c.b, c.a) : id_of(c.a, c.b);
    return {.middle = c.middle,
            .depth = c.depth,
            .id = id,
            .known = last.knows(id, c.normal),
            .normal = c.normal,
            .pair = c.pair};
}

TouchingBodies::TouchingBodies(const OrderedBodies<Pose>& bodies, const RelativePose& pose_b_to_a, float as_near,
                               const Budget& budget, const DividedScratch& scratch, double one_point) noexcept
    : tree_a(bodies.a), tree_b(bodies.b), b_to_a(pose_b_to_a), margin(as_near), same_point(one_point),
      closed_a(is_closed(tree_a)), closed_b(is_closed(tree_b)), place_a_(bodies.place_a), place_b_(bodies.place_b),
      budget_(budget), context_(scratch.least),
      hills_a_(tree_a, budget.others, budget.most, scratch.rest.first(scratch.rest.size() / 2)),
      hills_b_(tree_b, budget.others, budget.most, scratch.rest.subspan(scratch.rest.size() / 2)) {}

Surrounded TouchingBodies::surrounded_a(uint32_t triangle) const noexcept {
    return {.triangle = place(tree_a, triangle),
            .closed = closed_a,
            .hills = &hills_a_,
            .corners = tree_a.triangle(triangle)};
}

Surrounded TouchingBodies::surrounded_b(uint32_t triangle) const noexcept {
    return {.triangle = place(tree_b, triangle, b_to_a),
            .closed = closed_b,
            .hills = &hills_b_,
            .corners = tree_b.triangle(triangle),
            .rotation = &b_to_a.rotation};
}

Contact TouchingBodies::contact_of(const TriangleContact& found, uint32_t point,
                                   const MeetingPair& pair) const noexcept {
    const TriangleContact::Point& p = found.points[point];
    const bool beside = p.of_a == kFace && p.of_b == kFace;
    const auto part = [beside](const TreeView& tree, uint32_t triangle, Feature feature) {
        return beside ? whole_of(0, triangle) : part_of(tree, triangle, feature);
    };
    return {.pair = pair,
            .normal = found.normal,
            .middle = 0.5 * (p.on_a + p.on_b),
            .depth = p.depth,
            .a = part(tree_a, pair.triangle_a, p.of_a),
            .b = part(tree_b, pair.triangle_b, p.of_b),
            .overlap = found.overlap};
}

ContactsOfPair TouchingBodies::contacts_of(const TriangleContact& found, const MeetingPair& pair) const noexcept {
    ContactsOfPair out;
    out.certain = found.faces;
    for (uint32_t i = 0; i < found.count; ++i) out.add(contact_of(found, i, pair));
    return out;
}

// ---- the way out ----

// Around two of their vertices, which it moves to the tops of their climbs; what is above `enough` may be too little.
double TouchingBodies::overlap(const dvec3& n, uint32_t& vertex_a, uint32_t& vertex_b, double enough) const noexcept {
    Climb a{&hills_a_, n, vertex_a, vertex_a, kClimbSteps},
        b{&hills_b_, -(n * b_to_a.rotation), vertex_b, vertex_b, kClimbSteps};
    const dvec3 at_a = position(tree_a, vertex_a),
                at_b = b_to_a.rotation * position(tree_b, vertex_b) + b_to_a.translation;
    double sum = glm::dot(n, at_a - at_b);
    while (sum <= enough && a.steps_left > 0) sum += a.step();
    while (sum <= enough && b.steps_left > 0) sum += b.step();
    vertex_a = a.vertex, vertex_b = b.vertex;
    return sum;
}

double TouchingBodies::overlap(const dvec3& n, const MeetingPair& pair, double enough) const noexcept {
    const Surrounded a = surrounded_a(pair.triangle_a), b = surrounded_b(pair.triangle_b);
    uint32_t vertex_a = a.corners[a.highest(n)], vertex_b = b.corners[b.highest(-n)];
    return overlap(n, vertex_a, vertex_b, enough);
}

// Finely meshed curved bodies have as many normals as triangles that meet, all around the place where they are deepest:
// from their mean on, the direction is turned to where they overlap least, by the parabolas through the overlaps of a
// pattern of directions (Hooke and Jeeves 1961, with the step of Powell 1964).
Way TouchingBodies::shortest_way(const dvec3& from, const MeetingPair& pair, double most) const noexcept {
    const Surrounded a = surrounded_a(pair.triangle_a), b = surrounded_b(pair.triangle_b);
    dvec3 best = from;
    uint32_t vertex_a = a.corners[a.highest(best)], vertex_b = b.corners[b.highest(-best)];
    double least = overlap(best, vertex_a, vertex_b, most);
    if (!(least <= most)) return {from, HUGE_VAL}; // around here the bodies are not convex
    double tilt = kFirstTilt;
    for (int round = 0; round < kTiltRounds && tilt > kLeastTilt; ++round) {
        const dvec3 center = best, x = perpendicular(center), y = glm::cross(center, x);
        const double here = least;
        const auto look = [&](double along_x, double along_y) {
            const dvec3 n = glm::normalize(center + along_x * x + along_y * y);
            uint32_t of_a = vertex_a, of_b = vertex_b;
            const double found = overlap(n, of_a, of_b, 4 * std::abs(here) + same_point);
            if (found < least && glm::dot(n, from) > kFacing) best = n, least = found, vertex_a = of_a, vertex_b = of_b;
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
    return {best, least};
}

dvec3 TouchingBodies::shortest_way(const Patch& patch) const noexcept {
    const dvec3 mean = patch.normal();
    const MeetingPair& pair = patch.deepest().pair;
    if (!patch.mixed() || pair.triangle_a == kNoTriangle || pair.triangle_b == kNoTriangle) return mean;
    return shortest_way(mean, pair, patch.overlap() + same_point).normal;
}

// ---- the deepest points ----

namespace {

// Calls visit(candidate) for what a patch keeps of pairs of triangles.
template <class Visit> void for_each_of_triangles(const Patch& patch, Visit&& visit) {
    const Candidate* all[Patch::kSieve];
    const uint32_t count = patch.kept(all);
    for (uint32_t i = 0; i < count; ++i)
        if (all[i]->pair.triangle_a != kNoTriangle && all[i]->pair.triangle_b != kNoTriangle) visit(*all[i]);
}

} // namespace

// From the pairs of a patch the bodies are climbed along its normal to what is deepest around there, and a ray from it
// finds the other body's surface.
void TouchingBodies::deepest(const Patch& patch, const Way& way, const ContactSink& out) noexcept {
    for (const bool of_a : {true, false}) {
        uint32_t seen[2 * Patch::kSieve], count = 0; // vertices
        const auto look = [&](const MeetingPair& pair, const dvec3& along) {
            const Surrounded around = of_a ? surrounded_a(pair.triangle_a) : surrounded_b(pair.triangle_b);
            const dvec3 up = of_a ? along : -along; // out of the body
            Climb climb = around.climb(around.highest(up), up);
            while (climb.steps_left > 0) climb.step();
            if (std::find(seen, seen + count, climb.vertex) != seen + count) return;
            seen[count++] = climb.vertex;
            add_depth_of(climb.vertex, of_a, pair, way, out);
        };
        for_each_of_triangles(patch, [&](const Candidate& c) {
            look(c.pair, way.normal);
            if (!(glm::dot(c.normal, way.normal) > kSameAsFace)) look(c.pair, c.normal); // in a hollow of faces
        });
    }
}

std::optional<Way> TouchingBodies::between_nearest() noexcept {
    const auto a = tree_a.rounded(0), b = tree_b.rounded(0); // their cores
    if (!a || !b) return {};
    const DistanceResult found =
        distance(*a, place_a_, *b, place_b_, context_, {.max_distance = margin, .max_pair_tests = budget_.left()});
    budget_.others += found.stats.tests();
    const dvec3 normal(found.normal.x, found.normal.y, found.normal.z); // in the world
    if (found.verdict != Verdict::separated || !(found.upper <= margin) || normal == dvec3(0)) return {};
    return Way{glm::normalize(normal * relative_pose(Pose{}, place_a_).rotation), -found.upper};
}

// From the corners of a pair's triangles on, always to the neighbour that lies deepest, where climbs would go on
// outside the other body: of a ring in a ring, along its inside and around to the far side.
TouchingBodies::Inside TouchingBodies::deepest_inside(const Patch& patch, const Way& way,
                                                      const ContactSink& out) noexcept {
    struct Depth {
        uint32_t vertex;
        double depth; // below 0: it lies outside
    };
    Exit exits[2] = {{-1, dvec3(0), dvec3(0)}, {-1, dvec3(0), dvec3(0)}}; // of b, of a
    for (const bool of_a : {true, false}) {
        const Hills& hills = of_a ? hills_a_ : hills_b_;
        Depth known[kInside];
        uint32_t count = 0;
        for_each_of_triangles(patch, [&](const Candidate& c) {
            Depth deepest{kNoTriangle, -1};
            const auto look = [&](uint32_t vertex) {
                const Depth* at =
                    std::find_if(known, known + count, [vertex](const Depth& d) { return d.vertex == vertex; });
                if (at == known + count) {
                    if (count == kInside) return;
                    const Exit exit = add_depth_of(vertex, of_a, c.pair, way, out);
                    if (exit.depth > exits[of_a].depth) exits[of_a] = exit;
                    known[count++] = {vertex, exit.depth};
                }
                if (at->depth > deepest.depth) deepest = *at;
            };
            for (const uint32_t v : (of_a ? surrounded_a(c.pair.triangle_a) : surrounded_b(c.pair.triangle_b)).corners)
                look(v);
            for (uint32_t from = kNoTriangle; deepest.vertex != from && deepest.depth >= 0;) {
                from = deepest.vertex;
                uint32_t neighbours[kNeighbours];
                std::for_each_n(neighbours, hills.neighbours(from, neighbours), look);
            }
        });
    }
    const auto& [of_b, of_a] = exits;
    const Exit& deepest = of_a.depth > of_b.depth ? of_a : of_b;
    const bool both = std::min(of_a.depth, of_b.depth) >= 0;
    return {deepest.face, both ? glm::dot(way.normal, of_a.at - of_b.at) : deepest.depth};
}

// Of a vertex of the one body, as it lies in the other along the way, by no more than that.
TouchingBodies::Exit TouchingBodies::add_depth_of(uint32_t vertex, bool of_a, const MeetingPair& pair, const Way& way,
                                                  const ContactSink& out) {
    const Exit none{-1, dvec3(0), dvec3(0)};
    const dvec3 up = of_a ? way.normal : -way.normal;
    const dvec3 here = position(of_a ? tree_a : tree_b, vertex);
    const dvec3 at = of_a ? here : b_to_a.rotation * here + b_to_a.translation;
    // Cast in the other body's frame, against `up`.
    const RelativePose a_to_b = inverse(b_to_a);
    const dvec3 start = of_a ? a_to_b.rotation * at + a_to_b.translation : at;
    const dvec3 direction = of_a ? -(a_to_b.rotation * up) : -up;
    const RaycastResult hit = raycast(of_a ? tree_b : tree_a, Pose{},
                                      {to_float(start), to_float(direction), static_cast<float>(way.depth) + 1},
                                      context_, {.max_pair_tests = budget_.left()});
    budget_.others += hit.stats.pair_tests + hit.stats.triangle_tests;
    if (hit.triangle == kNoTriangle) return none;
    MeetingPair found = pair;
    (of_a ? found.triangle_b : found.triangle_a) = hit.triangle;
    const PlacedTriangle t = of_a ? triangle_b(found) : triangle_a(found);
    const dvec3 face = face_normal(t);
    const double facing = -glm::dot(face, up); // of the outside, which the ray must leave through
    if (!((of_a ? closed_b : closed_a) ? facing > 0 : facing != 0)) return none;
    const double depth = glm::dot(face, t.corner[0] - at) / facing;
    if (!(depth >= 0 && depth <= way.depth + same_point)) return none;
    const Part part{Part::Kind::vertex, vertex, 0}, other{Part::Kind::face, 0, 0};
    out({.pair = pair,
         .normal = way.normal,
         .middle = at - 0.5 * depth * up,
         .depth = depth,
         .a = of_a ? part : other,
         .b = of_a ? other : part,
         .overlap = depth});
    return {depth, face / glm::length(face), at};
}

} // namespace prolate::query
