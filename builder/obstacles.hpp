// What is in the way of an ellipsoid that grows inside the solid.
#pragma once

#include "builder/fit.hpp"
#include "builder/triangle_tree.hpp"

#include <vector>

namespace prolate {

/// A triangle lies in {y : normal . y >= height}, in the coordinates in which an ellipsoid is the unit ball.
struct Obstacle {
    Vec normal = Vec::Zero(); ///< of length 1 but for rounding
    double height = 0;
};

/// Planes that no triangle within `most` of the center, in the ellipsoid's unit-ball coordinates, crosses: the part of
/// that ball below all of them is free of the surface. Each plane is the one across the way to the nearest triangle
/// that no plane before shuts out (R. Deits, R. Tedrake, "Computing Large Convex Regions of Obstacle-Free Space through
/// Semidefinite Programming", Algorithmic Foundations of Robotics XI, 2015). The nearest comes first, and there are at
/// most `count`. O(log n) a plane where triangles are not equally near. Thread-safe.
std::vector<Obstacle> obstacles(const Fit& ellipsoid, const TriangleTree& surface, double most, size_t count);

/// How much larger the ellipsoid could be about its center before a triangle meets it: at most `most`. Never too large
/// by more than rounding, because it is the height of a plane that the triangle lies beyond.
double clearance(const Fit& ellipsoid, const TriangleTree& surface, double most);

} // namespace prolate
