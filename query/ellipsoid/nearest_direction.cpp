#include "query/ellipsoid/nearest_direction.hpp"

#include "query/ellipsoid/symmetric.hpp"

#include <glm/geometric.hpp>

#include <cmath>

namespace prolate::query {

using glm::dmat3;
using glm::dvec3;

glm::dvec3 nearest_direction(const dmat3& factor, const dmat3& q, const dvec3& x) noexcept {
    constexpr int kNewtonSteps = 16;
    double t = 0;
    dvec3 s = x;
    for (int i = 0; i < kNewtonSteps; ++i) {
        const dmat3 m = q + dmat3(t);
        const dmat3 adj = adjugate(m);
        const double det = glm::dot(m[0], adj[0]);
        if (!(det > 0)) break;
        s = adj * x / det;
        const double length = glm::length(s * factor);
        const dvec3 qs = q * s;
        const double fall = glm::dot(qs, adj * s) / det; // -d |L^T s|^2 / dt / 2
        if (!(fall > 0)) break;
        const double step = (length - 1) * length * length / fall;
        t += step;
        if (!(t > 0) || !(std::abs(step) > 0x1p-50 * t)) break;
    }
    return s;
}

} // namespace prolate::query
