// Where the viewer of a picture stands.
#pragma once

#include "cli/render/scene.hpp"

#include <cstdint>

namespace prolate::cli {

/// The axis that points up in the picture.
enum class UpAxis : uint8_t { x, y, z, minus_x, minus_y, minus_z };
/// What the command line calls them, in the same order.
inline constexpr const char* kUpAxes[] = {"x", "y", "z", "-x", "-y", "-z"};

/// Where the viewer stands, in degrees. Azimuth 0 looks at the front (for y up, along -z; for z up, along +y) and
/// grows as the viewer walks to the right; elevation is the height above the horizon, -89 ... 89.
struct View {
    double azimuth = 30, elevation = 18;
    UpAxis up = UpAxis::y;
};

/// Unit vector of the axis.
glm::dvec3 up_vector(UpAxis up);

/// A camera outside of the unit ball, looking at its center.
Camera make_camera(const View& view);

} // namespace prolate::cli
