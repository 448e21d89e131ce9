#include "bench/shadows/stage.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace prolate::bench {

using glm::dvec3;

Stage::Stage(MeshView mesh, const cli::View& view)
    : up_(cli::up_vector(view.up)), low_(std::numeric_limits<double>::infinity()), high_(-low_),
      camera_(cli::make_camera(view)) {
    height_ = low_.x;
    for (const Vec3& v : mesh.vertices) {
        const dvec3 p(v.x, v.y, v.z);
        low_ = glm::min(low_, p), high_ = glm::max(high_, p);
        height_ = std::min(height_, glm::dot(p, up_));
    }
    center_ = (low_ + high_) / 2.0;
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

// A point at a to the right and z ahead is in view from (x, e) if |a - x| <= slope (z - e): from all points together, a
// middle x and the largest e. The same upwards; the smaller e holds.
dvec3 Stage::eye(const Ground& ground, const Extent& shown, const glm::dvec2& slopes) const {
    std::vector<dvec3> points;
    for (const double x : {shown.x0, shown.x1})
        for (const double y : {shown.y0, shown.y1})
            points.push_back(ground.corner + x * ground.right + y * ground.down);
    for (int corner = 0; corner < 8; ++corner)
        points.push_back(glm::mix(low_, high_, glm::bvec3(corner & 1, corner & 2, corner & 4)));
    double ahead = std::numeric_limits<double>::infinity();
    dvec3 out(0);
    for (const int axis : {0, 1}) {
        const dvec3& across = axis == 0 ? camera_.right : camera_.up;
        double least = std::numeric_limits<double>::infinity(), most = -least;
        for (const dvec3& p : points) {
            const double a = glm::dot(p, across), reach = slopes[axis] * glm::dot(p, camera_.forward);
            least = std::min(least, a + reach), most = std::max(most, a - reach);
        }
        out += (least + most) / 2 * across;
        ahead = std::min(ahead, (least - most) / (2 * slopes[axis]));
    }
    return out + ahead * camera_.forward;
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
