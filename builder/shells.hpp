// Closed parts of a mesh: which are inside out, and does any enclose something?
#pragma once

#include <prolate/mesh.hpp>

namespace prolate {

struct TurnedShells {
    uint32_t turned = 0;     ///< how many
    bool has_volume = false; ///< does any shell enclose more out than in, or more in than out?
};

/// Turns those that are inside out (clean() says which), given a mesh whose vertices are welded. O(n log n).
TurnedShells turn_shells(Mesh& mesh);

/// Does a mesh without open edges have winding number 0 wherever it may be told from its surface? Then each piece of it
/// stands there twice, facing both ways. For meshes whose shells have no volume. O(n log n).
bool encloses_nothing(const Mesh& mesh);

} // namespace prolate
