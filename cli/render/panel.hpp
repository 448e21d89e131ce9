// One panel of a sheet: a scene, ray traced on white paper with soft light, a soft ground shadow and thin outlines.
#pragma once

#include "cli/render/scene.hpp"

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

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

/// Linear sRGB of a surface or section at a hit, before light.
using Paint = std::function<glm::dvec3(const Hit&, const glm::dvec3& point)>;

/// What one panel shows.
struct PanelContent {
    const Scene* scene = nullptr;
    Paint paint;
    /// Drawn with it if there is one, painted in the same way: a section shows the mesh's before all else, ...
    const Scene* mesh = nullptr;
    bool see_through = false; ///< ... and the surfaces of `scene` let the mesh behind them be seen
    double relief = 1;        ///< how much light, shadow and outlines change colours, 0 ... 1
};

/// How a panel is drawn.
struct PanelSettings {
    Camera camera;
    Window window; ///< slopes at the image's borders
    glm::dvec3 up{0, 1, 0};
    std::optional<HalfSpace> section; ///< cut away what lies beyond
    bool floor_shadow = true;         ///< draw the shadow on a floor that the scene stands on
    uint32_t width = 0, height = 0;
    uint32_t grid = 6;     ///< samples a pixel: grid * grid
    double line_width = 1; ///< outlines, in pixels
};

/// Pixels, row by row from the top.
struct PanelImage {
    uint32_t width = 0, height = 0;
    std::vector<glm::vec3> colour; ///< linear sRGB, 0 ... 1
    std::vector<float> coverage;   ///< part of the pixel's samples that hit something
};

/// Runs on the threads of the calling task arena; the result does not depend on their number. `progress` is called with
/// the fraction done, by one thread at a time; if it returns false, so does this function soon, with an incomplete
/// image.
bool render_panel(const PanelContent& content, const PanelSettings& settings,
                  const std::function<bool(double)>& progress, PanelImage& image);

} // namespace prolate::cli
