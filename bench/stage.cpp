#include "bench/stage.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace prolate::bench {

using glm::dvec3;

Stage::Stage(MeshView mesh, const cli::View& view) : up_(cli::up_vector(view.up)), camera_(cli::make_camera(view)) {
    dvec3 low(std::numeric_limits<double>::infinity()), high(-low);
    height_ = low.x;
    for (const Vec3& v : mesh.vertices) {
        const dvec3 p(v.x, v.y, v.z);
        low = glm::min(low, p), high = glm::max(high, p);
        height_ = std::min(height_, glm::dot(p, up_));
    }
    center_ = (low + high) / 2.0;
    for (const Vec3& v : mesh.vertices) radius_ = std::max(radius_, glm::length(dvec3(v.x, v.y, v.z) - center_));
}

Lamp Stage::lamp(double turn) const {
    // Behind the camera's left shoulder at first, so that the shadow falls to the right, where it is seen.
    const dvec3 facing = glm::cross(up_, camera_.right);
    const double angle = glm::radians(turn + 65);
    const dvec3 level = -std::cos(angle) * facing - std::sin(angle) * camera_.right;
    const dvec3 to_lamp = (level + up_) / std::sqrt(2.0);
    const dvec3 side = radius_ / 2 * glm::cross(up_, level), other_side = glm::cross(to_lamp, side);
    return {center_ + 5 * radius_ * to_lamp, side, other_side};
}

dvec3 Stage::eye() const {
    return center_ + radius_ * (1.3 * camera_.eye + 0.45 * camera_.right); // the shadow falls to the right
}

Ground Stage::ground(double pitch) const {
    const dvec3 facing = glm::cross(up_, camera_.right);
    return {up_, pitch * camera_.right, -pitch * facing, center_ + (height_ - glm::dot(center_, up_)) * up_};
}

Ground Stage::window(const Ground& ground, const Extent& extent, int border) {
    Ground out = ground;
    const double x0 = std::floor(extent.x0) - border, y0 = std::floor(extent.y0) - border;
    out.columns = static_cast<int>(std::ceil(extent.x1) - x0) + border;
    out.rows = static_cast<int>(std::ceil(extent.y1) - y0) + border;
    out.corner += x0 * ground.right + y0 * ground.down;
    return out;
}

} // namespace prolate::bench
