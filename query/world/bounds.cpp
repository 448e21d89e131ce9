#include "query/world/bounds.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace prolate::query {

using glm::dvec3;

float round_down(double x) noexcept {
    return static_cast<float>(x - (0x1p-23 * std::abs(x) + 0x1p-149));
}
float round_up(double x) noexcept {
    return -round_down(-x);
}

bool is_finite(const Bounds& box) noexcept {
    return std::isfinite(box.lower.x) && std::isfinite(box.lower.y) && std::isfinite(box.lower.z) &&
           std::isfinite(box.upper.x) && std::isfinite(box.upper.y) && std::isfinite(box.upper.z);
}

LocalBounds local_bounds(const TreeView& tree) noexcept {
    const auto [to] = reach(tree, relative_pose({}, {}));
    const dvec3 lower(-to[3], -to[4], -to[5]), upper(to[0], to[1], to[2]);
    LocalBounds out{(lower + upper) * 0.5, (upper - lower) * 0.5, 0, 0};
    out.radius = glm::length(out.half), out.reach = glm::length(out.center) + out.radius;
    return out;
}

Bounds bounds_at(const TreeView& tree, const RelativePose& to_world, float margin, double tolerance,
                 double rounding) noexcept {
    if (!std::isfinite(to_world.distance)) return kEverything;
    const auto [to] = reach(tree, to_world, tolerance, rounding);
    const dvec3& t = to_world.translation;
    const double wider = double{margin} + tree.radius(), pad = wider + rounding * (to_world.distance + wider);
    return {{round_down(t.x - to[3] - pad), round_down(t.y - to[4] - pad), round_down(t.z - to[5] - pad)},
            {round_up(t.x + to[0] + pad), round_up(t.y + to[1] + pad), round_up(t.z + to[2] + pad)}};
}

Anchor anchor(const LocalBounds& local, const RelativePose& to_world) noexcept {
    return {to_world.rotation, to_world.rotation * local.center + to_world.translation,
            local.reach + to_world.distance};
}

double motion(const LocalBounds& local, const Anchor& from, const Anchor& to, double rounding) noexcept {
    const dvec3 d = to.center - from.center;
    const glm::dmat3 turn = to.rotation - from.rotation;
    const double turned =
        std::sqrt(glm::dot(turn[0], turn[0]) + glm::dot(turn[1], turn[1]) + glm::dot(turn[2], turn[2]));
    // A sum instead of a maximum would be a NaN if a part of it is; so is this one, by the last term.
    return std::max({std::abs(d.x), std::abs(d.y), std::abs(d.z)}) + turned * local.radius +
           rounding * (from.reach + to.reach);
}

} // namespace prolate::query

namespace prolate {

Bounds bounds(const TreeView& tree, const Pose& pose, float margin) noexcept {
    const Bounds box = query::bounds_at(tree, query::relative_pose({}, pose), margin < 0 ? 0 : margin);
    return query::is_finite(box) ? box : query::kEverything;
}

} // namespace prolate
