// Layout of the section SKIN (src/FORMAT.md), and its check.
#pragma once

#include <prolate/error.hpp>
#include <prolate/tree.hpp>

#include <cstddef>
#include <cstdint>
#include <span>

namespace prolate {

inline constexpr char kSkinKind[4] = {'S', 'K', 'I', 'N'};

enum SkinOffset : size_t {
    kBoneCount = 0,
    kSkinPointCount = 4,
    kSkinWeightCount = 8,
    kSkinInfluenceCount = 12,
    kSkinZeros = 16,
    kFirstInfluences = 24, // u32 for each slot, and the end
};
// Of a node and a bone; weights and spreads in kWeightSteps.
enum InfluenceOffset : size_t {
    kInfluenceBone = 0,
    kInfluenceWeight = 2,
    kInfluenceSpread = 4,
    kInfluenceZeros = 6,
    kInfluenceCenter = 8,
    kInfluenceRadius = 20,
    kInfluenceBytes = 24,
};
inline constexpr uint16_t kWeightSteps = 0x8000; // are 1: all weights are exact, and so is their sum
inline constexpr size_t kSkinPointBytes = 12;

constexpr uint64_t influences_begin(uint32_t slots) {
    return kFirstInfluences + (uint64_t{slots} + 1) * 4;
}
constexpr uint64_t skin_points_begin(uint32_t slots, uint32_t influences) {
    return influences_begin(slots) + uint64_t{influences} * kInfluenceBytes;
}
/// Of a point: its weights, floats, then their bones, u16.
constexpr size_t point_weights_bytes(uint32_t weights) {
    return size_t{weights} * 6;
}
constexpr uint64_t skin_bytes(uint32_t slots, uint32_t influences, uint32_t points, uint32_t weights, bool exact) {
    return skin_points_begin(slots, influences) +
           uint64_t{points} * (point_weights_bytes(weights) + (exact ? 0 : kSkinPointBytes));
}

/// Is it a sound skin of the tree, a whole one without this section? `where` counts from its begin.
Result<void> check_skin(std::span<const std::byte> content, const TreeView& tree) noexcept;

} // namespace prolate
