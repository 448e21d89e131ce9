// Writing .etree bytes (src/FORMAT.md).
#include "src/format.hpp"

#include "src/bounding.hpp"
#include "src/bytes.hpp"
#include "src/hash.hpp"
#include "src/layout.hpp"

#include <prolate/version.hpp>

#include <algorithm>
#include <cassert>
#include <cstring>
#include <iterator>
#include <new>
#include <numeric>
#include <optional>
#include <span>
#include <utility>

namespace prolate::format {
namespace {

void store_section(std::span<std::byte> section, size_t hull_bytes, const PackedTriangles& triangles) {
    std::byte* to = section.data() + hull_bytes + kSectionHashBytes;
    for (const Vec3& v : triangles.vertices)
        for (const float coordinate : {v.x, v.y, v.z}) store_le(to, coordinate), to += sizeof coordinate;
    const size_t width = index_bytes(static_cast<uint32_t>(triangles.vertices.size()));
    for (const Triangle& t : triangles.triangles)
        for (const uint32_t corner : t) {
            if (width == 2)
                store_le(to, static_cast<uint16_t>(corner));
            else
                store_le(to, corner);
            to += width;
        }
    store_le(section.data() + hull_bytes, section_hash(section, hull_bytes));
}

} // namespace

void store_node(std::byte* block, size_t lane, const PackedNode& node) noexcept {
    uint16_t fractions = 0;
    for (size_t i = 0; i < 3; ++i) {
        store_le(block + block_offset(kBlockCenter, i, lane), node.center[i]);
        store_le(block + block_offset(kBlockDiagonal, i, lane), node.diagonal[i]);
        store_le(block + block_offset(kBlockOffDiagonal, i, lane), node.off_diagonal[i]);
        fractions |= static_cast<uint16_t>(node.fraction[i] << kFractionBits * i);
    }
    store_le(block + kBlockFraction + 2 * lane, fractions);
    store_le(block + kBlockExponent + lane, node.exponent);
    const unsigned count = node.triangle_count ? kTriangleLeaf | node.triangle_count : node.child_count;
    store_le(block + kBlockCount + lane, static_cast<uint8_t>(count));
}

std::vector<std::byte> encode(const BakeInfo& info, uint32_t degree, const Lattice& lattice,
                              std::span<const PackedLevel> levels, const PackedTriangles& triangles) {
    assert(!levels.empty() && levels.size() <= kMaxLevels && levels[0].nodes.size() == 1);
    const auto level_count = static_cast<uint32_t>(levels.size());
    // Blocks before each level, and behind the last.
    uint64_t node_count = 0;
    std::vector<uint64_t> first_block{0, 1};
    for (const PackedLevel& level : levels) {
        node_count += level.nodes.size();
        uint64_t next = first_block.back();
        for (const PackedNode& node : level.nodes) next += blocks_for(node.child_count);
        first_block.push_back(next);
    }
    first_block.pop_back(); // the last level has no children
    const uint64_t bounding_blocks = info.exact ? 0 : first_block[level_count - 1];
    const uint64_t blocks_end = end_of_blocks(level_count, bounding_blocks + first_block.back());
    const auto vertex_count = static_cast<uint32_t>(triangles.vertices.size());
    const auto triangle_count = static_cast<uint32_t>(triangles.triangles.size());
    const uint64_t total =
        blocks_end + (info.exact ? section_bytes(first_block.back(), vertex_count, triangle_count) : 0);
    if (!std::in_range<size_t>(total)) throw std::bad_alloc();
    std::vector<std::byte> bytes(static_cast<size_t>(total));
    std::byte* const h = bytes.data();

    std::memcpy(h + kAtMagic, kMagic, sizeof kMagic);
    store_le(h + kAtVersion, kFormatVersion);
    store_le(h + kAtHeaderSize, static_cast<uint16_t>(kHeaderBytes));
    store_le(h + kAtFlags, (info.surface_mode ? kSurfaceMode : 0u) | (info.exact ? kExact : 0u) |
                               (info.proved ? kProved : 0u) | (info.goal_reached ? 0u : kGoalMissed));
    store_le(h + kAtTotalSize, total);
    store_le(h + kAtSourceHash, info.source_hash);
    store_le(h + kAtOptionsHash, info.options_hash);
    store_le(h + kAtNodeCount, static_cast<uint32_t>(node_count));
    store_le(h + kAtLevelCount, static_cast<uint16_t>(level_count));
    store_le(h + kAtDegree, static_cast<uint16_t>(degree));
    for (size_t i = 0; i < 3; ++i) store_le(h + kAtOrigin + 4 * i, lattice.origin[i]);
    store_le(h + kAtStepExponent, static_cast<int16_t>(lattice.step_exponent));
    store_le(h + kAtSolidVolume, info.solid_volume);
    store_le(h + kAtMethod, static_cast<uint8_t>(info.method));
    store_le(h + kAtPrimitive, static_cast<uint8_t>(info.primitive));
    store_le(h + kAtQuality, static_cast<uint8_t>(info.quality));
    store_le(h + kAtAlpha, info.alpha);
    store_le(h + kAtBeta, info.beta);
    store_le(h + kAtTolerance, info.tolerance);
    store_le(h + kAtDistance, info.distance);
    store_le(h + kAtLevels, info.levels);
    store_le(h + kAtEllipsoids, info.ellipsoids);
    store_le(h + kAtSeed, info.seed);
    store_le(h + kAtResolution, info.resolution);
    store_le(h + kAtSolidVolumeError, info.solid_volume_error);
    store_le(h + kAtDiagonal, info.diagonal);
    for (size_t i = 0; i < 3; ++i) {
        store_le(h + kAtScale + 8 * i, info.placement.scale[i]);
        store_le(h + kAtMeshOrigin + 8 * i, info.placement.origin[i]);
    }
    store_le(h + kAtWeld, info.weld);
    if (info.exact) {
        store_le(h + kAtVertexCount, vertex_count);
        store_le(h + kAtTriangleCount, triangle_count);
        store_le(h + kAtComponentCount, triangles.components);
        store_section(std::span(bytes).subspan(static_cast<size_t>(blocks_end)),
                      static_cast<size_t>(first_block.back()) * kHullBytes, triangles);
    }

    std::optional<Bounding> bounding;
    if (!info.exact) bounding.emplace(levels, lattice);
    uint32_t next_triangle = 0;
    std::vector<uint32_t> families{1}; // nodes of the level, by parents
    for (uint32_t l = 0; l < level_count; ++l) {
        const PackedLevel& level = levels[l];
        assert(std::accumulate(families.begin(), families.end(), size_t{0}) == level.nodes.size());
        std::byte* const begin = h + end_of_blocks(level_count, bounding_blocks + first_block[l]);
        uint64_t next_block = first_block[l + 1]; // of the children
        std::vector<uint32_t> next_families;
        std::byte* block = begin;
        std::byte* bounding_block = h + end_of_blocks(level_count, first_block[l]);
        auto node = level.nodes.begin();
        for (const uint32_t siblings : families) {
            for (uint32_t i = 0; i < siblings; ++i, ++node) {
                std::byte* const to = block + i / kBlockLanes * kBlockBytes;
                if (i % kBlockLanes == 0) {
                    store_le(to + kBlockChildren, static_cast<uint32_t>(next_block));
                    store_le(to + kBlockTriangles, next_triangle);
                }
                store_node(to, i % kBlockLanes, *node);
                if (node->child_count)
                    store_le(to + kBlockOffset + i % kBlockLanes,
                             static_cast<uint8_t>(next_block - load_le<uint32_t>(to + kBlockChildren)));
                next_triangle += node->triangle_count;
                next_block += blocks_for(node->child_count);
                if (node->child_count) next_families.push_back(node->child_count);
            }
            for (uint32_t i = 0; i < siblings; i += kBlockLanes, block += kBlockBytes) {
                const auto first = node - siblings + i;
                const uint32_t count = std::min(siblings - i, kBlockLanes);
                store_boxes(block, {first, count}, lattice);
                if (!bounding || l + 1 == level_count) continue;
                std::copy_n(block, kBlockBytes, bounding_block);
                std::vector<PackedNode> nodes;
                for (uint32_t lane = 0; lane < count; ++lane) {
                    nodes.push_back(bounding->node(l, static_cast<size_t>(first - level.nodes.begin()) + lane));
                    store_node(bounding_block, lane, nodes.back());
                }
                store_boxes(bounding_block, nodes, lattice);
                bounding_block += kBlockBytes;
            }
        }
        families = std::move(next_families);
        std::byte* const row = h + kHeaderBytes + l * kLevelBytes;
        store_le(row + kLevelFirstBlock, static_cast<uint32_t>(first_block[l]));
        store_le(row + kLevelNodeCount, static_cast<uint32_t>(level.nodes.size()));
        store_le(row + kLevelEndByte, end_of_blocks(level_count, bounding_blocks + first_block[l + 1]));
        store_le(row + kLevelHash, hash_bytes({begin, block}));
        store_le(row + kLevelUnionVolume, level.figures.union_volume);
        for (size_t i = 0; i < std::size(kFigures); ++i)
            store_le(row + kLevelFigures + sizeof(float) * i, static_cast<float>(level.figures.*kFigures[i]));
    }
    assert(next_triangle == triangle_count);
    store_le(h + kHeaderBytes + kLevelHash, root_hash(bytes, level_count, bounding_blocks));
    store_le(h + kAtHeaderHash, header_hash({h, table_end(level_count)}));
    return bytes;
}

void store_hulls(std::span<std::byte> file, std::span<const std::byte> hulls) {
    const uint32_t levels = load_le<uint16_t>(file.data() + kAtLevelCount);
    const auto begin = load_le<uint64_t>(file.data() + kHeaderBytes + (levels - 1) * kLevelBytes + kLevelEndByte);
    const std::span<std::byte> section = file.subspan(static_cast<size_t>(begin));
    assert((begin - bounding_begin(levels)) / kBlockBytes * kHullBytes == hulls.size());
    std::copy(hulls.begin(), hulls.end(), section.begin());
    store_le(section.data() + hulls.size(), section_hash(section, hulls.size()));
}

} // namespace prolate::format
