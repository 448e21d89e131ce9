// What a bake is asked for against what can be had: refusals that name the nearest that is possible.
#pragma once

#include "cli/bake/asset.hpp"
#include "cli/failure.hpp"

namespace prolate::cli {

/// Can the lengths that are asked for be had of this mesh? Costs a look at its vertices.
Outcome<> check_lengths(const Asset& asset, const BuildOptions& options, MeshView mesh);

/// Is the tree as close as was asked? (Fewer leaves or levels than were asked for are no failure.)
Outcome<> check_closeness(const Asset& asset, const Baked& baked);

} // namespace prolate::cli
