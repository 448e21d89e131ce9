// How far do the ellipsoids below a node stick out of its own?
//
// Where the node is the unit ball, one below it is {d + M u : |u| <= 1}. For any lambda above the largest eigenvalue of
// A = M^T M, and with b = M^T d,
//     |d + M u|^2 <= |d|^2 + lambda + b^T (lambda I - A)^-1 b    for all |u| <= 1,
// and the least such bound is the truth (the S-lemma; Boyd and Vandenberghe 2004, appendix B). Its derivative is
// 1 - |s|^2, s = (lambda I - A)^-1 b, which grows with lambda: bisection. What bisection and rounding leave is far
// below kRoundUp.
//
// Complexity: 2 us for each pair of a node and one below it. Those below lie side by side on each level, so they are
// found without links to parents.
#include "query/ellipsoid/separation.hpp"
#include "query/ellipsoid/symmetric.hpp"

#include <prolate/tools.hpp>

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace prolate {
namespace {

using glm::dmat3;
using glm::dvec3;

constexpr int kBisections = 24;
constexpr double kRoundUp = 1 + 1e-5;

// The factor by which `outer`, whose inverse factor is given, must grow about its center to hold `inner`.
double growth_to_hold(const query::PlacedEllipsoid& outer, const dmat3& to_ball, const query::PlacedEllipsoid& inner) {
    const dvec3 d = to_ball * (inner.center - outer.center);
    const dmat3 m = to_ball * inner.factor, a = glm::transpose(m) * m;
    const dvec3 b = d * m;
    double low = std::max({a[0][0], a[1][1], a[2][2]}), high = query::trace(a) + glm::length(b);
    double bound = std::numeric_limits<double>::infinity();
    const auto bounds = [&](double lambda) { // is it at or above the best one?
        const dmat3 k = dmat3(lambda) - a, adj = query::adjugate(k);
        const double det = glm::dot(k[0], adj[0]);
        if (!(k[0][0] > 0 && adj[2][2] > 0 && det > 0)) return false;
        const dvec3 s = adj * b / det;
        bound = std::min(bound, lambda + glm::dot(d, d) + glm::dot(b, s));
        return glm::dot(s, s) <= 1;
    };
    bounds(high);
    for (int i = 0; i < kBisections; ++i) {
        const double middle = low + 0.5 * (high - low);
        (bounds(middle) ? high : low) = middle;
    }
    return std::sqrt(bound);
}

} // namespace

void node_growth(const TreeView& tree, std::span<float> growth) noexcept {
    std::fill(growth.begin(), growth.end(), 1.0f);
    tree.for_each_node([&](uint32_t node) {
        const query::PlacedEllipsoid outer = query::place(tree.ellipsoid(node), tree.scale());
        const dmat3 to_ball = glm::inverse(outer.factor);
        double most = 1;
        for (uint32_t first = node, end = node + 1; first < end;) {
            uint32_t next_first = 0, next_end = 0; // of all their children
            for (uint32_t below = first; below < end; ++below) {
                if (!tree.is_node(below)) continue;
                if (below != node)
                    most = std::max(most,
                                    growth_to_hold(outer, to_ball, query::place(tree.ellipsoid(below), tree.scale())));
                const ChildRange children = tree.children(below);
                if (children.count == 0) continue;
                if (next_end == 0) next_first = children.first;
                next_end = children.first + children.count;
            }
            first = next_first, end = next_end;
        }
        if (most > 1) growth[node] = static_cast<float>(most * kRoundUp);
    });
}

} // namespace prolate
