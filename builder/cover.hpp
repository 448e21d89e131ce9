// The last step of every bake: from a fit to a stored node whose *decoded* ellipsoid covers.
#pragma once

#include "builder/fit.hpp"
#include "builder/voxels.hpp"

#include "src/format.hpp"

#include <optional>
#include <span>

namespace prolate {

/// Points of the cells reach at most to 1 - kSlack in radial coordinates. The slack (0.02 % of the volume) absorbs the
/// rounding of the clipped points by a wide margin and lets verify() end quickly.
inline constexpr double kSlack = 0x1p-14;

/// Quantises `fit` and enlarges it by the least that makes the decoded ellipsoid cover the points of `cells`. Cover
/// does therefore not depend on how well the fit converged. Empty only if the format cannot hold the size.
std::optional<format::PackedNode> covering_node(const Fit& fit, const Voxels& voxels, std::span<const uint32_t> cells,
                                                const format::Lattice& lattice);

} // namespace prolate
