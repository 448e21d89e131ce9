#include "query/bounds.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace prolate::query {
namespace {

using glm::dvec3;

constexpr uint32_t kMostNodes = 64;
constexpr double kInfinite = std::numeric_limits<double>::infinity();

struct Extent {
    dvec3 lower{kInfinite}, upper{-kInfinite};
    void add(const Extent& e) { lower = glm::min(lower, e.lower), upper = glm::max(upper, e.upper); }
    void cut(const Extent& e) { lower = glm::max(lower, e.lower), upper = glm::min(upper, e.upper); }
};

Extent around(const dvec3& center, const dvec3& half, double slack) {
    const dvec3 reach = half + slack;
    return {center - reach, center + reach};
}

Extent extent(const PlacedEllipsoid& e, double margin, double rounding) {
    const auto& l = e.factor; // columns
    return around(e.center, glm::sqrt(l[0] * l[0] + l[1] * l[1] + l[2] * l[2]), margin + rounding * (e.reach + margin));
}

Bounds outward(const Extent& e) {
    return {{round_down(e.lower.x), round_down(e.lower.y), round_down(e.lower.z)},
            {round_up(e.upper.x), round_up(e.upper.y), round_up(e.upper.z)}};
}

} // namespace

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
    uint32_t level = 0;
    while (level + 1 < tree.level_count() && tree.level(level + 1).node_count <= kMostNodes) ++level;
    Extent box;
    tree.for_each_in_cut(level, [&](uint32_t node) {
        const PlacedEllipsoid e = place(tree.ellipsoid(node));
        box.add(extent(e, 0, kSeparationMargin));
    });
    LocalBounds out{tree.root(), (box.lower + box.upper) * 0.5, (box.upper - box.lower) * 0.5, 0, 0};
    out.radius = glm::length(out.half), out.reach = glm::length(out.center) + out.radius;
    return out;
}

Bounds bounds_at(const LocalBounds& local, std::span<const Ellipsoid> level_1, const RelativePose& to_world,
                 float margin, double rounding) noexcept {
    const auto& r = to_world.rotation;
    const Anchor turned = anchor(local, to_world);
    const dvec3& h = local.half;
    Extent out = around(turned.center, h.x * glm::abs(r[0]) + h.y * glm::abs(r[1]) + h.z * glm::abs(r[2]),
                        margin + rounding * (turned.reach + margin));
    out.cut(extent(place(local.root, to_world), margin, rounding));
    Extent nodes;
    for (const Ellipsoid& e : level_1) nodes.add(extent(place(e, to_world), margin, rounding));
    if (!level_1.empty()) out.cut(nodes);
    return outward(out);
}

Bounds bounds_at(const TreeView& tree, const LocalBounds& local, const RelativePose& to_world, float margin) noexcept {
    std::array<Ellipsoid, kMaxDegree> level_1;
    const ChildRange children = tree.children(0);
    for (uint32_t i = 0; i < children.count; ++i) level_1[i] = tree.ellipsoid(children.first + i);
    return bounds_at(local, std::span(level_1).first(children.count), to_world, margin);
}

Anchor anchor(const LocalBounds& local, const RelativePose& to_world) noexcept {
    return {to_world.rotation, to_world.rotation * local.center + to_world.translation,
            local.reach + to_world.distance};
}

double motion(const LocalBounds& local, const Anchor& from, const Anchor& to, double rounding) noexcept {
    const dvec3 d = glm::abs(to.center - from.center);
    const glm::dmat3 turn = to.rotation - from.rotation;
    const double turned =
        std::sqrt(glm::dot(turn[0], turn[0]) + glm::dot(turn[1], turn[1]) + glm::dot(turn[2], turn[2]));
    // A sum instead of a maximum would be a NaN if a part of it is; so is this one, by the last term.
    return std::max({d.x, d.y, d.z}) + turned * local.radius + rounding * (from.reach + to.reach);
}

} // namespace prolate::query

namespace prolate {

Bounds bounds(const TreeView& tree, const Pose& pose, float margin) noexcept {
    const auto to_world = query::relative_pose({}, pose);
    const Bounds box = query::bounds_at(tree, query::local_bounds(tree), to_world, margin);
    return query::is_finite(box) ? box : query::kEverything;
}

} // namespace prolate
