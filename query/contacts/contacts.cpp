// Contact manifolds: all pairs of leaves that meet, as collide_all() finds them, each turned into points with a normal
// (triangle_contact.hpp, gap.hpp), and all of these into a few manifolds (manifold.hpp).
//
// The pairs are gone through twice. The first time for the normals: of each pair that along which its surroundings
// overlap least (triangle_contact.hpp), if that is less than what a patch found before needs to resolve it, that is, to
// have it parted once the bodies are moved along the patch's normal. Normals of faces make patches, others wait and
// count if no patch resolves them that is no deeper. Then the deepest vertices of each patch are found, and patches all
// of which another one resolves are dropped. The second time for the points: of each pair along the normal of the first
// patch that resolves it. (Compare Terdiman's "voided features", which Bullet and Jolt have in variants.)
//
// Complexity: twice collide_all()'s, and some microseconds for each pair that meets; for each patch up to 18 climbs and
// rays.
#include "query/collide/search.hpp"
#include "query/contacts/manifold.hpp"
#include "query/ellipsoid/convert.hpp"
#include "query/ellipsoid/gap.hpp"
#include "query/triangle/climb.hpp"
#include "query/triangle/contact.hpp"
#include "query/triangle/ellipsoid_distance.hpp"

#include <prolate/contacts.hpp>
#include <prolate/raycast.hpp>

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <cmath>
#include <utility>

namespace prolate {
namespace query {
namespace {

using glm::dvec3;

constexpr double kTolerance = 1e-7;    // of the smaller ellipsoid: how exact depths are
constexpr double kSamePoint = 1e-4;    // of the smaller body: what is nearer is one point
constexpr double kSameFace = 0.9;      // cosine: a face turned farther from a normal has no points along it
constexpr double kSameAsFace = 0.9999; // cosine: a normal that is the face's
constexpr double kSlack = 0.25;        // of a depth: the normals of curved bodies are means, and no exact ones
constexpr double kFirstTilt = 0.1, kLeastTilt = 1e-3; // radians, about: steps of the search for the shortest way
constexpr int kTiltRounds = 8;
constexpr double kSameNormal = 0.8; // cosine: normals of a point in two queries, if it is the same

// The finisher of SplitMix64 (Steele, Lea, Flood 2014).
uint64_t mixed(uint64_t x) {
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
    return x ^ (x >> 31);
}

// What of one body touches, for an id.
struct Part {
    enum class Kind : uint32_t { vertex = 1, edge, face, triangle, node } kind;
    uint32_t first = 0, second = 0;
};
uint64_t id_of(const Part& a, const Part& b) {
    uint64_t h = 0;
    for (const Part& p : {a, b}) {
        h = mixed(h + 0x9e3779b97f4a7c15u + static_cast<uint32_t>(p.kind));
        h = mixed(h ^ (uint64_t{p.first} << 32 | p.second));
    }
    return h;
}
Part part_of(const TreeView& tree, uint32_t triangle, Feature feature) {
    const Triangle v = tree.triangle(triangle);
    if (feature < kFirstEdge) return {Part::Kind::vertex, v[feature]};
    if (feature == kFace) return {Part::Kind::face};
    const size_t i = feature - kFirstEdge;
    const auto [first, second] = std::minmax(v[i], v[(i + 1) % 3]);
    return {Part::Kind::edge, first, second};
}

// A way in which a pair touches.
struct Contact {
    MeetingPair pair;
    dvec3 normal, middle;
    double depth;
    Part a, b;
    double overlap; // of the bodies around the pair
};

dvec3 perpendicular(const dvec3& n) {
    return glm::normalize(glm::cross(n, std::abs(n.x) < 0.6 ? dvec3(1, 0, 0) : dvec3(0, 1, 0)));
}

class Collector {
public:
    Collector(CollideSearch& search, QueryContext& context, bool swapped, const ContactManifolds& last,
              const RelativePose& to_world)
        : s_(search), context_(context), swapped_(swapped), last_(last), closed_a_(closed(search.a.tree)),
          closed_b_(closed(search.b.tree)), hills_a_(search.a.tree, search.other_tests, search.options.max_pair_tests),
          hills_b_(search.b.tree, search.other_tests, search.options.max_pair_tests),
          size_(std::min(place(s_.a.tree.root()).size, place(s_.b.tree.root()).size)), patches_(kSamePoint * size_) {
        for (uint32_t i = 0; i < std::min(last.count, kManifolds); ++i) {
            const Vec3& n = last.manifolds[i].normal;
            const dvec3 here = dvec3(n.x, n.y, n.z) * to_world.rotation; // the transpose times it
            last_normals_[i] = swapped ? -here : here;
            patches_.expect(last_normals_[i]);
        }
        search.each = [](void* self, const MeetingPair& pair) { static_cast<Collector*>(self)->add(pair); };
        search.each_user = this;
    }
    // Between the two passes: settles the normals and depths.
    void settle() {
        flush();
        struct Group {
            const Patch* patch;
            Way way;
            Patch deepest;
        };
        Group groups[Patches::kMost];
        uint32_t count = 0;
        patches_.for_each([&](const Patch& p) {
            const dvec3 n = shortest_way(p);
            Group group{&p, {n, p.depth()}, Patch(n)};
            add_deepest(p, n, group.deepest);
            group.way.depth = std::max(group.way.depth, group.deepest.depth());
            uint32_t at = count++; // the deepest first
            for (; at > 0 && group.way.depth > groups[at - 1].way.depth; --at) groups[at] = groups[at - 1];
            groups[at] = group;
        });
        // Are all pairs of the one parted along the other, and all its deepest points?
        const auto covers = [&](const Group& other, const Group& one) {
            const dvec3& n = other.way.normal;
            const double depth = other.way.depth + kSlack * std::abs(other.way.depth);
            return std::all_of(one.patch->begin(), one.patch->end(),
                               [&](const Candidate& c) { return resolves(n, depth, c.pair); }) &&
                   (one.deepest.empty() ||
                    glm::dot(n, one.way.normal) * one.deepest.depth() <= depth + patches_.apart());
        };
        bool needed[Patches::kMost];
        std::fill_n(needed, count, true);
        for (uint32_t i = 0; i < count; ++i)
            for (uint32_t j = 0; j < count && needed[i]; ++j)
                if (j != i && needed[j]) needed[i] = !covers(groups[j], groups[i]);
        for (uint32_t i = 0; i < count && ways_ < kManifolds; ++i)
            if (needed[i]) way_[ways_] = groups[i].way, points_[ways_] = groups[i].deepest, ++ways_;
        settled_ = true;
    }
    // After both: patches with points, at least one if any pair met.
    uint32_t patches(const Patch* (&out)[kManifolds]) {
        uint32_t count = 0;
        for (uint32_t i = 0; i < ways_; ++i)
            if (!points_[i].empty()) out[count++] = &points_[i];
        if (count > 0 || s_.found == 0) return count;
        const Contact c = last_resort();
        points_[0] = Patch(c.normal);
        points_[0].add(c.normal, candidate(c), 0, c.overlap, patches_.apart());
        out[0] = &points_[0];
        return 1;
    }
    double apart() const { return patches_.apart(); }

private:
    struct Way {
        dvec3 normal;
        double depth;
    };
    static bool closed(const TreeView& tree) { return tree.has_triangles() && !tree.surface_mode(); }

    void add(const MeetingPair& pair) {
        if (!settled_) {
            if (s_.found == 0) first_ = pair;
            KnownOverlap known;
            patches_.for_each([&](const Patch& p) {
                if (p.overlap() < known.overlap && resolves(p.normal(), p.overlap(), pair))
                    known = {p.normal(), p.overlap()};
            });
            return own(pair, known, [&](const Contact& c, bool certain) {
                // What is no better than what resolves it gives points, not a direction.
                if (certain) return take(c, c.overlap <= known.overlap + patches_.apart());
                if (waiting_count_ == kWaiting) flush();
                waiting_[waiting_count_++] = c;
            });
        }
        if (pair.triangle_a != kNoTriangle || pair.triangle_b != kNoTriangle)
            for (uint32_t i = 0; i < ways_; ++i)
                if (resolves(way_[i].normal, way_[i].depth, pair) && along(way_[i].normal, pair, points_[i])) return;
        own(pair, {}, [&](const Contact& c, bool) {
            for (uint32_t i = 0; i < ways_; ++i)
                if (points_[i].takes(c.normal))
                    return points_[i].add(c.normal, candidate(c), 0, c.overlap, patches_.apart());
        });
    }

    // Is the pair parted once the bodies are moved by this depth along n?
    bool resolves(const dvec3& n, double depth, const MeetingPair& pair) const {
        const double high =
            pair.triangle_a != kNoTriangle ? highest(triangle_a(pair), n) : highest(ellipsoid_a(pair), n);
        const double low =
            pair.triangle_b != kNoTriangle ? -highest(triangle_b(pair), -n) : -highest(ellipsoid_b(pair), -n);
        return high - low <= depth + patches_.apart();
    }

    PlacedTriangle triangle_a(const MeetingPair& pair) const { return place(s_.a.tree, pair.triangle_a); }
    PlacedTriangle triangle_b(const MeetingPair& pair) const { return place(s_.b.tree, pair.triangle_b, s_.b_to_a); }
    PlacedEllipsoid ellipsoid_a(const MeetingPair& pair) const { return place(s_.a.tree.ellipsoid(pair.node_a)); }
    PlacedEllipsoid ellipsoid_b(const MeetingPair& pair) const {
        return place(s_.b.tree.ellipsoid(pair.node_b), s_.b_to_a);
    }
    Surrounded surrounded_a(uint32_t triangle) const {
        return {place(s_.a.tree, triangle), closed_a_, &hills_a_, s_.a.tree.triangle(triangle)};
    }
    Surrounded surrounded_b(uint32_t triangle) const {
        return {place(s_.b.tree, triangle, s_.b_to_a), closed_b_, &hills_b_, s_.b.tree.triangle(triangle),
                &s_.b_to_a.rotation};
    }
    static Part whole(uint32_t node, uint32_t triangle) {
        return triangle != kNoTriangle ? Part{Part::Kind::triangle, triangle} : Part{Part::Kind::node, node};
    }
    static double highest(const PlacedTriangle& t, const dvec3& n) {
        return std::max({glm::dot(n, t.corner[0]), glm::dot(n, t.corner[1]), glm::dot(n, t.corner[2])});
    }
    static double highest(const PlacedEllipsoid& e, const dvec3& n) {
        return glm::dot(n, e.center) + glm::length(n * e.factor);
    }

    // ---- points along the normal of a patch; false if the pair should speak for itself ----

    bool along(const dvec3& n, const MeetingPair& pair, Patch& patch) const {
        const auto put = [&](const Contact& c) { patch.add(n, candidate(c), 0, c.overlap, patches_.apart()); };
        if (pair.triangle_a != kNoTriangle && pair.triangle_b != kNoTriangle) {
            const TriangleContact found = contact_along(n, triangle_a(pair), triangle_b(pair), s_.options.margin);
            for_each_point(found, pair, put);
            return found.faces;
        }
        const bool in_a = pair.triangle_a != kNoTriangle;
        const PlacedTriangle t = in_a ? triangle_a(pair) : triangle_b(pair);
        const PlacedEllipsoid e = in_a ? ellipsoid_b(pair) : ellipsoid_a(pair);
        const dvec3 up = in_a ? n : -n, w = up * e.factor,
                    face = glm::cross(t.corner[1] - t.corner[0], t.corner[2] - t.corner[0]);
        const double facing = glm::dot(face, up);
        if (!(std::abs(facing) > kSameFace * glm::length(face))) return false;
        const dvec3 lowest = e.center - e.factor * (w / glm::length(w));
        const double depth = glm::dot(face, t.corner[0] - lowest) / facing;
        const dvec3 below = lowest + depth * up;
        for (size_t i = 0; i < 3; ++i) // what lies beside the triangle is its neighbours'
            if (glm::dot(face, glm::cross(t.corner[(i + 1) % 3] - t.corner[i], below - t.corner[i])) < 0) return true;
        if (depth >= -s_.options.margin)
            put({pair, n, 0.5 * (lowest + below), depth, whole(pair.node_a, pair.triangle_a),
                 whole(pair.node_b, pair.triangle_b), depth});
        return true;
    }
    template <class Put> void for_each_point(const TriangleContact& found, const MeetingPair& pair, Put&& put) const {
        for (uint32_t i = 0; i < found.count; ++i) {
            const TriangleContact::Point& p = found.points[i];
            const bool beside = p.of_a == kFace && p.of_b == kFace;
            const auto part = [beside](const TreeView& tree, uint32_t triangle, Feature feature) {
                return beside ? whole(0, triangle) : part_of(tree, triangle, feature);
            };
            put(Contact{pair, found.normal, 0.5 * (p.on_a + p.on_b), p.depth, part(s_.a.tree, pair.triangle_a, p.of_a),
                        part(s_.b.tree, pair.triangle_b, p.of_b), found.overlap});
        }
    }

    // ---- what a pair says for itself: use(contact, certain), if it is not much longer than the known way ----

    template <class Use> void own(const MeetingPair& pair, const KnownOverlap& known, Use&& use) const {
        const bool in_a = pair.triangle_a != kNoTriangle, in_b = pair.triangle_b != kNoTriangle;
        if (in_a && in_b) {
            const TriangleContact found =
                contact(surrounded_a(pair.triangle_a), surrounded_b(pair.triangle_b), s_.options.margin, known);
            return for_each_point(found, pair, [&](const Contact& c) { use(c, found.faces); });
        }
        if (in_a) return own_mixed(pair, surrounded_a(pair.triangle_a), ellipsoid_b(pair), 1, use);
        if (in_b) return own_mixed(pair, surrounded_b(pair.triangle_b), ellipsoid_a(pair), -1, use);
        const PlacedEllipsoid x = ellipsoid_a(pair), y = ellipsoid_b(pair);
        const double tolerance = kTolerance * std::min(x.size, y.size);
        Gap gap = distance_of(x, y, tolerance);
        if (!(gap.lower > 0)) gap = depth_of(x, y, tolerance, gap.normal);
        use(Contact{pair, gap.normal, 0.5 * (gap.point_a + gap.point_b), -gap.lower, whole(pair.node_a, kNoTriangle),
                    whole(pair.node_b, kNoTriangle), -gap.lower},
            true);
    }
    // A triangle and an ellipsoid; `sign`: 1 if the triangle is A's, so that normals lead from it, else -1.
    template <class Use>
    void own_mixed(const MeetingPair& pair, const Surrounded& around, const PlacedEllipsoid& e, double sign,
                   Use&& use) const {
        const PlacedTriangle& t = around.triangle;
        const dvec3 face = glm::cross(t.corner[1] - t.corner[0], t.corner[2] - t.corner[0]);
        const auto hand_on = [&](const dvec3& n, const dvec3& middle, double depth) {
            const bool of_face = std::abs(glm::dot(n, face)) > kSameAsFace * glm::length(face);
            use(Contact{pair, sign * n, middle, depth, whole(pair.node_a, pair.triangle_a),
                        whole(pair.node_b, pair.triangle_b), depth},
                of_face);
        };
        const TriangleDistance d = distance(t, e);
        const dvec3 between = d.on_b - d.on_a;
        const double length = glm::length(between);
        if (d.lower > 0) return hand_on(between / length, 0.5 * (d.on_a + d.on_b), -length);
        // In each other: the least depth along the face's normal, or away from the nearest points of the edges, unless
        // the surface goes on there.
        double least = HUGE_VAL;
        dvec3 best(0, 0, 1), deepest = e.center;
        const auto consider = [&](const dvec3& v, bool of_face) {
            const double size = glm::length(v);
            if (!(size > 0)) return;
            const dvec3 n = v / size, w = n * e.factor;
            double depth = highest(t, n) - (glm::dot(n, e.center) - glm::length(w));
            Climb climb = around.climb(around.highest(n), n);
            while (!of_face && depth < least && climb.steps_left > 0) depth += climb.step();
            if (depth < least) least = depth, best = n, deepest = e.center - e.factor * (w / glm::length(w));
        };
        consider(face, true);
        if (!around.closed) consider(-face, true);
        for (size_t i = 0; i < 3; ++i) {
            const dvec3 edge = t.corner[(i + 1) % 3] - t.corner[i], from = e.center - t.corner[i];
            const double square = glm::dot(edge, edge);
            const double s = square > 0 ? std::clamp(glm::dot(from, edge) / square, 0.0, 1.0) : 0;
            const dvec3 away = from - s * edge;
            if (!around.closed || glm::dot(away, face) > 0) consider(away, false);
        }
        hand_on(best, deepest + 0.5 * least * best, least);
    }
    // ---- the way out of curved bodies ----

    // What the bodies overlap by along n around two of their vertices, which it moves to the tops of their climbs; what
    // is above `enough` may be too little.
    double overlap(const dvec3& n, uint32_t& vertex_a, uint32_t& vertex_b, double enough) const {
        Climb a{&hills_a_, n, vertex_a, vertex_a, kClimbSteps},
            b{&hills_b_, -(n * s_.b_to_a.rotation), vertex_b, vertex_b, kClimbSteps};
        const dvec3 at_a = to_double(s_.a.tree.vertex(vertex_a)),
                    at_b = s_.b_to_a.rotation * to_double(s_.b.tree.vertex(vertex_b)) + s_.b_to_a.translation;
        double sum = glm::dot(n, at_a - at_b);
        while (sum <= enough && a.steps_left > 0) sum += a.step();
        while (sum <= enough && b.steps_left > 0) sum += b.step();
        vertex_a = a.vertex, vertex_b = b.vertex;
        return sum;
    }

    // The normal of a patch. Finely meshed curved bodies have as many normals as triangles that meet, all around the
    // place where they are deepest: from their mean on, the direction is turned to where they overlap least, by the
    // parabolas through the overlaps of a pattern of directions (Hooke and Jeeves 1961, with the step of Powell 1964).
    dvec3 shortest_way(const Patch& patch) const {
        const dvec3 mean = patch.normal();
        const MeetingPair& pair = patch.begin()->pair;
        if (!patch.mixed() || pair.triangle_a == kNoTriangle || pair.triangle_b == kNoTriangle) return mean;
        const Surrounded a = surrounded_a(pair.triangle_a), b = surrounded_b(pair.triangle_b);
        dvec3 best = mean;
        uint32_t vertex_a = a.corners[a.highest(best)], vertex_b = b.corners[b.highest(-best)];
        const double most = patch.overlap() + patches_.apart();
        double least = overlap(best, vertex_a, vertex_b, most);
        if (!(least <= most)) return mean; // around here the bodies are not convex
        double tilt = kFirstTilt;
        for (int round = 0; round < kTiltRounds && tilt > kLeastTilt; ++round) {
            const dvec3 center = best, x = perpendicular(center), y = glm::cross(center, x);
            const double here = least;
            const auto look = [&](double along_x, double along_y) {
                const dvec3 n = glm::normalize(center + along_x * x + along_y * y);
                uint32_t of_a = vertex_a, of_b = vertex_b;
                const double found = overlap(n, of_a, of_b, 4 * std::abs(here) + patches_.apart());
                if (found < least && glm::dot(n, mean) > kSameFace)
                    best = n, least = found, vertex_a = of_a, vertex_b = of_b;
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

    // What of a finely meshed body is deepest in the other meets no triangle. From the pairs of a patch the bodies are
    // climbed along its normal to what is deepest around there, and a ray from it finds the other body's surface.
    void add_deepest(const Patch& from, const dvec3& n, Patch& to) {
        for (const bool of_a : {true, false}) {
            uint32_t seen[2 * Patch::kSieve], count = 0; // vertices
            const auto look = [&](const MeetingPair& pair, const dvec3& along) {
                const Surrounded around = of_a ? surrounded_a(pair.triangle_a) : surrounded_b(pair.triangle_b);
                const dvec3 up = of_a ? along : -along; // out of the body
                Climb climb = around.climb(around.highest(up), up);
                while (climb.steps_left > 0) climb.step();
                if (std::find(seen, seen + count, climb.vertex) != seen + count) return;
                seen[count++] = climb.vertex;
                add_deepest(pair, climb.vertex, n, from.overlap(), of_a, to);
            };
            for (const Candidate& c : from) {
                if (c.pair.triangle_a == kNoTriangle || c.pair.triangle_b == kNoTriangle) continue;
                look(c.pair, n);
                if (!(glm::dot(c.normal, n) > kSameAsFace)) look(c.pair, c.normal); // in a hollow of faces
            }
        }
    }
    // A vertex of the one body that lies in the other, its place in A's frame.
    void add_deepest(const MeetingPair& pair, uint32_t vertex, const dvec3& n, double most, bool of_a, Patch& to) {
        const dvec3 up = of_a ? n : -n;
        const dvec3 here = to_double((of_a ? s_.a : s_.b).tree.vertex(vertex));
        const dvec3 at = of_a ? here : s_.b_to_a.rotation * here + s_.b_to_a.translation;
        // Cast in the other body's frame, against `up`.
        const RelativePose a_to_b = inverse(s_.b_to_a);
        const dvec3 start = of_a ? a_to_b.rotation * at + a_to_b.translation : at;
        const dvec3 direction = of_a ? -(a_to_b.rotation * up) : -up;
        const RaycastResult hit = raycast((of_a ? s_.b : s_.a).tree, Pose{},
                                          {to_float(start), to_float(direction), static_cast<float>(most) + 1},
                                          context_, {.max_pair_tests = s_.left()});
        s_.other_tests += hit.stats.pair_tests + hit.stats.triangle_tests;
        if (hit.triangle == kNoTriangle) return;
        MeetingPair found = pair;
        (of_a ? found.triangle_b : found.triangle_a) = hit.triangle;
        const PlacedTriangle t = of_a ? triangle_b(found) : triangle_a(found);
        const dvec3 face = glm::cross(t.corner[1] - t.corner[0], t.corner[2] - t.corner[0]);
        const double facing = -glm::dot(face, up); // of the outside, which the ray must leave through
        if (!((of_a ? closed_b_ : closed_a_) ? facing > 0 : facing != 0)) return;
        const double depth = glm::dot(face, t.corner[0] - at) / facing;
        if (!(depth >= 0 && depth <= most + patches_.apart())) return;
        const Part part{Part::Kind::vertex, vertex}, other{Part::Kind::face};
        to.add(n, candidate({pair, n, at - 0.5 * depth * up, depth, of_a ? part : other, of_a ? other : part, depth}),
               0, depth, patches_.apart());
    }

    // The first pair's, through whatever side.
    Contact last_resort() {
        closed_a_ = closed_b_ = false;
        Contact out{first_,
                    {0, 0, 1},
                    {0, 0, 0},
                    0,
                    whole(first_.node_a, first_.triangle_a),
                    whole(first_.node_b, first_.triangle_b),
                    0};
        bool any = false;
        own(first_, {}, [&](const Contact& c, bool) {
            if (!any) out = c, any = true;
        });
        if (any) return out;
        const TriangleDistance d = distance(triangle_a(first_), triangle_b(first_));
        out.middle = 0.5 * (d.on_a + d.on_b);
        return out;
    }

    Candidate candidate(const Contact& c) const {
        Candidate out{c.middle, c.depth, swapped_ ? id_of(c.b, c.a) : id_of(c.a, c.b), false, c.normal, c.pair};
        for (uint32_t i = 0; i < std::min(last_.count, kManifolds); ++i) {
            const Manifold& m = last_.manifolds[i];
            const bool alike = glm::dot(last_normals_[i], c.normal) > kSameNormal;
            for (uint32_t k = 0; k < std::min(m.count, kManifoldPoints) && alike; ++k)
                out.known = out.known || m.points[k].id == out.id;
        }
        return out;
    }
    void take(const Contact& c, bool with_normal) {
        const double weight = with_normal ? std::max(0.0, c.depth + s_.options.margin) + kTolerance * size_ : 0;
        patches_.add(c.normal, candidate(c), weight, with_normal ? c.overlap : -HUGE_VAL);
    }
    // What waits counts if no patch resolves it, or only one that is deeper than the pair.
    void flush() {
        for (uint32_t i = 0; i < waiting_count_; ++i) {
            const Contact& c = waiting_[i];
            bool resolved = false;
            patches_.for_each([&](const Patch& p) {
                resolved = resolved || (resolves(p.normal(), p.overlap(), c.pair) &&
                                        (c.overlap < 0 || p.overlap() <= c.overlap + patches_.apart()));
            });
            if (!resolved) take(c, true);
        }
        waiting_count_ = 0;
    }

    CollideSearch& s_;
    QueryContext& context_; // free between the passes
    const bool swapped_;
    const ContactManifolds& last_;
    bool closed_a_, closed_b_, settled_ = false;
    const Hills hills_a_, hills_b_;
    const double size_;
    dvec3 last_normals_[kManifolds];
    MeetingPair first_;
    Patches patches_; // of the first pass, for their normals
    static constexpr uint32_t kWaiting = 128;
    Contact waiting_[kWaiting];
    uint32_t waiting_count_ = 0;
    uint32_t ways_ = 0;
    Way way_[kManifolds];
    Patch points_[kManifolds]; // of the second
};

ContactPoint point_of(const Candidate& c, const dvec3& normal, bool swapped, const RelativePose& to_world) {
    ContactPoint out;
    const auto world = [&](double along) {
        return to_float(to_world.rotation * (c.middle + along * c.depth * normal) + to_world.translation);
    };
    out.point_a = world(swapped ? -0.5 : 0.5), out.point_b = world(swapped ? 0.5 : -0.5);
    out.depth = static_cast<float>(c.depth);
    out.id = c.id;
    return out;
}

// Takes over what the last query knew of the points.
void match(Manifold& manifold, const ContactManifolds& last) {
    const auto alike = [](const Vec3& a, const Vec3& b) { return a.x * b.x + a.y * b.y + a.z * b.z > kSameNormal; };
    for (uint32_t i = 0; i < manifold.count; ++i) {
        ContactPoint& p = manifold.points[i];
        for (uint32_t j = 0; j < std::min(last.count, kManifolds); ++j) {
            const Manifold& m = last.manifolds[j];
            if (!alike(m.normal, manifold.normal)) continue;
            for (uint32_t k = 0; k < std::min(m.count, kManifoldPoints); ++k) {
                if (m.points[k].id != p.id) continue;
                p.age = m.points[k].age + 1;
                std::copy_n(m.points[k].impulse, 3, p.impulse);
            }
        }
    }
}

// In the fixed order of bodies.
ContactResult run(CollideSearch& search, const Pose& pose_a, bool swapped, ContactManifolds& manifolds,
                  QueryContext& context) {
    const RelativePose to_world = relative_pose(Pose{}, pose_a);
    const ContactManifolds last = manifolds;
    manifolds = {};
    Collector collector(search, context, swapped, last, to_world);
    search.all = true;
    ContactResult out;
    out.verdict = decide(search);
    out.enclosed = out.verdict == Verdict::overlapping && search.found == 0;
    out.found = search.found;
    out.stats = search.stats;
    out.stats.triangle_tests += search.other_tests;
    if (!std::isfinite(search.b_to_a.distance)) return out; // no place for points

    if (search.found > 0) {
        collector.settle();
        search.found = 0, search.stats = {}, search.other_tests = 0; // what they count is known
        traverse(search);
    }
    const Patch* patches[kManifolds];
    manifolds.count = collector.patches(patches);
    for (uint32_t i = 0; i < manifolds.count; ++i) {
        Manifold& m = manifolds.manifolds[i];
        Candidate points[kManifoldPoints];
        m.count = patches[i]->reduce(collector.apart(), points);
        for (uint32_t k = 1; k < m.count; ++k) // by id
            for (uint32_t at = k; at > 0 && points[at].id < points[at - 1].id; --at)
                std::swap(points[at], points[at - 1]);
        const dvec3 normal = patches[i]->normal(), world = to_world.rotation * normal;
        m.normal = to_float(swapped ? -world : world);
        for (uint32_t k = 0; k < m.count; ++k) m.points[k] = point_of(points[k], normal, swapped, to_world);
        match(m, last);
    }
    return out;
}

} // namespace
} // namespace query

ContactResult contacts(const TreeView& a, const Pose& pose_a, const TreeView& b, const Pose& pose_b,
                       ContactManifolds& manifolds, QueryContext& context, const QueryOptions& options) noexcept {
    const auto bodies = query::in_canonical_order(a, pose_a, b, pose_b);
    query::CollideSearch search(bodies, context, options);
    return query::run(search, bodies.place_a, bodies.exchanged, manifolds, context);
}

} // namespace prolate
