// What the float tests of triangles (lanes-inl.hpp, distance_lanes-inl.hpp) take and give: eight pairs, one a lane.
#pragma once

#include <cstddef>
#include <cstdint>

namespace prolate::query {

inline constexpr size_t kLanes = 8;

/// What the float tests demand beyond zero (lanes-inl.hpp), in the lanes' unit: the greatest coordinate of a
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

/// In the lanes' unit, in which no two are farther apart than kFarLimit.
struct TriangleBounds {
    float lower[kLanes];
};
inline constexpr float kFarLimit = 16;

} // namespace prolate::query
