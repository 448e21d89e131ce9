// The paper's figure 6: a mesh and covers of it, and their shadows, as POV-Ray traces them.
#pragma once

#include "bench/shadows/stage.hpp"
#include "cli/export/formats.hpp"

#include <optional>
#include <string>
#include <vector>

namespace prolate::bench {

/// One column of a sheet: what casts the shadow, in POV-Ray's words, which define "Cover", and a line below it.
struct Exhibit {
    std::string scene, caption;
};

/// A mesh in POV-Ray's words, in the neutral grey of `prolate render`.
std::string pov_mesh(MeshView mesh);

/// Exhibits of one model side by side: above, the object on the ground; below, the ground alone, from above, in the
/// window that holds `shown`.
struct ExhibitRow {
    Stage stage;
    Extent shown; ///< of stage.ground(stage.radius()): where the shadows fall
    std::vector<Exhibit> exhibits;
};

/// Traces every picture, each below `folder`, and writes the sheet as a PNG file. Prints the reason if it cannot.
/// All rows have equally many exhibits.
bool write_shadow_sheet(const std::vector<ExhibitRow>& rows, const std::string& povray, const std::string& folder,
                        const std::string& png);

} // namespace prolate::bench
