// Two leaves of exact trees: does a triangle of one meet a triangle of the other? Float kernels answer for eight pairs
// at once; what they leave open the scalar test of triangle.hpp decides.
#pragma once

#include "query/triangle.hpp"

#include <cstddef>
#include <cstdint>

namespace prolate::query {

inline constexpr size_t kLanes = 8;

/// What the float tests demand beyond zero (triangle_lanes-inl.hpp), in the lanes' unit: the greatest coordinate of a
/// corner lies in [1/2, 1).
struct LaneMargins {
    float direction;    // of a separating direction n, times |n|_1
    float corner_error; // a coordinate of a corner is wrong by no more
    float distance;     // triangles are apart only if farther than this
};
/// Their parts that do not depend on the leaves. The tests give others, to show that wrong ones are caught.
struct LaneMarginFactors {
    float direction = 0x1p-18f; // 64 u, u = 2^-24
    float volume = 0x1p-17f;    // 128 u
};

/// What the placement of corners in float costs, of the lanes' unit: 24 u.
inline constexpr float kPlacementError = 0x1.8p-20f;

/// A bit a lane. Neither: not known.
struct LaneVerdicts {
    uint32_t apart; // no common point, more than margins.distance apart
    uint32_t meet;  // a common point
};

/// Triangles, one a lane: row 3 i + k is coordinate k of corner i.
struct TriangleRows {
    float row[9][kLanes];
};

struct LeafResult {
    bool meet = false;                        // some two are not certainly more than `distance` apart
    uint32_t triangle_a = 0, triangle_b = 0;  // the first such two
    uint32_t pair_tests = 0, exact_tests = 0; // pairs up to these, and those of them that took the scalar test
};
/// Both trees have triangles, the ranges are not empty. Pairs are taken by fours of A's triangles, and for each by
/// fours of B's; among these in the order of B's, and of A's for each. `distance` >= 0.
LeafResult test_leaves(const TreeView& a, TriangleRange in_a, const TreeView& b, TriangleRange in_b,
                       const RelativePose& b_to_a, double distance = 0, const LaneMarginFactors& factors = {}) noexcept;

/// The kernel alone, for the tests and benchmarks: a call a vector costs more than it does.
LaneVerdicts test_lanes(const TriangleRows& a, const TriangleRows& b, const LaneMargins& margins,
                        const LaneMarginFactors& factors) noexcept;

} // namespace prolate::query
