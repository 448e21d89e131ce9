// A sheet as in the paper's figures 1, 3 and 4: the mesh and the levels of a tree side by side, with captions.
#pragma once

#include "cli/render_panel.hpp"

#include <prolate/error.hpp>

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace prolate::cli {

struct SheetOptions {
    uint32_t width = 1600, height = 1200; ///< pixels, 96 ... 8192 each
    std::vector<uint32_t> levels;         ///< to show, each below the tree's level count; not empty
    View view;
    uint32_t samples = 25; ///< a pixel, 16 ... 1024; rounded up to a square number
    uint32_t threads = 0;  ///< at most; 0 = all cores, and never more
    bool floor_shadow = true;
    std::function<bool(double)> progress; ///< fraction done; return false to cancel
};

/// An image of 8-bit sRGB pixels, row by row from the top.
struct Sheet {
    uint32_t width = 0, height = 0;
    std::vector<uint8_t> rgb;
};

/// Renders the sheet: first `mesh` if there is one, then each level's cut. The mesh must be clean. The same input gives
/// the same pixels for any number of threads. Fails with bad_options, cancelled, or io if no font is installed.
Result<Sheet> render_sheet(const TreeView& tree, std::optional<MeshView> mesh, const SheetOptions& options);

/// The bytes of a PNG file. Fails with internal.
Result<std::vector<std::byte>> encode_png(const Sheet& sheet);

} // namespace prolate::cli
