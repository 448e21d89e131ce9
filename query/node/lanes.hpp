// What the culling tests of lanes-inl.hpp take: the node of the other tree, placed in the lattice coordinates of a
// block. place() and boxes_apart() are plain C++, which Highway's scalar target runs, with the operations of
// place-inl.hpp and lanes-inl.hpp in the same order: all give the same bits.
#pragma once

#include "query/node/lattice.hpp"
#include "src/block.hpp"
#include "src/bytes.hpp"
#include "src/hull.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace prolate::query {

inline constexpr float kLaneMargin = 0x1p-19f;        ///< 32 u, u = 2^-24: see lanes-inl.hpp
inline constexpr float kOverlapLaneMargin = 0x1p-16f; ///< 256 u: see overlapping() there
inline constexpr float kLaneDirection = 0x1p-60f;     ///< least |n|_1 of a direction that may separate
/// Bounds the length of a stored center, lattice steps.
inline constexpr float kLargestCenter = 113512;
/// 8 u: half a box's width grows by this share of the length of the box's center, and by kBoxSlack = 2^16 kBoxMargin.
inline constexpr float kBoxMargin = 0x1p-21f, kBoxSlack = 0x1p-5f;
/// What a hull record's integers count.
inline constexpr auto kPerHullUnit = static_cast<float>(1 / kHullUnit),
                      kPerHullShare = static_cast<float>(1 / kHullShares);
/// Turns truncation into rounding up, or down by at most 2^-10.
inline constexpr float kAlmostOne = 1 - 0x1p-10f;

/// An ellipsoid in the lattice coordinates of the block it is tested against. Vectors have a fourth component, which
/// kernels carry along: of columns, it repeats the first; of boxes, it means nothing.
struct Single {
    alignas(32) double exact[4]; ///< the center before it was rounded to float
    alignas(16) float center[4];
    alignas(16) float factor[3][4];    ///< L1, columns
    alignas(16) float diagonal[4];     ///< of Q1 = L1 L1^T: xx, yy, zz
    alignas(16) float off_diagonal[4]; ///< xy, yz, zx
    alignas(16) float low[4];          ///< its box in these coordinates, outward rounded
    alignas(16) float high[4];
    float size;   ///< |L1|
    float weight; ///< 1 / size
    float slack;  ///< the lane-independent part of the margin, a multiple of |n|_1
    double reach; ///< bounds every length that entered it: rounding in double costs less than 2^-44 of it
};

/// The box of a node where its ellipsoid is a Single: {center + t0 axis[0] + t1 axis[1] + t2 axis[2] : |ti| <= 1}.
/// Along n it reaches no farther than center.n + sum |axis.n| + slack |n|, in whatever order floats sum that up.
struct PlacedBox {
    alignas(16) float center[4];  ///< from the ellipsoid's center
    alignas(16) float axis[3][4]; ///< half the sides
    float slack;
};

/// The share of Single::slack that is the same for all nodes.
inline float common_slack(double reach) {
    return kLaneMargin * kLargestCenter + static_cast<float>(0x1p-42 * reach);
}

/// Node `lane` of `block`, which belongs to the tree that `pose` comes from, and if `box` is not null its box.
Single place(const std::byte* block, uint32_t lane, const LatticePose& pose, PlacedBox* box = nullptr) noexcept;
/// An ellipsoid given in metres of a body frame, in the lattice of a tree in the same frame.
Single place(const PlacedEllipsoid& ellipsoid, const LatticeInfo& lattice) noexcept;

/// Is the lane's box certainly apart from that of the single, by more than `margin` along an axis?
bool boxes_apart(const std::byte* block, uint32_t lane, const Single& single, float margin) noexcept;

/// The record of the inner node in `lane` of `block`, of those that begin at `hulls`; null if that is.
inline const std::byte* hull_of(const std::byte* hulls, const std::byte* block, uint32_t lane) {
    return hulls != nullptr ? hulls + size_t{first_child(block, lane) / kBlockLanes} * kHullBytes : nullptr;
}
} // namespace prolate::query
