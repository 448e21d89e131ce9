// The largest ellipsoid in a polytope.
#pragma once

#include "builder/obstacles.hpp"

#include <span>

namespace prolate {

/// About the largest ellipsoid of the region {y : normal . y <= height for all `planes`, |y_k| <= most}: its volume is
/// within some 5 % of the largest one's, and it lies inside. Heights must be at least 1 but for a few percent: the unit
/// ball nearly fits. If `ball`, the largest ball.
Fit largest_inscribed(std::span<const Obstacle> planes, double most, bool ball);

} // namespace prolate
