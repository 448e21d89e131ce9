// Closed parts of a mesh that are inside out.
#pragma once

#include <prolate/mesh.hpp>

namespace prolate {

/// Turns them (clean() says which), given a mesh whose vertices are welded; returns how many. O(n log n).
uint32_t turn_shells(Mesh& mesh);

} // namespace prolate
