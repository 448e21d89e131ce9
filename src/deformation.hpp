// Layout of the section DFRM (src/FORMAT.md), and its check.
#pragma once

#include <prolate/error.hpp>
#include <prolate/tree.hpp>

#include <cstddef>
#include <cstdint>
#include <span>

namespace prolate {

inline constexpr char kDeformationKind[4] = {'D', 'F', 'R', 'M'};

enum DeformationOffset : size_t {
    kModeCount = 0,
    kPointCount = 4,
    kModeZeros = 8,
    kModeRows = 16, // of kModeRowBytes each
};
// Of a mode's row: range, then the steps of shifts, growths and radii, floats.
enum ModeRowOffset : size_t { kModeRange = 0, kShiftStep = 4, kGrowthStep = 8, kRadiusStep = 12, kModeRowBytes = 16 };
// Of a node and a mode, in these steps: three int16, and a uint16, a growth, or with the highest bit a radius.
enum MotionOffset : size_t { kShift = 0, kGrowth = 6, kMotionBytes = 8 };
inline constexpr uint16_t kIsRadius = 0x8000, kMostMotionSteps = 0x7fff;
inline constexpr size_t kPointBytes = 12;

/// At the ends of its coordinates' ranges, the root is larger by no more than this factor: with more, modes and ranges
/// make no sense. Nor does any node grow by more in one mode, so that all sums are finite.
inline constexpr double kMostMotionGrowth = 1024;

/// Where the nodes' motions begin, the points, and their displacements.
constexpr size_t motions_begin(uint32_t modes) {
    return kModeRows + size_t{modes} * kModeRowBytes;
}
constexpr uint64_t points_begin(uint32_t modes, uint32_t slots) {
    return motions_begin(modes) + uint64_t{slots} * modes * kMotionBytes;
}
constexpr uint64_t displacements_begin(uint32_t modes, uint32_t slots, uint32_t points, bool exact) {
    return points_begin(modes, slots) + (exact ? 0 : uint64_t{points} * kPointBytes);
}
constexpr uint64_t deformation_bytes(uint32_t modes, uint32_t slots, uint32_t points, bool exact) {
    return displacements_begin(modes, slots, points, exact) + uint64_t{points} * modes * kPointBytes;
}

/// Is it a sound deformation of the tree, a whole one without this section? `where` counts from its begin.
Result<void> check_deformation(std::span<const std::byte> content, const TreeView& tree) noexcept;

} // namespace prolate
