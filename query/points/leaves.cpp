// What the traversal's float bounds leave open is decided here, in double precision.
//
// A point x outside a convex leaf has the distance max over unit vectors n of min over the leaf's points y of n.(x -
// y). So any n gives a lower bound, and any y an upper one. For triangles and ellipsoids both are wrong by less than
// 100 u S (query/triangle/distance.hpp and ellipsoid_distance.hpp, the point in the place of the second body);
// kSeparationMargin S is taken off and added.
//
// A point x inside an ellipsoid {y : y^T Q^-1 y <= 1}: with Q = V diag(l) V^T, z = V^T x, any m < min l, the square of
// its distance from the surface is at least
//     min over y of |x - y|^2 + m (1 - y^T Q^-1 y)  =  m (1 - sum z_i^2 / (l_i - m))
// and equal for the best m (strong duality holds for one quadratic constraint: S. Boyd, L. Vandenberghe, "Convex
// Optimization", Cambridge University Press, 2004, appendix B.1). An inexact m costs tightness only. Rounding in Q and
// its eigenvectors is backward stable, within a few u max l: the l_i are taken 2^-46 max l smaller.
#include "query/points/search.hpp"

#include "query/ellipsoid/nearest_direction.hpp"
#include "query/ellipsoid/separation.hpp"
#include "query/triangle/placed.hpp"
#include "src/lattice.hpp"
#include "src/symmetric3.hpp"

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <cmath>

namespace prolate::query {
namespace {

using glm::dmat3;
using glm::dvec3;

LatticeProbe probe_of(const PlacedPoint& point, const LatticeInfo& lattice) {
    const double per_step = steps_per_metre(lattice);
    LatticeProbe out{};
    double reach = point.reach * per_step;
    for (size_t i = 0; i < 3; ++i) {
        const double origin = lattice.origin[i];
        out.position[i] = point.position[static_cast<glm::length_t>(i)] * per_step - origin;
        reach += std::abs(origin);
    }
    out.slack = 0x1p-43 * reach;
    return out;
}

// The weight of b in the point of the segment from a to b that is nearest to the origin.
double weight_of_end(const dvec3& a, const dvec3& b) {
    const dvec3 edge = b - a;
    const double along = -glm::dot(a, edge), square = glm::dot(edge, edge);
    return along > 0 ? std::min(along / square, 1.0) : 0;
}

// The nearest of the points of the edges.
dvec3 nearest_on_edges(const dvec3 (&p)[3]) {
    dvec3 best = p[0];
    for (size_t i = 0; i < 3; ++i) {
        const dvec3 &a = p[i], &b = p[(i + 1) % 3], x = a + weight_of_end(a, b) * (b - a);
        if (glm::dot(x, x) < glm::dot(best, best)) best = x;
    }
    return best;
}

// The point of a triangle that is nearest to the origin: C. Ericson, "Real-Time Collision Detection", Morgan Kaufmann,
// 2005, section 5.1.5. Of slivers, whose areas are nothing but rounding, the edges decide.
dvec3 nearest_on_triangle(const dvec3 (&p)[3]) {
    constexpr double kSliver = 0x1p-40;
    const dvec3 ab = p[1] - p[0], ac = p[2] - p[0];
    const double a_ab = -glm::dot(ab, p[0]), a_ac = -glm::dot(ac, p[0]);
    if (a_ab <= 0 && a_ac <= 0) return p[0];
    const double b_ab = -glm::dot(ab, p[1]), b_ac = -glm::dot(ac, p[1]);
    if (b_ab >= 0 && b_ac <= b_ab) return p[1];
    const double c_ab = -glm::dot(ab, p[2]), c_ac = -glm::dot(ac, p[2]);
    if (c_ac >= 0 && c_ab <= c_ac) return p[2];
    const double of_a = b_ab * c_ac - c_ab * b_ac, of_b = c_ab * a_ac - a_ab * c_ac, of_c = a_ab * b_ac - b_ab * a_ac;
    const double sum = of_a + of_b + of_c;
    const bool inside = of_a > 0 && of_b > 0 && of_c > 0;
    if (!inside || !(sum > kSliver * (glm::dot(ab, ab) * glm::dot(ac, ac)))) return nearest_on_edges(p);
    return p[0] + (of_b / sum) * ab + (of_c / sum) * ac;
}

// A triangle seen from a point, and what its distance may be wrong by.
struct SeenTriangle {
    dvec3 p[3];
    double reach, slack;

    SeenTriangle(const TreeView& tree, uint32_t t, const PlacedPoint& point) {
        const PlacedTriangle placed = place(tree, t);
        for (size_t i = 0; i < 3; ++i) p[i] = placed.corner[i] - point.position;
        reach = point.reach + placed.reach, slack = kSeparationMargin * reach;
    }
};

// How far the triangle with these corners, relative to the point, is along the unit vector n at least.
double least_along(const dvec3 (&p)[3], const dvec3& n) {
    return std::min({glm::dot(n, p[0]), glm::dot(n, p[1]), glm::dot(n, p[2])});
}

// L^-1 x by forward substitution, which is exact for a matrix within a few u |L| of L.
dvec3 in_ball(const dmat3& l, const dvec3& x) {
    const double u = x.x / l[0][0], v = (x.y - l[0][1] * u) / l[1][1];
    return {u, v, (x.z - l[0][2] * u - l[1][2] * v) / l[2][2]};
}

} // namespace

PointSearch::PointSearch(const TreeView& tree, const PlacedPoint& placed, Scratch context, uint64_t most_tests) noexcept
    : side(tree_side(tree, kMaxLevels)), point(placed), probe(probe_of(placed, tree.raw().lattice())),
      max_tests(most_tests), stack(context.entries()) {}

double PointSearch::metres(float square) const noexcept {
    return std::sqrt(double{square}) * step_of(side.lattice) * (1 - 0x1p-50);
}

float PointSearch::square_of(double metres) const noexcept {
    const double steps = metres * steps_per_metre(side.lattice);
    return static_cast<float>(steps * steps * (1 + 0x1p-20)); // infinite if too large
}

bool NearestSearch::leaf(uint32_t slot, double bound) noexcept {
    if (left() < 1) return false;
    if (ellipsoids)
        try_ellipsoid(slot, bound);
    else
        decided = std::min(decided, bound);
    return true;
}

void NearestSearch::look_within(double distance) noexcept {
    farthest = std::min(farthest, distance);
    limit = std::min(limit, square_of(farthest));
}

void NearestSearch::hint(uint32_t t) noexcept {
    const SeenTriangle seen(side.tree, t, point);
    ++stats.triangle_tests;
    look_within(glm::length(nearest_on_triangle(seen.p)) + seen.slack);
}

void NearestSearch::try_triangle(uint32_t slot, uint32_t t, double bound) noexcept {
    // Where the nearest point's direction has lost so many digits, the face's normal is tried, too.
    constexpr double kNear = 0x1p-20;
    const SeenTriangle seen(side.tree, t, point);
    const auto& [p, reach, slack] = seen;
    const dvec3 to = nearest_on_triangle(p);
    const double here = glm::dot(to, to), length = std::sqrt(here);
    double lower = length > 0 ? least_along(p, to / length) : 0;
    if (length < kNear * reach) {
        const dvec3 face = glm::cross(p[1] - p[0], p[2] - p[0]);
        if (const double size = glm::length(face); size > 0)
            lower = std::max({lower, least_along(p, face / size), least_along(p, -face / size)});
    }
    decided = std::min(decided, std::max({lower - slack, bound, 0.0}));
    upper = std::min(upper, length + slack);
    look_within(upper);
    if (here > square || (here == square && t >= triangle)) return;
    square = here, nearest = point.position + to, node = slot, triangle = t;
    normal = glm::cross(p[1] - p[0], p[2] - p[0]);
}

void NearestSearch::try_ellipsoid(uint32_t slot, double bound) noexcept {
    ++stats.triangle_tests;
    const PlacedEllipsoid e = place(side.tree.ellipsoid(slot), side.tree.scale());
    const dvec3 x = point.position - e.center;
    const double slack = kSeparationMargin * (point.reach + e.reach);
    const dvec3 u = in_ball(e.factor, x);
    if (!(glm::dot(u, u) > 1)) { // inside: a gap along any direction would be below 0
        decided = 0;
        if (square > 0 || slot < node) square = upper = 0, nearest = point.position, node = slot, limit = 0;
        return;
    }
    const dvec3 n = glm::normalize(nearest_direction(e.factor, e.factor * glm::transpose(e.factor), x));
    const dvec3 along = n * e.factor; // L^T n
    const double width = glm::length(along), lower = glm::dot(n, x) - width;
    decided = std::min(decided, std::max({lower - slack, bound, 0.0}));
    const dvec3 on = e.factor * (along / width), to = x - on;
    const double here = glm::dot(to, to);
    upper = std::min(upper, std::sqrt(here) + slack);
    look_within(upper);
    if (here > square || (here == square && slot >= node)) return;
    square = here, nearest = e.center + on, normal = n, node = slot;
}

namespace {

struct Depth {
    double depth;    // certified
    dvec3 direction; // unit, to the nearest point of the surface, about
};

// Of x within the ellipsoid about the origin.
Depth depth_in(const dmat3& factor, const dvec3& x, double slack) {
    const dmat3 q = factor * glm::transpose(factor);
    const Eigen3x3 axes =
        eigen_symmetric({{{q[0][0], q[1][0], q[2][0]}, {q[0][1], q[1][1], q[2][1]}, {q[0][2], q[1][2], q[2][2]}}});
    double l[3], z[3];
    for (size_t i = 0; i < 3; ++i) {
        l[i] = axes.values[i] - 0x1p-46 * axes.values[0];
        z[i] = axes.vectors[0][i] * x.x + axes.vectors[1][i] * x.y + axes.vectors[2][i] * x.z;
    }
    if (!(l[2] > 0)) return {0, {0, 0, 1}};
    // The bound is concave in m, and its slope 1 - sum z_i^2 l_i / (l_i - m)^2: by halving.
    double low = 0, high = l[2];
    for (int i = 0; i < 60; ++i) {
        const double m = 0.5 * (low + high);
        double slope = 1;
        for (size_t k = 0; k < 3; ++k) slope -= z[k] * z[k] * l[k] / ((l[k] - m) * (l[k] - m));
        (slope > 0 ? low : high) = m;
    }
    double rest = 1;
    dvec3 direction(0); // of the normal at the nearest point, V diag(1 / (l - m)) z
    for (size_t k = 0; k < 3; ++k) {
        const double share = z[k] / (l[k] - low);
        rest -= z[k] * share;
        for (glm::length_t i = 0; i < 3; ++i) direction[i] += axes.vectors[static_cast<size_t>(i)][k] * share;
    }
    const double length = glm::length(direction), square = low * rest;
    if (!(length > 0)) // in the middle: along the shortest axis
        direction = {axes.vectors[0][2], axes.vectors[1][2], axes.vectors[2][2]};
    return {square > 0 ? std::max(std::sqrt(square) * (1 - 0x1p-40) - slack, 0.0) : 0, glm::normalize(direction)};
}

} // namespace

bool DepthSearch::leaf(uint32_t slot, double) noexcept {
    if (left() < 1) return false;
    ++stats.triangle_tests;
    const PlacedEllipsoid e = place(side.tree.ellipsoid(slot), side.tree.scale());
    const double slack = kSeparationMargin * (point.reach + e.reach);
    const dvec3 x = point.position - e.center;
    const dvec3 u = in_ball(e.factor, x);
    const double inside = 1 - glm::dot(u, u);
    if (direction == nullptr) {
        if (inside < 0) return true;
        const Depth found = depth_in(e.factor, x, slack);
        if (found.depth > depth || (found.depth == depth && exit == 0))
            depth = found.depth, way_out = found.direction, node = slot, exit = 1;
        return true;
    }
    constexpr double kTouching = 0x1p-44; // of those that the point is outside of, some would be met farther on
    if (inside < -kTouching) return true;
    const dvec3 v = in_ball(e.factor, *direction);
    const double uv = glm::dot(u, v), vv = glm::dot(v, v), root = uv * uv + vv * inside;
    if (!(root >= 0)) return true;
    const double leave = (std::sqrt(root) - uv) / vv;
    if (leave > exit) exit = leave, node = slot;
    return true;
}

} // namespace prolate::query
