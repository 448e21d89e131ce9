// The direction from an ellipsoid to a point outside.
#pragma once

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

namespace prolate::query {

/// Of any length, from the point of {L u : |u| <= 1} that is nearest to x towards x, which lies outside; Q = L L^T.
///
/// The nearest point is Q s, s = (Q + t I)^-1 x, for the t > 0 with |L^T s| = 1, and s is the direction: Newton's
/// method on 1 / |L^T s|, which is almost linear in t (More and Sorensen 1983, "Computing a trust region step", section
/// 3). What rounding or too few steps leave makes it less accurate, and no more.
glm::dvec3 nearest_direction(const glm::dmat3& factor, const glm::dmat3& q, const glm::dvec3& x) noexcept;

} // namespace prolate::query
