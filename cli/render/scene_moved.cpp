// Cost: a few operations for each node of the cut and each ray. Nodes that move as they please make no tree.
#include "cli/render/scene_moved.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace prolate::cli {
namespace {

using glm::dvec3;

using Factor = std::array<double, 6>; // l11, l21, l22, l31, l32, l33

// The factor of a small ellipsoid that holds all points within `radius` of {L u, |u| <= 1}. For every p > 0 that with
// the matrix (1 + p) L L^T + (1 + 1 / p) radius^2 I does; of some p the one of least volume is taken.
Factor widened(const Factor& l, double radius) {
    const auto [l11, l21, l22, l31, l32, l33] = l;
    const double m11 = l11 * l11, m21 = l21 * l11, m22 = l21 * l21 + l22 * l22, m31 = l31 * l11,
                 m32 = l31 * l21 + l32 * l22, m33 = l31 * l31 + l32 * l32 + l33 * l33;
    Factor best = l;
    double least = std::numeric_limits<double>::infinity();
    for (int step = -4; step <= 4; ++step) {
        const double p = radius * std::sqrt(3 / (m11 + m22 + m33)) * std::ldexp(1.0, step);
        const double a = 1 + p, b = (1 + 1 / p) * radius * radius;
        const double k11 = std::sqrt(a * m11 + b), k21 = a * m21 / k11, k31 = a * m31 / k11;
        const double k22 = std::sqrt(a * m22 + b - k21 * k21), k32 = (a * m32 - k31 * k21) / k22;
        const double k33 = std::sqrt(a * m33 + b - k31 * k31 - k32 * k32);
        if (k11 * k22 * k33 < least) least = k11 * k22 * k33, best = {k11, k21, k22, k31, k32, k33};
    }
    return best;
}

// Where a ray is in an ellipsoid; `from` > `to` if nowhere.
struct Chord {
    dvec3 y, e; // at t it is at y + t e, where the ellipsoid is the unit ball
    Reach reach;
    Chord(const FramedEllipsoid& b, const dvec3& origin, const dvec3& direction)
        : y(b.inverse(origin - b.center)), e(b.inverse(direction)) {
        const double ee = glm::dot(e, e), middle = -glm::dot(y, e) / ee;
        const dvec3 closest = y + middle * e;
        const double rest = 1 - glm::dot(closest, closest);
        reach = rest < 0 ? Reach{1, 0} : Reach{middle - std::sqrt(rest / ee), middle + std::sqrt(rest / ee)};
    }
};

} // namespace

Ellipsoid moved_ellipsoid(const TreeView& tree, uint32_t node, std::span<const float> q) {
    const Deformation modes = *tree.deformation();
    const Ellipsoid e = tree.bound(node);
    dvec3 center(e.center.x, e.center.y, e.center.z);
    double growth = 1, radius = 0;
    for (uint32_t m = 0; m < modes.mode_count(); ++m) {
        const Deformation::Motion motion = modes.motion(node, m);
        const double size = std::abs(double{q[m]});
        center += double{q[m]} * dvec3(motion.shift[0], motion.shift[1], motion.shift[2]);
        growth += size * motion.growth;
        radius += size * motion.radius;
    }
    Factor l{e.l11, e.l21, e.l22, e.l31, e.l32, e.l33};
    for (double& entry : l) entry *= growth;
    if (radius > 0) l = widened(l, radius);
    const auto single = [](double x) { return static_cast<float>(x); };
    return {{single(center.x), single(center.y), single(center.z)},
            single(l[0]),
            single(l[1]),
            single(l[2]),
            single(l[3]),
            single(l[4]),
            single(l[5])};
}

MovedScene::MovedScene(const TreeView& tree, uint32_t level, std::span<const float> q, const Frame& frame) {
    tree.for_each_in_cut(level, [&](uint32_t node) {
        const FramedEllipsoid e(moved_ellipsoid(tree, node, q), frame);
        const double frobenius =
            std::sqrt(e.l11 * e.l11 + e.l21 * e.l21 + e.l22 * e.l22 + e.l31 * e.l31 + e.l32 * e.l32 + e.l33 * e.l33);
        bodies_.push_back({node, e, frobenius});
    });
}

Hit MovedScene::first_hit(const dvec3& origin, const dvec3& direction, const Reach& reach) const {
    Hit best;
    best.distance = reach.to;
    for (const Body& body : bodies_) {
        const dvec3 apart = body.ellipsoid.center - origin;
        const double along = glm::dot(apart, direction);
        if (glm::dot(apart, apart) - along * along > body.radius * body.radius) continue;
        const Chord chord(body.ellipsoid, origin, direction);
        if (!(chord.reach.to > reach.from && chord.reach.from < best.distance)) continue;
        best.distance = std::max(chord.reach.from, reach.from), best.id = body.node;
        dvec3 normal = body.ellipsoid.inverse_transposed(chord.y + best.distance * chord.e);
        if (glm::dot(normal, direction) > 0) normal = -normal;
        best.normal = glm::normalize(normal);
    }
    return best.id == kNothing ? Hit{} : best;
}

bool MovedScene::blocked(const dvec3& origin, const dvec3& direction, const Reach& reach) const {
    return first_hit(origin, direction, reach).id != kNothing;
}

Place MovedScene::place_of(const dvec3& p) const {
    Place out;
    double least = 1;
    for (const Body& body : bodies_)
        if (const double radial = body.ellipsoid.radial_squared(p); radial <= least) least = radial, out.id = body.node;
    return out;
}

Window MovedScene::window(const Camera& camera) const {
    Window window;
    for (const Body& body : bodies_) body.ellipsoid.add_to(window, camera);
    return window;
}

double MovedScene::extent(const dvec3& direction) const {
    double most = -std::numeric_limits<double>::infinity();
    for (const Body& body : bodies_) most = std::max(most, body.ellipsoid.extent(direction));
    return most;
}

} // namespace prolate::cli
