#include "query/ellipsoid/separation.hpp"

#include "query/ellipsoid/symmetric.hpp"

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace prolate::query {
namespace {

using glm::dmat3;
using glm::dvec3;

// Steps in log(rho) are at most log(19); the loop ends when a step can improve f by less than this, relatively.
constexpr double kLargestParameterStep = 0.9;
constexpr double kSmallestGain = 0x1p-50;

} // namespace

PairResult test_pair(const PlacedEllipsoid& a, const PlacedEllipsoid& b, double separation_margin) noexcept {
    const dvec3 r = b.center - a.center;
    const double scale = a.reach + b.reach; // S of the error analysis
    const dmat3 q1 = a.factor * glm::transpose(a.factor), q2 = b.factor * glm::transpose(b.factor);
    double rho = std::sqrt(trace(q1) / trace(q2)); // exact for spheres
    double low = 0, high = std::numeric_limits<double>::infinity();

    for (uint32_t evaluations = 1;; ++evaluations) {
        dmat3 q = q1 + rho * q2;
        const double tau = trace(q);
        q *= 1 / tau;
        const dmat3 adj = adjugate(q);
        const double det = glm::dot(q[0], adj[0]);
        dvec3 n = adj * r;
        const double n_scale = std::max({std::abs(n.x), std::abs(n.y), std::abs(n.z)});
        if (n_scale > 0) n /= n_scale;
        const double alpha = glm::length(n * a.factor), beta = glm::length(n * b.factor);

        // Every comparison is written so that a NaN fails it.
        if (glm::dot(n, r) - alpha - beta > separation_margin * glm::length(n) * scale)
            return {PairVerdict::separated, evaluations};
        const double room = tau * (det - kOverlapMargin), slack = kOverlapMargin * scale;
        if (n_scale * alpha + slack * a.size <= room && rho * (n_scale * beta + slack * b.size) <= room)
            return {PairVerdict::overlapping, evaluations};
        if (evaluations == kMaxEvaluations) return {PairVerdict::unresolved, evaluations};

        // Newton on phi(log rho) = log(alpha / (rho beta)), which falls monotonically:
        //     phi' = -(k - h) / alpha^2 - (k - h) / k,  k = rho beta^2,  h = rho^2 (Q2 n)^T Q^-1 (Q2 n) in [0, k].
        // log y is replaced by 2 (y - 1) / (y + 1) and exp by its inverse, so that phi' = -1 gives the fixed-point step
        // rho = alpha / beta, and no library function but sqrt is used.
        const double excess = (alpha - rho * beta) / (alpha + rho * beta);
        const dvec3 w = q2 * n;
        const double k = rho * beta * beta;
        const double h = std::clamp(rho * rho * glm::dot(w, adj * w) / (tau * det), 0.0, k);
        const double slope = (k - h) / (alpha * alpha) + (k - h) / k;
        const double step = std::clamp(excess / slope, -kLargestParameterStep, kLargestParameterStep);
        if (!(excess * step > kSmallestGain)) return {PairVerdict::unresolved, evaluations};
        (excess > 0 ? low : high) = rho;
        rho *= (1 + step) / (1 - step);
        if (!(rho > low && rho < high)) rho = std::sqrt(low * high);
    }
}

} // namespace prolate::query
