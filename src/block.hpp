// A block of an .etree file: eight siblings, and a box around each, as a structure of arrays, little-endian, so that
// vector code loads one array of eight lanes at a time straight from the file's bytes. src/FORMAT.md is normative;
// changing an offset is a new format version. Numbers decode as format.hpp says. Lanes without a node are all zero
// bytes.
#pragma once

#include "src/bytes.hpp"

#include <prolate/tree.hpp>

#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace prolate {

inline constexpr size_t kBlockAlignment = 64;     ///< of blocks within the file, bytes
inline constexpr size_t kBlockCenter = 0;         ///< u16[3][8]: x, y, z of the center, whole lattice steps
inline constexpr size_t kBlockDiagonal = 48;      ///< u16[3][8]: l11, l22, l33; 1 ... 65535
inline constexpr size_t kBlockOffDiagonal = 96;   ///< i16[3][8]: l21, l31, l32
inline constexpr size_t kBlockExponent = 144;     ///< i8[8]
inline constexpr size_t kBlockCount = 152;        ///< u8[8]: children, or kTriangleLeaf + triangles of a leaf
inline constexpr size_t kBlockFraction = 160;     ///< u16[8]: three times five bits, of the center, 32nds of a step
inline constexpr size_t kBlockOffset = 176;       ///< u8[8]: of an inner node, blocks of the children of lanes before
inline constexpr size_t kBlockChildren = 184;     ///< u32: the block where the children of the lanes begin
inline constexpr size_t kBlockTriangles = 188;    ///< u32: the triangle where those of the lanes begin
inline constexpr size_t kBlockBoxLow = 192;       ///< u8[3][8]: lower corner of the lane's box, x, y, z, box steps
inline constexpr size_t kBlockBoxHigh = 216;      ///< u8[3][8]: upper corner
inline constexpr size_t kBlockBoxOrigin = 240;    ///< i32[3]: where box coordinates begin, lattice coordinates
inline constexpr size_t kBlockBoxExponent = 252;  ///< u8[3]: a box step is 2^exponent lattice steps, an axis each
inline constexpr size_t kBlockReserved = 255;     ///< 0
inline constexpr uint8_t kTriangleLeaf = 0x80;    ///< this bit of a count marks a count of triangles instead
inline constexpr int32_t kMaxBoxOrigin = 1 << 24; ///< above the absolute value of a box origin: a float holds it
/// A node's exponent less the lattice's. No half extent takes more than sqrt(18) 2^21 steps, so its box fits; and no
/// square of an entry, in steps, is a subnormal float.
inline constexpr int32_t kMinNodeSize = -30, kMaxNodeSize = 21;
inline constexpr uint8_t kMaxBoxExponent = 22;

static_assert(kBlockReserved + 1 == kBlockBytes && kBlockBytes % kBlockAlignment == 0);
static_assert(kMaxDegree < kTriangleLeaf && kMaxLeafTriangles < kTriangleLeaf);

/// Where component `i` of the 16-bit array at `array` stands for `lane`.
constexpr size_t block_offset(size_t array, size_t i, size_t lane) {
    return array + 2 * (kBlockLanes * i + lane);
}

inline constexpr int kFractionBits = 5;
inline constexpr int32_t kCenterUnits = 1 << kFractionBits; ///< a lattice step, of a center
inline constexpr int32_t kMaxCenter = UINT16_MAX * kCenterUnits;
inline constexpr uint16_t kNoFraction = 0x8000; ///< bits of a fraction that are 0
/// The bits of a fraction that are coordinate `i`, and what their lowest counts if they stay in place, steps.
constexpr int32_t fraction_mask(size_t i) {
    return (kCenterUnits - 1) << kFractionBits * i;
}
constexpr float fraction_unit(size_t i) {
    return 1.0f / static_cast<float>(kCenterUnits << kFractionBits * i);
}
/// Coordinate `i` of a lane's center, 32nds of a lattice step.
inline int32_t stored_center(const std::byte* block, size_t i, size_t lane) {
    const uint32_t fractions = load_le<uint16_t>(block + kBlockFraction + 2 * lane);
    return load_le<uint16_t>(block + block_offset(kBlockCenter, i, lane)) * kCenterUnits +
           static_cast<int32_t>(fractions >> kFractionBits * i & (kCenterUnits - 1));
}

/// What the squares of a node's factor are multiples of, in steps: a normal float, since open() bounds the exponents.
inline constexpr int32_t kFactorBias = 127 - 30;
inline float factor_unit(int32_t exponent, int32_t step_exponent) {
    return std::bit_cast<float>((exponent + (kFactorBias - step_exponent)) << 23);
}

/// A node as stored, lattice steps of its own tree.
struct LaneNode {
    float center[3];
    float l11, l21, l22, l31, l32, l33;
};
inline LaneNode load_node(const std::byte* block, uint32_t lane, int32_t step_exponent) {
    const auto at = [&](size_t array, size_t i) { return block + block_offset(array, i, lane); };
    const auto natural = [&](size_t array, size_t i) { return static_cast<float>(load_le<uint16_t>(at(array, i))); };
    const float unit = factor_unit(load_le<int8_t>(block + kBlockExponent + lane), step_exponent);
    const auto diagonal = [&](size_t i) {
        const float q = natural(kBlockDiagonal, i);
        return q * unit * q;
    };
    const auto off_diagonal = [&](size_t i) {
        const auto q = static_cast<float>(load_le<int16_t>(at(kBlockOffDiagonal, i)));
        return q * unit * std::abs(q);
    };
    const auto center = [&](size_t i) { return static_cast<float>(stored_center(block, i, lane)) / kCenterUnits; };
    return {{center(0), center(1), center(2)},
            diagonal(0),
            off_diagonal(0),
            diagonal(1),
            off_diagonal(1),
            off_diagonal(2),
            diagonal(2)};
}

/// Slot of the first child of the inner node in `lane`.
inline uint32_t first_child(const std::byte* block, size_t lane) {
    return kBlockLanes * (load_le<uint32_t>(block + kBlockChildren) + load_le<uint8_t>(block + kBlockOffset + lane));
}

/// The first triangle of the leaf in `lane`, of an exact tree: those of the lanes before come first.
inline uint32_t first_triangle(const std::byte* block, size_t lane) {
    static_assert(kTriangleLeaf == 0x80 && kBlockLanes == 8);
    const uint64_t before = load_le<uint64_t>(block + kBlockCount) & ((uint64_t{1} << 8 * lane) - 1);
    const uint64_t leaves = before & 0x8080808080808080, triangles = before & (leaves - (leaves >> 7));
    constexpr uint64_t kEven = 0x00ff00ff00ff00ff; // sums of two counts take 8 bits, and of all of them 16
    const uint64_t pairs = (triangles & kEven) + (triangles >> 8 & kEven);
    return load_le<uint32_t>(block + kBlockTriangles) + static_cast<uint32_t>(pairs * 0x0001000100010001 >> 48);
}

/// Blocks that `siblings` nodes take.
constexpr uint32_t blocks_for(uint32_t siblings) {
    return (siblings + kBlockLanes - 1) / kBlockLanes;
}

} // namespace prolate
