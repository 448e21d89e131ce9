// A sheet as in the paper's figures 1, 3 and 4: the mesh and the levels of a tree side by side, with captions; or a cut
// through both, or how far each level sticks out of the mesh.
#pragma once

#include "cli/render/camera.hpp"
#include "cli/render/image.hpp"

#include <prolate/error.hpp>
#include <prolate/mesh.hpp>
#include <prolate/tree.hpp>

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace prolate::cli {

/// Where a mesh is drawn.
enum class MeshStyle : uint8_t {
    beside,  ///< in a panel of its own, and where a section cuts it, in all panels
    overlay, ///< within the ellipsoids, which let it be seen
    hidden,
};

/// A plane across an axis of the model. What lies on the viewer's side of it is cut away.
struct SectionPlane {
    uint32_t axis = 0; ///< 0, 1, 2: x, y, z
    double at = 0.5;   ///< 0 ... 1: part of the extent of the mesh, or if there is none, of what is shown
};

struct SheetOptions {
    uint32_t width = 1600, height = 1200; ///< pixels, 96 ... 8192 each
    std::vector<uint32_t> levels;         ///< to show, each below the tree's level count; not empty
    View view;
    uint32_t samples = 25; ///< a pixel, 16 ... 1024; rounded up to a square number
    uint32_t threads = 0;  ///< at most; 0 = all cores, and never more
    bool floor_shadow = true;
    MeshStyle mesh_style = MeshStyle::beside;
    std::optional<SectionPlane> section;
    /// Coordinates of a tree that deforms: beside each level at rest it is also shown at each of these. As many as it
    /// has modes, in their ranges. Not with heat.
    std::vector<std::vector<float>> at;
    /// What a unit of each mode adds to each vertex of the mesh, M by V by 3, metres: it is then shown as it moves,
    /// too.
    std::vector<float> displacements;
    /// Colour by how far the cover sticks out of the mesh (Solid::outside_distance), with a legend and figures. Needs a
    /// mesh, and not as an overlay.
    bool heat = false;
    double heat_top = 0;                  ///< end of the legend, percent of the mesh's diagonal; 0 = as the levels need
    std::function<bool(double)> progress; ///< fraction done; return false to cancel
};

/// Renders the sheet: `mesh`, if there is one and it is to be seen beside, then each level's cut. The same input gives
/// the same pixels for any number of threads. Fails with bad_options, cancelled, or io if no font is installed.
Result<Sheet> render_sheet(const TreeView& tree, const CleanMesh* mesh, const SheetOptions& options);

/// One of several covers of a mesh on a sheet.
struct CoverPanel {
    TreeView tree;       ///< whose leaves are shown, ...
    MeshView surface;    ///< ... or this closed surface, if it is not empty
    std::string caption; ///< parts behind a ", " may go into a second line
};

/// Renders the mesh and each cover, coloured by how far it sticks out of the mesh, with a legend for all. Of `options`,
/// levels, mesh_style, section and heat are not looked at. The same input gives the same pixels for any number of
/// threads. Fails with bad_options, cancelled, or io if no font is installed.
Result<Sheet> render_covers(std::span<const CoverPanel> covers, const CleanMesh& mesh, const SheetOptions& options);

} // namespace prolate::cli
