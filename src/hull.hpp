// A hull record of an .etree file: points whose convex hull holds all triangles below an inner node of an exact tree,
// but for a share of the node's ellipsoid {c + L u : |u| <= 1} by which they may stick out of it:
//     {c + L (conv(w_1 ... w_16) + share u) : |u| <= 1},  w = q / kHullUnit.
// Along d it reaches d.c + max v.w_i + share |v|, v = L^T d. src/FORMAT.md is normative.
#pragma once

#include <prolate/tree.hpp>

#include <cstddef>
#include <cstdint>

namespace prolate {

inline constexpr size_t kHullPoints = 16;
inline constexpr size_t kHullPoint = 0;     ///< i8[3][16]: q, first coordinates first
inline constexpr size_t kHullShare = 48;    ///< u8: the share, 255ths; 0: nothing is known of this node
inline constexpr size_t kHullReserved = 49; ///< 0 ... to the end
inline constexpr double kHullUnit = 127, kHullShares = 255;
static_assert(kHullReserved < kHullBytes);

} // namespace prolate
