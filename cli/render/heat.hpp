// Colours for how far a cover sticks out, and the legend that tells what they mean.
#pragma once

#include "cli/render/image.hpp"

#include <cstdint>
#include <string>
#include <vector>

#include <glm/glm.hpp>

namespace prolate::cli {

/// From percent of the mesh's diagonal to colours. Cube roots are spaced evenly: one scale then serves a coarse level
/// and a fine one as well as logarithms would, and 0 has a place.
struct HeatScale {
    double top = 1;      ///< the last colour, percent, > 0
    bool beyond = false; ///< can there be more? It then has the same colour

    /// The least round number that is no smaller than `percent`, as a top.
    static double round_up(double percent);
    double share(double percent) const;
    /// Linear sRGB.
    glm::dvec3 colour(double percent) const;
};

/// Height of the legend, pixels, in letters of size `text`.
uint32_t legend_height(uint32_t text);

/// Draws it, centered, below `top`. Of the numbers 1, 2, 5, 10, ... as many are given as can be read.
void draw_legend(Sheet& sheet, const Font& font, const HeatScale& scale, uint32_t text, uint32_t top);

} // namespace prolate::cli
