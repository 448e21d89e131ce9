// How a triangle and an ellipsoid that meet, or nearly do, touch, and how their bodies can be separated. For
// contacts; scalar, in double precision. As of two triangles (contact.hpp), the normal is the one along which the
// surroundings overlap least, and nothing is certified.
#pragma once

#include "query/triangle/surroundings.hpp"

namespace prolate::query {

struct EllipsoidContact {
    glm::dvec3 normal;    ///< of length 1, from the triangle to the ellipsoid
    glm::dvec3 middle;    ///< between the surfaces, in A's frame
    double depth;         ///< of the ellipsoid in the triangle's body along the normal; negative: the gap
    bool of_face = false; ///< the normal is the triangle's own
};
/// The contact along least overlap: along the normal of the face, or away from the nearest points of the edges, unless
/// the surface goes on there. If they are separated, that of the nearest points.
EllipsoidContact contact(const Surrounded& around, const PlacedEllipsoid& ellipsoid) noexcept;

/// The contact along a given normal.
struct EllipsoidContactAlong {
    bool faces = false; ///< the triangle faces the normal; else nothing is known
    bool beside = true; ///< the ellipsoid is deepest beside the triangle, which is its neighbours'
    glm::dvec3 middle{0, 0, 0};
    double depth = 0;
};
EllipsoidContactAlong contact_along(const glm::dvec3& normal, const PlacedTriangle& triangle,
                                    const PlacedEllipsoid& ellipsoid) noexcept;

} // namespace prolate::query
