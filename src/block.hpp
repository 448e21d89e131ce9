// A block of an .etree file: eight siblings, and a box around each, as a structure of arrays, little-endian, so that
// vector code loads one array of eight lanes at a time straight from the file's bytes. src/FORMAT.md is normative;
// changing an offset is a new format version. Numbers decode as format.hpp says. Lanes without a node are all zero
// bytes.
#pragma once

#include <prolate/tree.hpp>

#include <cstddef>
#include <cstdint>

namespace prolate {

inline constexpr size_t kBlockAlignment = 64;     ///< of blocks within the file, bytes
inline constexpr size_t kBlockCenter = 0;         ///< u16[3][8]: x, y, z of the center on the lattice
inline constexpr size_t kBlockDiagonal = 48;      ///< u16[3][8]: l11, l22, l33; 1 ... 65535
inline constexpr size_t kBlockOffDiagonal = 96;   ///< i16[3][8]: l21, l31, l32
inline constexpr size_t kBlockExponent = 144;     ///< i8[8]
inline constexpr size_t kBlockCount = 152;        ///< u8[8]: children, or kTriangleLeaf + triangles of a leaf
inline constexpr size_t kBlockFirst = 160;        ///< u32[8]: slot of the first child, or the first triangle of a leaf
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

/// Blocks that `siblings` nodes take.
constexpr uint32_t blocks_for(uint32_t siblings) {
    return (siblings + kBlockLanes - 1) / kBlockLanes;
}

} // namespace prolate
