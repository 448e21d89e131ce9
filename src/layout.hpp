// Offsets of an .etree file's header, levels table and triangle section (src/FORMAT.md); those of its blocks are in
// block.hpp. Changing any of them is a new format version: add a row to FORMAT.md's history.
#pragma once

#include "src/block.hpp"
#include "src/bytes.hpp"
#include "src/hash.hpp"
#include "src/hull.hpp"

#include <prolate/tree.hpp>

#include <cstddef>
#include <cstdint>
#include <iterator>
#include <span>

namespace prolate {

inline constexpr unsigned char kMagic[8] = {0x89, 'E', 'T', 'R', 'E', 'E', '\r', '\n'};

enum HeaderOffset : size_t {
    kAtMagic = 0,
    kAtVersion = 8,
    kAtHeaderSize = 10,
    kAtFlags = 12,
    kAtTotalSize = 16,
    kAtHeaderHash = 24,
    kAtSourceHash = 32,
    kAtOptionsHash = 40,
    kAtNodeCount = 48,
    kAtLevelCount = 52,
    kAtDegree = 54,
    kAtOrigin = 56,
    kAtStepExponent = 68,
    kAtReserved0 = 70,
    kAtSolidVolume = 72,
    kAtMethod = 80,
    kAtPrimitive = 81,
    kAtQuality = 82,
    kAtReserved1 = 83,
    kAtAlpha = 84,
    kAtBeta = 88,
    kAtTolerance = 92,
    kAtLevels = 96,
    kAtEllipsoids = 100,
    kAtSeed = 104,
    kAtResolution = 112,
    kAtVertexCount = 116,
    kAtTriangleCount = 120,
    kAtComponentCount = 124,
    kAtDiagonal = 128,
    kAtSolidVolumeError = 136,
    kAtDistance = 140,
    kAtScale = 144,
    kAtMeshOrigin = 168,
    kAtWeld = 192,
    kAtBall = 196,
    kAtMass = 200, // volume, center, inertia, errors: kMassNumbers doubles
    kHeaderBytes = 304,
};
enum Flag : uint32_t {
    kSurfaceMode = 1,
    kExact = 2,
    kProved = 4,
    kGoalMissed = 8,
    kPlainFlags = 15, // all that version 8 has
    kHasSections = 16,
    kInner = 32,
    kAllFlags = 63,
};

inline constexpr size_t kMassNumbers = 13, kMassErrors = 10; // the last three are errors
static_assert(kAtMass + sizeof(double) * kMassNumbers == kHeaderBytes);
static_assert(sizeof(MassProperties) == sizeof(double) * kMassNumbers);

// A row of the levels table, which follows the header.
enum LevelOffset : size_t {
    kLevelFirstBlock = 0,
    kLevelNodeCount = 4,
    kLevelEndByte = 8,
    kLevelHash = 16,
    kLevelUnionVolume = 24,
    kLevelFigures = 32, // kFigures, in their order
    kLevelBytes = 60,
};
inline constexpr double LevelFigures::*kFigures[] = {
    &LevelFigures::outside_ratio, &LevelFigures::outside_ratio_error, &LevelFigures::sum_outside_ratio,
    &LevelFigures::surface_error, &LevelFigures::hausdorff_max,       &LevelFigures::hausdorff_mean,
    &LevelFigures::hausdorff_p99,
};
static_assert(kLevelFigures + sizeof(float) * std::size(kFigures) == kLevelBytes);

// Bounding blocks, then the blocks, follow the levels table, from the next multiple of their alignment on; zeros fill
// the gap.
constexpr size_t table_end(uint32_t level_count) {
    return kHeaderBytes + level_count * kLevelBytes;
}
constexpr size_t bounding_begin(uint32_t level_count) {
    return (table_end(level_count) + kBlockAlignment - 1) / kBlockAlignment * kBlockAlignment;
}

// Slots are 32 bits wide.
inline constexpr uint64_t kMaxBlocks = UINT32_MAX / kBlockLanes;

// Of so many blocks, bounding blocks included; in 64-bit arithmetic, also for a reader whose size_t has 32.
constexpr uint64_t end_of_blocks(uint32_t level_count, uint64_t blocks) {
    return bounding_begin(level_count) + blocks * kBlockBytes;
}

// Hash of the first level's block and all bounding blocks.
inline uint64_t root_hash(std::span<const std::byte> file, uint32_t level_count, uint64_t bounding_blocks) {
    const auto bytes = static_cast<size_t>(bounding_blocks * kBlockBytes);
    const auto bounding = file.subspan(bounding_begin(level_count), bytes);
    return hash_bytes(file.subspan(bounding_begin(level_count) + bytes, kBlockBytes), hash_bytes(bounding));
}

// The triangle section of an exact tree, which follows the blocks: a hull record for each block, hash of all the rest,
// vertices, indices.
inline constexpr size_t kSectionHashBytes = 8, kVertexBytes = 12;

// Bytes of a vertex index.
constexpr size_t index_bytes(uint32_t vertex_count) {
    return vertex_count <= 0x10000 ? 2 : 4;
}

constexpr uint64_t section_bytes(uint64_t blocks, uint32_t vertices, uint32_t triangles) {
    return blocks * kHullBytes + kSectionHashBytes + uint64_t{vertices} * kVertexBytes +
           uint64_t{triangles} * 3 * index_bytes(vertices);
}

// Of a whole section whose hulls take `hull_bytes`.
inline uint64_t section_hash(std::span<const std::byte> section, size_t hull_bytes) {
    return hash_bytes(section.subspan(hull_bytes + kSectionHashBytes), hash_bytes(section.first(hull_bytes)));
}

// Sections follow everything else, each from a multiple of kBlockAlignment on: this header, then the content; zeros
// fill the gaps.
enum SectionOffset : size_t {
    kSectionKind = 0, // four characters
    kSectionSize = 8, // of the content, 64 bits
    kSectionHash = 16,
    kSectionZeros = 24,
    kSectionContent = 64,
};
inline constexpr char kInnerKind[4] = {'I', 'N', 'N', 'R'};

// The next place for a section, or its end.
constexpr uint64_t section_aligned(uint64_t at) {
    return (at + kBlockAlignment - 1) / kBlockAlignment * kBlockAlignment;
}

// Of the section whose header and content these are.
inline uint64_t kind_hash(const std::byte* header, std::span<const std::byte> content) {
    return hash_bytes(content, hash_bytes({header, kSectionHash}));
}

// The lattice that a header names.
inline LatticeInfo lattice_of(const std::byte* header) {
    LatticeInfo out;
    for (size_t i = 0; i < 3; ++i) out.origin[i] = load_le<int32_t>(header + kAtOrigin + 4 * i);
    out.step_exponent = load_le<int16_t>(header + kAtStepExponent);
    return out;
}

// Hash of header and levels table without the hash field itself.
inline uint64_t header_hash(std::span<const std::byte> header_and_table) {
    const uint64_t before = hash_bytes(header_and_table.first(kAtHeaderHash));
    return hash_bytes(header_and_table.subspan(kAtHeaderHash + 8), before);
}

} // namespace prolate
