// How do two triangles that meet, or nearly do, touch, and how can they be taken apart? For contacts; scalar, in double
// precision.
//
// The normal is that of the separating axis theorem along which they overlap least (Gottschalk, Lin and Manocha 1996):
// of both face normals and of the products of edges, which must win clearly, for a face is the steadier normal, and
// must be where the triangles touch along it. Of a closed mesh the faces have an outside, and B is only pushed out of A
// through it: so a face that bears a body is not mistaken for one that the body stands beside.
//
// The points are the corners of what one triangle covers of the other, seen along the normal: the other is cut with the
// sides of the one whose normal it is (Sutherland and Hodgman 1974). Each corner is a vertex of the one or of the
// other, or a crossing of edges: which, its feature says, and does not change while the triangles slide. Two edges that
// touch along their product have one point. Triangles that are apart, and cover nothing of each other, have their
// closest points.
//
// The depth is that of these two triangles alone. Nothing here is certified: a wrong digit moves a contact.
#pragma once

#include "query/triangle.hpp"

#include <cstdint>

namespace prolate::query {

/// Part of a triangle: corner 0 ... 2; 3 + i: the edge from corner i to the next; kFace.
using Feature = uint8_t;
inline constexpr Feature kFirstEdge = 3, kFace = 6;

struct TriangleContact {
    struct Point {
        glm::dvec3 on_a, on_b; // in A's frame
        double depth;          // normal.(on_a - on_b)
        Feature of_a, of_b;
    };
    static constexpr uint32_t kPoints = 6;
    glm::dvec3 normal;  // of length 1, from A to B
    bool faces = false; // it is a face's, not that of two edges or of closest points, which neighbours may contradict
    uint32_t count = 0;
    Point points[kPoints];
};

/// The contact along least overlap; points not farther apart than `margin`. None, if there is no way out through the
/// outsides. `closed`: the triangle's mesh is.
TriangleContact contact(const PlacedTriangle& a, bool closed_a, const PlacedTriangle& b, bool closed_b,
                        double margin) noexcept;

/// The points along a given normal: the corners of what they cover of each other, cut with the sides of the triangle
/// that faces it more. `faces` is false if neither does.
TriangleContact contact_along(const glm::dvec3& normal, const PlacedTriangle& a, const PlacedTriangle& b,
                              double margin) noexcept;

} // namespace prolate::query
