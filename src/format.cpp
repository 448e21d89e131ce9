// Writing .etree bytes (src/FORMAT.md).
#include "src/format.hpp"

#include "src/bounding.hpp"
#include "src/bytes.hpp"
#include "src/hash.hpp"
#include "src/layout.hpp"

#include <prolate/version.hpp>

#include <algorithm>
#include <array>
#include <bit>
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

namespace {

// Where the levels of a file lie.
struct FileLayout {
    uint32_t level_count;
    uint64_t node_count = 0;
    std::vector<uint64_t> first_block{0, 1}; // blocks before each level, and in all
    uint64_t bounding_blocks;
    uint64_t blocks_end; // byte behind the last block

    FileLayout(std::span<const PackedLevel> levels, bool exact) : level_count(static_cast<uint32_t>(levels.size())) {
        for (const PackedLevel& level : levels) {
            node_count += level.nodes.size();
            uint64_t next = first_block.back();
            for (const PackedNode& node : level.nodes) next += blocks_for(node.child_count);
            first_block.push_back(next);
        }
        first_block.pop_back(); // the last level has no children
        bounding_blocks = exact ? 0 : first_block[level_count - 1];
        blocks_end = end_of_blocks(level_count, bounding_blocks + first_block.back());
    }
    uint64_t level_begin(uint32_t level) const {
        return end_of_blocks(level_count, bounding_blocks + first_block[level]);
    }
};

// All of the header but what depends on the nodes' and triangles' bytes.
void store_header(std::byte* h, const BakeInfo& info, uint32_t degree, const Lattice& lattice,
                  const FileLayout& layout) {
    std::memcpy(h + kAtMagic, kMagic, sizeof kMagic);
    store_le(h + kAtVersion, info.inner ? kFormatVersion : kPlainFormatVersion);
    store_le(h + kAtHeaderSize, static_cast<uint16_t>(kHeaderBytes));
    store_le(h + kAtFlags, (info.surface_mode ? kSurfaceMode : 0u) | (info.exact ? kExact : 0u) |
                               (info.proved ? kProved : 0u) | (info.goal_reached ? 0u : kGoalMissed) |
                               (info.inner ? kInner : 0u));
    store_le(h + kAtSourceHash, info.source_hash);
    store_le(h + kAtOptionsHash, info.options_hash);
    store_le(h + kAtNodeCount, static_cast<uint32_t>(layout.node_count));
    store_le(h + kAtLevelCount, static_cast<uint16_t>(layout.level_count));
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
    store_le(h + kAtBall, info.keep_holes > 0 ? -info.keep_holes : info.fill);
    const auto mass = std::bit_cast<std::array<double, kMassNumbers>>(info.mass);
    for (size_t i = 0; i < kMassNumbers; ++i) store_le(h + kAtMass + sizeof(double) * i, mass[i]);
}

// Writes the blocks level by level, and the rows of the table.
class LevelWriter {
public:
    LevelWriter(std::byte* file, const FileLayout& layout, std::span<const PackedLevel> levels, const Lattice& lattice,
                bool exact)
        : file_(file), layout_(layout), levels_(levels), lattice_(lattice) {
        if (!exact) bounding_.emplace(levels, lattice);
    }

    void level(uint32_t l) {
        const PackedLevel& level = levels_[l];
        assert(std::accumulate(families_.begin(), families_.end(), size_t{0}) == level.nodes.size());
        std::byte* const begin = file_ + layout_.level_begin(l);
        next_block_ = layout_.first_block[l + 1];
        std::byte* block = begin;
        size_t node = 0;
        for (const uint32_t siblings : families_) {
            family(block, std::span(level.nodes).subspan(node, siblings));
            for (uint32_t i = 0; i < siblings; i += kBlockLanes, block += kBlockBytes)
                if (bounding_ && l + 1 < layout_.level_count)
                    bounding_block(block, l, node + i, std::min(siblings - i, kBlockLanes));
            node += siblings;
        }
        families_.clear();
        for (const PackedNode& parent : level.nodes)
            if (parent.child_count) families_.push_back(parent.child_count);
        row(l, {begin, block});
    }

    uint32_t triangles() const { return next_triangle_; } // of all leaves so far

private:
    // Siblings, from `block` on.
    void family(std::byte* block, std::span<const PackedNode> siblings) {
        for (size_t i = 0; i < siblings.size(); ++i) {
            const PackedNode& node = siblings[i];
            std::byte* const to = block + i / kBlockLanes * kBlockBytes;
            if (i % kBlockLanes == 0) {
                store_le(to + kBlockChildren, static_cast<uint32_t>(next_block_));
                store_le(to + kBlockTriangles, next_triangle_);
            }
            store_node(to, i % kBlockLanes, node);
            if (node.child_count)
                store_le(to + kBlockOffset + i % kBlockLanes,
                         static_cast<uint8_t>(next_block_ - load_le<uint32_t>(to + kBlockChildren)));
            next_triangle_ += node.triangle_count;
            next_block_ += blocks_for(node.child_count);
        }
        for (; !siblings.empty(); block += kBlockBytes) {
            const auto in_block = siblings.first(std::min<size_t>(siblings.size(), kBlockLanes));
            store_boxes(block, in_block, lattice_);
            siblings = siblings.subspan(in_block.size());
        }
    }

    // Of nodes first ... first + count - 1 of level l, which are in `block`: their bounding volumes.
    void bounding_block(const std::byte* block, uint32_t l, size_t first, uint32_t count) {
        std::byte* const to = file_ + end_of_blocks(layout_.level_count, next_bounding_++);
        std::copy_n(block, kBlockBytes, to);
        std::vector<PackedNode> nodes;
        for (uint32_t lane = 0; lane < count; ++lane) {
            nodes.push_back(bounding_->node(l, first + lane));
            store_node(to, lane, nodes.back());
        }
        store_boxes(to, nodes, lattice_);
    }

    void row(uint32_t l, std::span<const std::byte> blocks) {
        const PackedLevel& level = levels_[l];
        std::byte* const to = file_ + kHeaderBytes + l * kLevelBytes;
        store_le(to + kLevelFirstBlock, static_cast<uint32_t>(layout_.first_block[l]));
        store_le(to + kLevelNodeCount, static_cast<uint32_t>(level.nodes.size()));
        store_le(to + kLevelEndByte, layout_.level_begin(l + 1));
        store_le(to + kLevelHash, hash_bytes(blocks));
        store_le(to + kLevelUnionVolume, level.figures.union_volume);
        for (size_t i = 0; i < std::size(kFigures); ++i)
            store_le(to + kLevelFigures + sizeof(float) * i, static_cast<float>(level.figures.*kFigures[i]));
    }

    std::byte* const file_;
    const FileLayout& layout_;
    const std::span<const PackedLevel> levels_;
    const Lattice& lattice_;
    std::optional<Bounding> bounding_;
    std::vector<uint32_t> families_{1}; // nodes of the next level, by parents
    uint64_t next_block_ = 0;           // of the children
    uint64_t next_bounding_ = 0;
    uint32_t next_triangle_ = 0;
};

} // namespace

std::vector<std::byte> encode(const BakeInfo& info, uint32_t degree, const Lattice& lattice,
                              std::span<const PackedLevel> levels, const PackedTriangles& triangles) {
    assert(!levels.empty() && levels.size() <= kMaxLevels && levels[0].nodes.size() == 1);
    const FileLayout layout(levels, info.exact);
    const auto vertex_count = static_cast<uint32_t>(triangles.vertices.size());
    const auto triangle_count = static_cast<uint32_t>(triangles.triangles.size());
    const uint64_t blocks = layout.first_block.back();
    const uint64_t total = layout.blocks_end + (info.exact ? section_bytes(blocks, vertex_count, triangle_count) : 0);
    if (!std::in_range<size_t>(total)) throw std::bad_alloc();
    std::vector<std::byte> bytes(static_cast<size_t>(total));
    std::byte* const h = bytes.data();

    store_header(h, info, degree, lattice, layout);
    store_le(h + kAtTotalSize, total);
    if (info.exact) {
        store_le(h + kAtVertexCount, vertex_count);
        store_le(h + kAtTriangleCount, triangle_count);
        store_le(h + kAtComponentCount, triangles.components);
        store_section(std::span(bytes).subspan(static_cast<size_t>(layout.blocks_end)),
                      static_cast<size_t>(blocks) * kHullBytes, triangles);
    }
    LevelWriter writer(h, layout, levels, lattice, info.exact);
    for (uint32_t l = 0; l < layout.level_count; ++l) writer.level(l);
    assert(writer.triangles() == triangle_count);
    store_le(h + kHeaderBytes + kLevelHash, root_hash(bytes, layout.level_count, layout.bounding_blocks));
    store_le(h + kAtHeaderHash, header_hash({h, table_end(layout.level_count)}));
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

void append_section(std::vector<std::byte>& file, const char (&kind)[4], std::span<const std::byte> content) {
    const auto begin = static_cast<size_t>(section_aligned(file.size()));
    file.resize(static_cast<size_t>(section_aligned(begin + kSectionContent + content.size())));
    std::byte *const h = file.data(), *const section = h + begin;
    std::memcpy(section + kSectionKind, kind, sizeof kind);
    store_le(section + kSectionSize, uint64_t{content.size()});
    store_le(section + kSectionHash, kind_hash(section, content));
    std::copy(content.begin(), content.end(), section + kSectionContent);
    store_le(h + kAtVersion, kFormatVersion);
    store_le(h + kAtFlags, load_le<uint32_t>(h + kAtFlags) | kHasSections);
    store_le(h + kAtTotalSize, uint64_t{file.size()});
    store_le(h + kAtHeaderHash, header_hash({h, table_end(load_le<uint16_t>(h + kAtLevelCount))}));
}

} // namespace prolate::format
