// What the culling test of lanes-inl.hpp takes and gives, and the same test on one lane in plain C++: the operations of
// the SIMD kernel in the same order, so that both give the same bits. Tests compare the two; nothing else uses it.
#pragma once

#include "query/lattice.hpp"
#include "src/block.hpp"
#include "src/bytes.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace prolate::query {

inline constexpr float kLaneMargin = 0x1p-19f;    ///< 32 u, u = 2^-24: see lanes-inl.hpp
inline constexpr float kLaneDirection = 0x1p-60f; ///< least |n|_1 of a direction that may separate
/// Exponents of factors are clamped from below: an ellipsoid too thin for single precision grows. No builder comes
/// near.
inline constexpr int32_t kLowestExponent = -60, kHighestExponent = 100;
/// Bounds the length of a stored center, lattice steps.
inline constexpr float kLargestCenter = 113512;

/// An ellipsoid in the lattice coordinates of the block it is tested against.
struct Single {
    float center[3];
    float factor[3][4]; ///< L1, columns; the fourth component is 0
    float shape[3][4];  ///< L1 L1^T, likewise
    float size;         ///< |L1|
    float weight;       ///< 1 / size
    float slack;        ///< the lane-independent part of the margin, a multiple of |n|_1
    float low[4];       ///< its box in these coordinates, outward rounded; the fourth component is 0
    float high[4];
    double exact[3]; ///< the center before it was rounded to float
    double reach;    ///< bounds every length that entered it: rounding in double costs less than 2^-44 of it
};

/// A node as stored, lattice steps of its own tree.
struct LaneNode {
    float center[3];
    float l11, l21, l22, l31, l32, l33;
};
inline LaneNode load_node(const std::byte* block, uint32_t lane, int32_t step_exponent) {
    const auto at = [&](size_t array, size_t i) { return block + block_offset(array, i, lane); };
    const auto natural = [&](size_t array, size_t i) { return static_cast<float>(load_le<uint16_t>(at(array, i))); };
    const auto integer = [&](size_t i) { return static_cast<float>(load_le<int16_t>(at(kBlockOffDiagonal, i))); };
    const int32_t exponent = load_le<int8_t>(block + kBlockExponent + lane) - (16 + step_exponent);
    const float one = std::bit_cast<float>((std::clamp(exponent, kLowestExponent, kHighestExponent) + 127) << 23);
    const float two = one + one; // off-diagonal integers count twice as much
    return {{natural(kBlockCenter, 0), natural(kBlockCenter, 1), natural(kBlockCenter, 2)},
            natural(kBlockDiagonal, 0) * one,
            integer(0) * two,
            natural(kBlockDiagonal, 1) * one,
            integer(1) * two,
            integer(2) * two,
            natural(kBlockDiagonal, 2) * one};
}

// The parts of place(): center, factor and shape, and what follows from them.
inline void place_center(const LaneNode& e, const LatticePose& pose, Single& s) {
    const auto& m = pose.linear;
    const double x = e.center[0], y = e.center[1], z = e.center[2];
    for (size_t i = 0; i < 3; ++i) {
        s.exact[i] = (m[0][i] * x + m[1][i] * y) + (m[2][i] * z + pose.offset[i]);
        s.center[i] = static_cast<float>(s.exact[i]);
    }
}
void place_shape(Single& s) noexcept;
void place_factor(const LaneNode& e, const LatticePose& pose, Single& s) noexcept;
inline void place_size(double reach, Single& s) {
    s.size = std::sqrt(s.shape[0][0] + s.shape[1][1] + s.shape[2][2]);
    s.weight = 1 / s.size;
    const float center = std::abs(s.center[0]) + std::abs(s.center[1]) + std::abs(s.center[2]);
    s.slack = kLaneMargin * (center + kLargestCenter + s.size) + static_cast<float>(0x1p-42 * reach);
    s.reach = reach;
}
// The box around the ellipsoid, widened by the slack, which is far above what rounding costs here.
inline void place_box(Single& s) {
    for (size_t i = 0; i < 3; ++i) {
        const float half = std::sqrt(s.shape[i][i]) + s.slack;
        s.low[i] = s.center[i] - half, s.high[i] = s.center[i] + half;
    }
    s.low[3] = s.high[3] = 0;
}
// Cut with the box around the node's own box, as it lies in these coordinates.
inline void cut_box(const std::byte* block, uint32_t lane, const LatticePose& pose, Single& s) {
    double center[3];
    float half[3];
    for (size_t i = 0; i < 3; ++i) {
        const auto byte = [&](size_t array) {
            return uint32_t{load_le<uint8_t>(block + array + kBlockLanes * i + lane)};
        };
        const uint32_t low = byte(kBlockBoxLow), high = byte(kBlockBoxHigh);
        const auto exponent = int32_t{load_le<uint8_t>(block + kBlockBoxExponent + i)};
        const float half_step = std::bit_cast<float>((126 + exponent) << 23);
        half[i] = static_cast<float>(high - low) * half_step;
        center[i] =
            load_le<int32_t>(block + kBlockBoxOrigin + 4 * i) + double{static_cast<float>(low + high) * half_step};
    }
    const auto& m = pose.linear;
    const auto& r = pose.linear_rounded;
    for (size_t i = 0; i < 3; ++i) {
        const auto at =
            static_cast<float>((m[0][i] * center[0] + m[1][i] * center[1]) + (m[2][i] * center[2] + pose.offset[i]));
        const float reach =
            (std::abs(r[0][i]) * half[0] + std::abs(r[1][i]) * half[1] + std::abs(r[2][i]) * half[2]) + s.slack;
        s.low[i] = std::max(s.low[i], at - reach), s.high[i] = std::min(s.high[i], at + reach);
    }
}

/// Node `lane` of `block`, which belongs to the tree that `pose` comes from.
Single place(const std::byte* block, uint32_t lane, const LatticePose& pose) noexcept;
/// An ellipsoid given in metres of a body frame, in the lattice of a tree in the same frame.
Single place(const PlacedEllipsoid& ellipsoid, const LatticeInfo& lattice) noexcept;

/// Along axis `i`, boxes of the block meet the single's if their upper end is at least `least`, and their lower end at
/// most `most`, box steps. Both are integers, rounded so that too many meet rather than too few.
struct BoxThresholds {
    int32_t least, most;
};
inline BoxThresholds box_thresholds(const std::byte* block, size_t i, const Single& s, float margin) {
    const auto origin = static_cast<float>(load_le<int32_t>(block + kBlockBoxOrigin + 4 * i));
    const auto exponent = int32_t{load_le<uint8_t>(block + kBlockBoxExponent + i)};
    const float per_step = std::bit_cast<float>((127 - exponent) << 23);
    // Rounding of the differences costs 2 u of the lengths, a fraction of the slack. NaN becomes a bound that all meet.
    const float low = (s.low[i] - margin - origin) * per_step, high = (s.high[i] + margin - origin) * per_step;
    const float least =
        std::min(low > 0 ? low + (1 - 0x1p-10f) : 0.0f, 256.0f); // truncation then rounds up, or down by 2^-10
    const float most = std::max(high < 255 ? high : 255.0f, -1.0f);
    return {static_cast<int32_t>(least), static_cast<int32_t>(most)};
}

/// Is the lane's box certainly apart from that of the single, by more than `margin` along an axis?
bool boxes_apart(const std::byte* block, uint32_t lane, const Single& single, float margin) noexcept;

/// One lane's outcome.
struct LaneGap {
    float gap;    ///< p - a - b less the margin, a multiple of |n|: positive only if they are apart; else possibly NaN
    float square; ///< |n|^2
    float depth;  ///< p / (a + b): below 1 they overlap as seen along n, 0 at equal centers
    float size;   ///< |L2|
};
LaneGap lane_gap(const std::byte* block, uint32_t lane, int32_t step_exponent, const Single& single) noexcept;

} // namespace prolate::query
