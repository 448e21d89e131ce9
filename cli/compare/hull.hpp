// The convex hull of a mesh, by Qhull.
#pragma once

#include <prolate/mesh.hpp>

#include <optional>

namespace prolate::cli {

/// Closed, oriented outwards, its corners among the mesh's. None if the mesh is flat.
std::optional<Mesh> convex_hull(MeshView mesh);

/// What a closed mesh encloses, cubic metres.
double enclosed_volume(MeshView mesh);

} // namespace prolate::cli
