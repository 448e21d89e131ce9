// The proof for exact trees.
#pragma once

#include <prolate/verify.hpp>

namespace prolate {

/// Do the triangles of `tree`, which has some, equal those of the cleaned mesh, and does each lie in the ellipsoids of
/// its leaf and all ancestors? Then every cut covers the surface. Fills `report`.
void verify_exact(const TreeView& tree, MeshView mesh, VerifyReport& report);

} // namespace prolate
