// Rays are given to the runtime in metres from the frame's center, to which the tree's pose moves it: so the floats of
// a ray have the precision that its size calls for, wherever the model stands.
#include "cli/render/scene_cut.hpp"

#include <prolate/tools.hpp>

#include <algorithm>
#include <array>
#include <cmath>

namespace prolate::cli {
namespace {

using glm::dvec3;

Vec3 to_float(const dvec3& v) {
    return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)};
}

Ray to_ray(const dvec3& origin, const dvec3& direction, const Reach& reach, const Frame& frame) {
    const double metres = 1 / frame.scale;
    return {to_float((origin + reach.from * direction) * metres), to_float(direction),
            static_cast<float>((reach.to - reach.from) * metres)};
}

Pose centered(const Frame& frame) {
    return {to_float(-frame.center), {0, 0, 0, 1}};
}

} // namespace

FramedEllipsoid::FramedEllipsoid(const Ellipsoid& e, const Frame& frame)
    : center(frame(e.center)), l11(e.l11 * frame.scale), l21(e.l21 * frame.scale), l22(e.l22 * frame.scale),
      l31(e.l31 * frame.scale), l32(e.l32 * frame.scale), l33(e.l33 * frame.scale), m11(1 / l11),
      m21(-l21 / (l11 * l22)), m22(1 / l22), m31(-(l31 * m11 + l32 * m21) / l33), m32(-l32 / (l22 * l33)),
      m33(1 / l33) {}

CutScene::CutScene(const TreeView& tree, uint32_t level, std::span<const float> growth, const Frame& frame)
    : tree_(tree), level_(level), growth_(growth), frame_(frame) {
    const uint32_t end = tree.first_slot(level) + kBlockLanes * tree.level(level).block_count;
    bodies_.reserve(end);
    for (uint32_t slot = 0; slot < end; ++slot)
        bodies_.emplace_back(tree.ellipsoid(tree.is_node(slot) ? slot : 0), frame);
    tree.for_each_in_cut(level, [&](uint32_t node) { cut_.push_back(node); });
}

Hit CutScene::first_hit(const dvec3& origin, const dvec3& direction, const Reach& reach) const {
    QueryContext context;
    const RaycastResult found = raycast_cut(tree_, centered(frame_), to_ray(origin, direction, reach, frame_), growth_,
                                            context, {.max_level = level_});
    if (found.verdict != Verdict::overlapping) return {};
    return {reach.from + found.t * frame_.scale, found.node, false,
            dvec3(found.normal.x, found.normal.y, found.normal.z)};
}

bool CutScene::blocked(const dvec3& origin, const dvec3& direction, const Reach& reach) const {
    QueryContext context;
    return raycast_cut_any(tree_, centered(frame_), to_ray(origin, direction, reach, frame_), growth_, context,
                           {.max_level = level_})
               .verdict == Verdict::overlapping;
}

Place CutScene::place_of(const dvec3& p) const {
    // Each level opened leaves at most its siblings behind.
    std::array<uint32_t, size_t{kMaxLevels} * kMaxDegree> open;
    size_t size = 0;
    open[size++] = 0;
    uint32_t deepest = kNothing;
    double least = 1;
    while (size > 0) {
        const uint32_t node = open[--size];
        const double radial = bodies_[node].radial_squared(p);
        if (is_in_cut(node)) {
            if (radial <= least) least = radial, deepest = node;
            continue;
        }
        const double grown = growth_[node];
        if (radial > grown * grown) continue; // it holds all below it, with room to spare for this rounding
        const ChildRange children = tree_.children(node);
        for (uint32_t i = 0; i < children.count; ++i) open[size++] = children.first + i;
    }
    return {deepest, 0};
}

// The slopes s at which the plane through the eye with normal axis - s * forward touches a body seen at d are those
// where (n.d)^2 = |transpose(L) n|^2: a quadratic in s.
void FramedEllipsoid::add_to(Window& window, const Camera& camera) const {
    const dvec3 d = center - camera.eye, lf = transposed(camera.forward);
    const double df = glm::dot(d, camera.forward), a = df * df - glm::dot(lf, lf);
    const auto widen = [&](const dvec3& axis, double& low, double& high) {
        const dvec3 la = transposed(axis);
        const double da = glm::dot(d, axis), b = da * df - glm::dot(la, lf), c = da * da - glm::dot(la, la);
        const double root = std::sqrt(std::max(0.0, b * b - a * c));
        low = std::min(low, (b - root) / a);
        high = std::max(high, (b + root) / a);
    };
    widen(camera.right, window.u0, window.u1);
    widen(camera.up, window.v0, window.v1);
}

Window CutScene::window(const Camera& camera) const {
    Window window;
    for (const uint32_t node : cut_) bodies_[node].add_to(window, camera);
    return window;
}

double CutScene::extent(const dvec3& direction) const {
    double most = -std::numeric_limits<double>::infinity();
    for (const uint32_t node : cut_) most = std::max(most, bodies_[node].extent(direction));
    return most;
}

} // namespace prolate::cli
