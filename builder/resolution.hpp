// How finely a bake looks at the solid: as the leaves to come need it.
#pragma once

#include "builder/pieces.hpp"
#include "builder/voxels.hpp"

#include <prolate/build.hpp>

#include <functional>

namespace prolate {

/// Leaves to expect.
double expected_leaves(const BuildOptions& options);

/// Pieces at `resolution` voxels along the longest side, or as many more as `leaves` need: `resolution` then says so.
/// Calls again() before each try.
Pieces cut_pieces(MeshView mesh, bool closed, const Winding& winding, double leaves, uint32_t& resolution,
                  const std::function<void()>& again);

/// The coarser cells that the optimisation starts from, no finer than `resolution`.
Voxels start_cells(MeshView mesh, bool closed, const Winding& winding, double leaves, uint32_t resolution);

/// Of the distance field, for pieces of this resolution.
uint32_t field_resolution(uint32_t resolution);

} // namespace prolate
