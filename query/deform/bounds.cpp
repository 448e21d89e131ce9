// bounds() of a deformed body: the box around its root, as q moves and enlarges it.
#include <prolate/bounds.hpp>

#include "query/deform/body.hpp"
#include "query/ellipsoid/separation.hpp"
#include "query/node/limits.hpp"

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include <cmath>
#include <limits>

namespace prolate {
namespace {

float box_low(double x) {
    return static_cast<float>(x - (0x1p-23 * std::abs(x) + 0x1p-149));
}
float box_high(double x) {
    return -box_low(-x);
}

} // namespace

Bounds bounds(const DeformedBody& body, float margin) noexcept {
    constexpr float kUnbounded = std::numeric_limits<float>::infinity();
    const query::Deformed deformed(body, kMaxLevels);
    const query::RelativePose to_world = query::world_pose(body.pose);
    if (!deformed.in_range() || !std::isfinite(to_world.distance))
        return {{-kUnbounded, -kUnbounded, -kUnbounded}, {kUnbounded, kUnbounded, kUnbounded}};
    const query::Bound root = query::place(deformed.bound(0), to_world);
    const double wider = double{query::sound_length(margin)} + body.tree.radius() + root.radius;
    const double pad = wider + query::kSeparationMargin * (root.core.reach + wider);
    const glm::dmat3 rows = glm::transpose(root.core.factor);
    const glm::dvec3 half(glm::length(rows[0]) + pad, glm::length(rows[1]) + pad, glm::length(rows[2]) + pad);
    const glm::dvec3 low = root.core.center - half, high = root.core.center + half;
    return {{box_low(low.x), box_low(low.y), box_low(low.z)}, {box_high(high.x), box_high(high.y), box_high(high.z)}};
}

} // namespace prolate
