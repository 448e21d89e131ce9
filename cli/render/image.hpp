// The picture itself: pixels, letters on it, a PNG file of it.
#pragma once

#include "cli/render/text.hpp"

#include <prolate/error.hpp>

#include <cstddef>
#include <cstdint>
#include <vector>

namespace prolate::cli {

/// An image of 8-bit sRGB pixels, row by row from the top.
struct Sheet {
    uint32_t width = 0, height = 0;
    std::vector<uint8_t> rgb;
};

/// Draws `line` in dark grey with its upper left corner at (x0, y0); what lies beyond the sheet is left out.
void draw_line(Sheet& sheet, const TextImage& line, uint32_t x0, uint32_t y0);

/// The bytes of a PNG file. Fails with internal.
Result<std::vector<std::byte>> encode_png(const Sheet& sheet);

} // namespace prolate::cli
