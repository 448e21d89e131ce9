// One panel of a sheet: a scene, ray traced on white paper with soft light, a soft ground shadow and thin outlines.
#pragma once

#include "cli/render/scene.hpp"

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

namespace prolate::cli {

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
