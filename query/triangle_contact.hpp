// Where do two triangles that meet cross, and how can they be taken apart? For contacts; scalar, in double precision.
//
// The normal is that of the separating axis theorem along which they overlap least (Gottschalk, Lin and Manocha 1996):
// both face normals, then the products of their edges, which must win clearly, for a face is the steadier normal. The
// depth is how far B must move along it. It is that of these two triangles alone, and no more than their size: two
// solids that are deep in each other are not taken apart by it.
//
// The point is the middle of the segment in which the triangles cross: each crosses the other's plane in a segment of
// the line common to both planes, and these two overlap (Moeller 1997). Of coplanar triangles it is the centroid of
// their common polygon (Sutherland and Hodgman 1974). Where rounding leaves neither, it is the middle of the closest
// points.
//
// Nothing here is certified: a wrong digit moves a contact, it loses none.
#pragma once

#include "query/triangle.hpp"

namespace prolate::query {

struct TriangleContact {
    glm::dvec3 point;  // in A's frame
    glm::dvec3 normal; // of length 1, from A to B
    double depth;      // B moved by depth * normal touches A; below 0 if they are apart
};
/// Of triangles that are not apart(); of others, that of their closest points or of the direction that separates most.
TriangleContact contact(const PlacedTriangle& a, const PlacedTriangle& b) noexcept;

} // namespace prolate::query
