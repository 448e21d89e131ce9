// How do two triangles that meet, or nearly do, touch, and how can their bodies be separated? For contacts; scalar,
// in double precision.
//
// The normal is one of the separating axis theorem (Gottschalk, Lin and Manocha 1996): a face's, or the product of two
// edges, which must win clearly, for a face is the steadier normal, and must be where the triangles touch along it. Of
// a closed mesh the faces have an outside, and B is only pushed out of A through it: so a face that bears a body is not
// mistaken for one that the body stands beside.
//
// Of these it is the one along which the triangles' *surroundings* overlap least. Two triangles alone often overlap
// least in a direction in which their bodies do not separate at all: a corner of a flat floor's triangle that stands
// into the side of a box is soon out of it sideways, and the floor goes on. A direction is a normal of an edge or a
// vertex only if the surface does not rise from it along the direction: if it lies in the feature's normal cone, or
// Voronoi region, as Bullet's internal edge utility (btGenerateInternalEdgeInfo) and Jolt's active edges ask of
// precomputed neighbours. Here what rises is climbed (climb.hpp), and the overlap counts from the top: so no threshold
// tells flat from convex, vertices that are coplanar but for rounding do no harm, and finely meshed bodies, of which
// only a ring of triangles meets a face, overlap it by their depth. A face's own plane is not climbed from: in a
// hollow, everything around is higher, and its faces bear all the same.
//
// The points are the corners of what one triangle covers of the other, seen along the normal: the other is cut with the
// sides of the one whose normal it is (Sutherland and Hodgman 1974). Each corner is a vertex of the one or of the
// other, or a crossing of edges: which, its feature says, and does not change while the triangles slide. Two edges that
// touch along their product have one point. Triangles that are separated, and cover nothing of each other, have their
// closest points.
//
// Nothing here is certified: a wrong digit moves a contact.
#pragma once

#include "query/triangle/surroundings.hpp"

#include <cstdint>
#include <limits>

namespace prolate::query {

struct TriangleContact {
    struct Point {
        glm::dvec3 on_a, on_b; // in A's frame
        double depth;          // normal.(on_a - on_b), of these two triangles
        Feature of_a, of_b;
    };
    static constexpr uint32_t kPoints = 6;
    glm::dvec3 normal;  // of length 1, from A to B
    bool faces = false; // it is a face's, not that of two edges or of closest points, which neighbours may contradict
    double overlap = 0; // of the surroundings along the normal
    uint32_t count = 0;
    Point points[kPoints];
};

/// A direction in which the bodies are known to overlap by so much around the triangles.
struct KnownOverlap {
    glm::dvec3 normal{0, 0, 0};
    double overlap = std::numeric_limits<double>::infinity();
};

/// The contact along least overlap; points not farther apart than `margin`. None, if there is no way out through the
/// outsides, or none that is about as short as the known one: no more than a quarter longer.
TriangleContact contact(const Surrounded& a, const Surrounded& b, double margin,
                        const KnownOverlap& known = {}) noexcept;

/// The points along a given normal: the corners of what they cover of each other, cut with the sides of the triangle
/// that faces it more. `faces` is false if neither does, by a cosine of `facing`.
TriangleContact contact_along(const glm::dvec3& normal, const PlacedTriangle& a, const PlacedTriangle& b, double margin,
                              double facing = kFacing) noexcept;

} // namespace prolate::query
