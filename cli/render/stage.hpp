// All that a sheet draws, and what it is drawn from.
#pragma once

#include "cli/render/heat.hpp"
#include "cli/render/panel.hpp"
#include "cli/render/scene_cut.hpp"
#include "cli/render/scene_inner.hpp"
#include "cli/render/scene_mesh.hpp"
#include "cli/render/scene_moved.hpp"
#include "cli/render/sheet.hpp"
#include "cli/render/solid.hpp"

#include <list>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace prolate::cli {

/// What one panel shows, and says.
struct Panel {
    PanelContent content;
    std::string caption;
};

/// Panels and what they refer to; its address must stay.
struct Stage {
    Frame frame;
    Box box;                              // of the mesh, or if there is none, of what is shown
    std::list<std::vector<float>> growth; // of each tree, node_growth()
    std::unique_ptr<Solid> solid;         // if needed
    std::unique_ptr<MeshScene> mesh;      // if shown
    std::list<CutScene> cuts;             // of the levels to show
    std::list<InnerScene> inner;          // the mesh with the inner cover at each of them, in sections
    std::list<MeshScene> surfaces;        // of covers that are no tree, and of the mesh where it has moved
    std::list<Solid> solids;              // that these bound, if needed
    std::list<MovedScene> moved;          // of the levels, at the coordinates to show
    std::vector<glm::dvec3> colours;      // by slots
    std::optional<HeatScale> heat;
    std::vector<Panel> panels;
};

/// For render_sheet(). The options must be sound, and outlive it.
std::unique_ptr<Stage> make_stage(const TreeView& tree, const CleanMesh* mesh, const SheetOptions& options);
/// For render_covers(): the mesh, and the leaves of each tree and each surface.
std::unique_ptr<Stage> make_stage(std::span<const CoverPanel> covers, const CleanMesh& mesh,
                                  const SheetOptions& options);

} // namespace prolate::cli
