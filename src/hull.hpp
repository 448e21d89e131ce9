// A hull record of an .etree file: points whose convex hull holds all triangles below an inner node of an exact tree,
// but for a share of the node's ellipsoid {c + L u : |u| <= 1} by which they may stick out of it:
//     {c + L (conv(w_1 ... w_16) + share u) : |u| <= 1},  w = q / kHullUnit.
// Along d it reaches d.c + max v.w_i + share |v|, v = L^T d.
//
// Where the triangles below the node are as good as coplanar, the record also names one of them, and between which
// heights over its plane all of their corners lie: a slab (src/slab.hpp). src/FORMAT.md is normative.
#pragma once

#include <prolate/tree.hpp>

#include <cstddef>
#include <cstdint>

namespace prolate {

inline constexpr size_t kHullPoints = 16;
inline constexpr size_t kHullPoint = 0;   ///< i8[3][16]: q, first coordinates first
inline constexpr size_t kHullShare = 48;  ///< u8: the share, 255ths; 0: nothing is known of this node
inline constexpr size_t kHullNormal = 49; ///< i8[3]: the plane's unit normal, 127ths; 0: there is no slab
inline constexpr size_t kHullPlane = 52;  ///< u32: a triangle in the plane
inline constexpr size_t kHullLow = 56;    ///< f32: least height of a corner over it, metres
inline constexpr size_t kHullHigh = 60;   ///< f32: greatest height
inline constexpr double kHullUnit = 127, kHullShares = 255;
static_assert(kHullHigh + sizeof(float) == kHullBytes);

} // namespace prolate
