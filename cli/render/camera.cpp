#include "cli/render/camera.hpp"

#include <cmath>

namespace prolate::cli {

using glm::dvec3;

dvec3 up_vector(UpAxis up) {
    const auto index = static_cast<uint32_t>(up);
    dvec3 axis(0);
    axis[static_cast<int>(index % 3)] = index < 3 ? 1 : -1;
    return axis;
}

Camera make_camera(const View& view) {
    const dvec3 up = up_vector(view.up);
    // The axis that points to the viewer at azimuth 0: +z for y up, -y for z up, and for x up the next one, +y.
    const auto index = static_cast<uint32_t>(view.up) % 3;
    const dvec3 front = index == 0 ? dvec3(0, 1, 0) : index == 1 ? dvec3(0, 0, 1) : dvec3(0, -1, 0);
    const dvec3 side = glm::cross(up, front);
    const double azimuth = glm::radians(view.azimuth), elevation = glm::radians(view.elevation);
    const dvec3 level = std::cos(azimuth) * front + std::sin(azimuth) * side;
    constexpr double kEyeDistance = 5; // from the center of the unit ball: a mild perspective
    Camera camera;
    camera.forward = -(std::cos(elevation) * level + std::sin(elevation) * up);
    camera.eye = -kEyeDistance * camera.forward;
    camera.right = glm::normalize(glm::cross(camera.forward, up));
    camera.up = glm::cross(camera.right, camera.forward);
    return camera;
}

} // namespace prolate::cli
