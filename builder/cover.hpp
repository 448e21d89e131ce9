// The last step of every bake: from a fit to a stored node whose *decoded* ellipsoid covers.
#pragma once

#include "builder/fit.hpp"
#include "builder/pieces.hpp"

#include "src/format.hpp"

#include <functional>
#include <optional>
#include <span>

namespace prolate {

/// Points of the pieces reach at most to 1 - kSlack in radial coordinates. The slack (0.02 % of the volume) absorbs the
/// rounding of the clipped points by a wide margin and lets verify() end quickly.
inline constexpr double kSlack = 0x1p-14;

/// Quantises `fit` and enlarges it by the least that brings `reach` of the decoded ellipsoid, the largest radial
/// coordinate of what it has to hold, below 1. Cover does therefore not depend on how well the fit converged. Empty
/// only if the format cannot hold the size.
std::optional<format::PackedNode> covering_node(const Fit& fit, const format::Lattice& lattice,
                                                const std::function<double(const Fit&)>& reach);

/// The same for the points of `members`, and all points within `margin` of them.
std::optional<format::PackedNode> covering_node(const Fit& fit, const Pieces& pieces, std::span<const uint32_t> members,
                                                const format::Lattice& lattice, double margin = 0);

/// How much farther out in radial coordinates points may lie within `margin` of others: |L^-1 v| <= |L^-1| |v|.
double radial_margin(const Fit& fit, double margin);

/// E_sur: largest radial distance |p - d_o(p)| between a point of the mesh in `members` and its radial projection onto
/// the ellipsoid (paper, eq. 1), over the corners of the clipped triangles.
double surface_error(const Fit& fit, const Pieces& pieces, std::span<const uint32_t> members);

} // namespace prolate
