// What a mesh must be for clean() to take it, and how large its surface is.
#pragma once

#include <prolate/mesh.hpp>

namespace prolate {

/// Fails with bad_mesh, for what clean() says. O(n).
Result<void> check_mesh(MeshView mesh);

/// Sum of the triangles' areas, square metres. O(n).
double surface_area(MeshView mesh);

} // namespace prolate
