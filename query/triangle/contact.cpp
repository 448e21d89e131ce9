#include "query/triangle/contact.hpp"

#include "query/triangle/distance.hpp"
#include "query/triangle/pair.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace prolate::query {
namespace {

using glm::dvec3;
using Corners = dvec3[3];

constexpr double kEdgeBias = 0.05;           // an edge's product must overlap by this share less than a face does
constexpr double kParallel = 1e-8;           // sine of an angle: edges that are nearer to parallel have no product
constexpr double kFlat = 1e-9;               // of the triangles' size: what counts as touching
constexpr double kCrossing = 1e-6;           // of the triangles' size: what edges may miss each other by
constexpr double kNoLonger = 0.25;           // share by which ways out may be longer than a known one
constexpr double kSameDirection = 1 - 1e-10; // cosine: normals that are the same but for rounding
constexpr double kAskance = 0.3; // cosine: a face that looks this much the same way as the normal is not in contact

struct Axis {
    enum class Kind : uint8_t { none, face_a, face_b, edges };
    Kind kind;
    dvec3 normal;
    double overlap; // of the triangles; of edges with what they must win by
    Feature edge_a, edge_b;
    Climb climb_a, climb_b;
};

dvec3 unit_or_zero(const dvec3& v) {
    const double length = glm::length(v);
    return length > 0 ? v / length : dvec3(0);
}

class Axes {
public:
    Axes(const TrianglePair& pair, bool closed_a, bool closed_b)
        : pair_(pair), out_a_(closed_a ? unit_or_zero(pair.normal_a) : dvec3(0)),
          out_b_(closed_b ? unit_or_zero(pair.normal_b) : dvec3(0)) {
        for (size_t i = 0; i < 3; ++i) {
            length_d_[i] = glm::length(pair.d[i]), length_e_[i] = glm::length(pair.e[i]);
            size_ = std::max({size_, length_d_[i], length_e_[i]});
        }
    }
    double touching() const { return kFlat * size_; }
    // May B be pushed along n?
    bool leads_out(const dvec3& n) const { return glm::dot(n, out_a_) >= -kAskance && glm::dot(n, out_b_) <= kAskance; }

    // That along which the surroundings overlap least; Axis::overlap is theirs.
    Axis least_overlap(const Surrounded& a, const Surrounded& b, const KnownOverlap& known) {
        for (const double sign : {1.0, -1.0}) {
            face(Axis::Kind::face_a, sign * unit_or_zero(pair_.normal_a));
            face(Axis::Kind::face_b, sign * unit_or_zero(pair_.normal_b));
        }
        for (size_t i = 0; i < 3; ++i)
            for (size_t j = 0; j < 3; ++j) edges(i, j);
        for (uint32_t i = 0; i < count_; ++i) start(axes_[i], a, b, known);
        const double limit = known.overlap + kNoLonger * std::abs(known.overlap) + touching();
        // Always the least one climbs a step: what it rises only adds to the overlap.
        while (count_ > 0) {
            Axis* const least = std::min_element(axes_, axes_ + count_,
                                                 [](const Axis& x, const Axis& y) { return x.overlap < y.overlap; });
            if (!(least->overlap < limit)) break;
            Climb* const climb = least->climb_a.steps_left > 0   ? &least->climb_a
                                 : least->climb_b.steps_left > 0 ? &least->climb_b
                                                                 : nullptr;
            if (climb == nullptr) return *least;
            least->overlap += climb->step();
        }
        Axis none{};
        none.normal = {0, 0, 1};
        return none;
    }

private:
    // A face is not climbed from.
    static void start(Axis& axis, const Surrounded& a, const Surrounded& b, const KnownOverlap& known) {
        const bool edges = axis.kind == Axis::Kind::edges;
        const dvec3& n = axis.normal;
        axis.climb_a = a.climb(edges ? axis.edge_a : a.highest(n), n);
        axis.climb_b = b.climb(edges ? axis.edge_b : b.highest(-n), -n);
        if (axis.kind == Axis::Kind::face_a) axis.climb_a.steps_left = 0;
        if (axis.kind == Axis::Kind::face_b) axis.climb_b.steps_left = 0;
        if (!(glm::dot(n, known.normal) > kSameDirection)) return;
        axis.overlap = std::max(axis.overlap, known.overlap);
        axis.climb_a.steps_left = axis.climb_b.steps_left = 0;
    }
    double overlap(const dvec3& n) const { return pair_.range_a(n).high - pair_.range_b(n).low; }
    void face(Axis::Kind kind, const dvec3& n) {
        if (n == dvec3(0) || !leads_out(n)) return;
        least_face_ = std::min(least_face_, add(kind, n, overlap(n)).overlap);
    }
    void edges(size_t i, size_t j) {
        const dvec3 product = glm::cross(pair_.d[i], pair_.e[j]);
        const double length = glm::length(product);
        if (!(length > kParallel * length_d_[i] * length_e_[j])) return;
        // Both edges must lie where the triangles are farthest.
        const TrianglePair::Range a = pair_.range_a(product), b = pair_.range_b(product);
        const double at_a = glm::dot(product, pair_.p[i]), at_b = glm::dot(product, pair_.q[j]);
        const double least = touching() * length;
        if (at_a >= a.high - least && at_b <= b.low + least) crossing(i, j, product / length);
        if (at_a <= a.low + least && at_b >= b.high - least) crossing(i, j, product / -length);
    }
    void crossing(size_t i, size_t j, const dvec3& n) {
        if (!leads_out(n)) return;
        const dvec3 &d = pair_.d[i], &e = pair_.e[j];
        // And cross, as seen along the normal.
        const auto [s, t] = closest(d, e, pair_.p[i] - pair_.q[j]);
        const dvec3 between = pair_.p[i] + s * d - (pair_.q[j] + t * e);
        if (glm::length(between - glm::dot(n, between) * n) > kCrossing * size_) return;
        const double bias = std::isfinite(least_face_) ? kEdgeBias * std::abs(least_face_) + touching() : 0;
        Axis& axis = add(Axis::Kind::edges, n, overlap(n) + bias);
        axis.edge_a = static_cast<Feature>(kFirstEdge + i), axis.edge_b = static_cast<Feature>(kFirstEdge + j);
    }
    Axis& add(Axis::Kind kind, const dvec3& n, double overlap) {
        Axis& axis = axes_[count_++];
        axis.kind = kind, axis.normal = n, axis.overlap = overlap;
        return axis;
    }

    const TrianglePair& pair_;
    const dvec3 out_a_, out_b_; // outward normals of closed meshes; else 0
    double length_d_[3], length_e_[3], size_ = 0, least_face_ = std::numeric_limits<double>::infinity();
    Axis axes_[4 + 18]; // not cleared
    uint32_t count_ = 0;
};

// A polygon cut out of a triangle. `label`: the edge that leaves the corner, 0 ... 2 of that triangle, 3 ... 5 of the
// one it is cut with.
struct Cut {
    std::array<dvec3, TriangleContact::kPoints> corner;
    std::array<uint8_t, TriangleContact::kPoints> label;
    size_t count = 0;

    void add(const dvec3& p, uint8_t edge) {
        if (count < corner.size()) corner[count] = p, label[count++] = edge;
    }
};

// What of the triangle lies over the other, whose normal and corners these are.
Cut cut(const Corners& triangle, const Corners& other, const Corners& edge, const dvec3& normal) {
    Cut polygon;
    for (uint8_t i = 0; i < 3; ++i) polygon.add(triangle[i], i);
    for (uint8_t j = 0; j < 3; ++j) {
        const dvec3 inward = glm::cross(normal, edge[j]);
        Cut kept;
        for (size_t i = 0; i < polygon.count; ++i) {
            const dvec3 &p = polygon.corner[i], &q = polygon.corner[(i + 1) % polygon.count];
            const double h = glm::dot(inward, p - other[j]), k = glm::dot(inward, q - other[j]);
            if (h >= 0) kept.add(p, polygon.label[i]);
            if ((h < 0) == (k < 0)) continue;
            kept.add(p + h / (h - k) * (q - p), h < 0 ? polygon.label[i] : static_cast<uint8_t>(3 + j));
        }
        polygon = kept;
    }
    return polygon;
}

// What the corner between two edges of a Cut is: of the triangle that was cut, and of the other.
struct CutFeatures {
    Feature of_cut, of_other;
};
CutFeatures features(uint8_t before, uint8_t after) {
    // The corner between edge i - 1 and edge i of three is i.
    if (before < 3 && after < 3) return {after, kFace};
    if (before >= 3 && after >= 3) {
        const auto x = static_cast<uint8_t>(before - 3), y = static_cast<uint8_t>(after - 3);
        return {kFace, static_cast<uint8_t>((x + 1) % 3 == y ? y : x)};
    }
    const uint8_t of_cut = std::min(before, after), other = std::max(before, after);
    return {static_cast<Feature>(kFirstEdge + of_cut), static_cast<Feature>(kFirstEdge + other - 3)};
}

// The points of a contact along `out.normal`, from TrianglePair::origin.
class Points {
public:
    Points(const TrianglePair& pair, double margin, TriangleContact& out) : pair_(pair), margin_(margin), out_(out) {}

    void add(const dvec3& x, const dvec3& y, Feature of_a, Feature of_b) {
        const double depth = glm::dot(out_.normal, x - y);
        if (depth >= -margin_ && out_.count < TriangleContact::kPoints)
            out_.points[out_.count++] = {pair_.origin + x, pair_.origin + y, depth, of_a, of_b};
    }
    // Of B on the face of A, and of A on the face of B.
    void on_face_a() {
        const dvec3& n = out_.normal;
        on_face(
            pair_.q, pair_.p, pair_.d, pair_.normal_a,
            [&](const dvec3& y, const dvec3& over, auto of_b, auto of_a) { add(over, y, of_a, of_b); }, n);
    }
    void on_face_b() {
        const dvec3& n = out_.normal;
        on_face(
            pair_.p, pair_.q, pair_.e, pair_.normal_b,
            [&](const dvec3& x, const dvec3& over, auto of_a, auto of_b) { add(x, over, of_a, of_b); }, n);
    }

private:
    template <class Take>
    static void on_face(const Corners& incident, const Corners& face, const Corners& edge, const dvec3& normal,
                        Take&& take, const dvec3& n) {
        const double along = glm::dot(normal, n);
        const Cut polygon = cut(incident, face, edge, along < 0 ? -n : n);
        for (size_t i = 0; i < polygon.count; ++i) {
            const dvec3& x = polygon.corner[i];
            const auto [of_cut, of_face] =
                features(polygon.label[(i + polygon.count - 1) % polygon.count], polygon.label[i]);
            take(x, x + glm::dot(normal, face[0] - x) / along * n, of_cut, of_face);
        }
    }

    const TrianglePair& pair_;
    const double margin_;
    TriangleContact& out_;
};

} // namespace

TriangleContact contact(const Surrounded& a, const Surrounded& b, double margin, const KnownOverlap& known) noexcept {
    const TrianglePair pair(a.triangle, b.triangle);
    Axes axes(pair, a.closed, b.closed);
    const Axis axis = axes.least_overlap(a, b, known);
    TriangleContact out{};
    out.normal = axis.normal, out.overlap = axis.overlap;
    if (axis.kind == Axis::Kind::none && known.overlap < HUGE_VAL) return out;
    Points points(pair, margin + axes.touching(), out);
    if (axis.kind == Axis::Kind::edges) {
        const size_t i = axis.edge_a - kFirstEdge, j = axis.edge_b - kFirstEdge;
        const auto [s, t] = closest(pair.d[i], pair.e[j], pair.p[i] - pair.q[j]);
        points.add(pair.p[i] + s * pair.d[i], pair.q[j] + t * pair.e[j], axis.edge_a, axis.edge_b);
    } else if (axis.kind == Axis::Kind::face_a) {
        points.on_face_a();
    } else if (axis.kind == Axis::Kind::face_b) {
        points.on_face_b();
    }
    out.faces = axis.kind != Axis::Kind::edges;
    if (out.count > 0) return out;
    // Beside each other: the closest points, if they are separated.
    const TriangleDistance nearest = distance(a.triangle, b.triangle);
    const dvec3 between = nearest.on_b - nearest.on_a;
    const double length = glm::length(between);
    if (!(nearest.lower > 0) || length > margin || !axes.leads_out(between / length)) return out;
    out.normal = between / length, out.overlap = -length, out.faces = false, out.count = 1;
    out.points[0] = {nearest.on_a, nearest.on_b, -length, kFace, kFace};
    return out;
}

TriangleContact contact_along(const dvec3& normal, const PlacedTriangle& a, const PlacedTriangle& b, double margin,
                              double facing) noexcept {
    const TrianglePair pair(a, b);
    TriangleContact out{};
    out.normal = normal;
    const double of_a = std::abs(glm::dot(normal, unit_or_zero(pair.normal_a))),
                 of_b = std::abs(glm::dot(normal, unit_or_zero(pair.normal_b)));
    Points points(pair, margin + Axes(pair, false, false).touching(), out);
    out.faces = std::max(of_a, of_b) > facing;
    if (out.faces) of_a >= of_b ? points.on_face_a() : points.on_face_b();
    return out;
}

} // namespace prolate::query
