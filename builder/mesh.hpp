// What a mesh must be for clean() to take it.
#pragma once

#include <prolate/mesh.hpp>

namespace prolate {

/// Fails with bad_mesh, for what clean() says. O(n).
Result<void> check_mesh(MeshView mesh);

} // namespace prolate
