// Validating .etree bytes (src/FORMAT.md, "What open() checks").
//
// Validation makes every later query memory-safe and finite. It does not, and cannot, prove that the nodes cover
// anything: the content hashes find accidents, verify() proves cover against a mesh.
//
// Complexity: linear in the bytes.
#include <prolate/tree.hpp>

#include "src/bytes.hpp"
#include "src/deformation.hpp"
#include "src/format.hpp"
#include "src/hash.hpp"
#include "src/hull.hpp"
#include "src/layout.hpp"
#include "src/skin.hpp"
#include "src/slab.hpp"

#include <prolate/version.hpp>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <cstring>

namespace prolate {
namespace {

Error bad(const char* what, uint64_t where) {
    return {ErrorCode::bad_file, what, where};
}

// Offset of the first byte of from[begin ... end - 1] that is not zero, or `end`.
size_t first_nonzero(const std::byte* from, size_t begin, size_t end) {
    while (begin < end && from[begin] == std::byte{0}) ++begin;
    return begin;
}
bool all_zero(const std::byte* from, size_t count) {
    return first_nonzero(from, 0, count) == count;
}

// A figure that is unknown (NaN) or finite and not negative.
template <class T> bool is_metric(T value) {
    return std::isnan(value) || (std::isfinite(value) && value >= 0);
}

// The counts of an exact tree; of others they are 0.
Result<void> check_triangle_counts(const std::byte* h, bool exact) {
    if (!exact) {
        if (!all_zero(h + kAtVertexCount, kAtDiagonal - kAtVertexCount))
            return bad("triangle counts of a tree without triangles", kAtVertexCount);
        return {};
    }
    const uint32_t vertices = load_le<uint32_t>(h + kAtVertexCount);
    if (vertices == 0) return bad("an exact tree without vertices", kAtVertexCount);
    if (load_le<uint32_t>(h + kAtTriangleCount) == 0) return bad("an exact tree without triangles", kAtTriangleCount);
    const uint32_t components = load_le<uint32_t>(h + kAtComponentCount);
    if (components == 0 || components > vertices) return bad("component count out of range", kAtComponentCount);
    return {};
}

Result<void> check_mass(const std::byte* h) {
    for (size_t i = 0; i < kMassNumbers; ++i) {
        const size_t at = kAtMass + sizeof(double) * i;
        const auto value = load_le<double>(h + at);
        const bool of_any_sign = i > 0 && i < kMassErrors; // centre and tensor
        if (!std::isfinite(value) || (value < 0 && !of_any_sign)) return bad("mass properties out of range", at);
    }
    return {};
}

// The header on its own: everything that does not need the nodes.
Result<void> check_header(std::span<const std::byte> bytes) {
    const std::byte* h = bytes.data();
    if (bytes.empty()) return bad("the file is empty", 0);
    if (bytes.size() < sizeof kMagic || std::memcmp(h, kMagic, sizeof kMagic) != 0)
        return bad("not an .etree file (wrong magic number)", kAtMagic);
    if (bytes.size() < kAtVersion + 2) return bad("the file ends inside its header", bytes.size());
    const uint16_t version = load_le<uint16_t>(h + kAtVersion);
    if (version > kFormatVersion)
        return Error{ErrorCode::newer_version, "written by a newer format version than this library reads", version};
    if (version == 0) return bad("unknown format version", kAtVersion);
    if (version < kPlainFormatVersion)
        return bad("written by an older format version than this library reads", kAtVersion);
    if (bytes.size() < kHeaderBytes) return bad("the file ends inside its header", bytes.size());
    if (load_le<uint16_t>(h + kAtHeaderSize) != kHeaderBytes) return bad("wrong header size", kAtHeaderSize);
    const uint32_t flags = load_le<uint32_t>(h + kAtFlags);
    const uint32_t known = version == kPlainFormatVersion ? kPlainFlags : kAllFlags;
    if ((flags & ~known) != 0) return bad("unknown flag", kAtFlags);
    if (version != kPlainFormatVersion && (flags & ~uint32_t{kPlainFlags}) == 0)
        return bad("without sections, and no inner cover: that would be version 8", kAtFlags);
    if ((flags & kInner) != 0 && (flags & (kSurfaceMode | kExact | kHasSections)) != 0)
        return bad("an inner cover of no solid, with triangles or with sections", kAtFlags);
    const uint32_t levels = load_le<uint16_t>(h + kAtLevelCount);
    if (levels < 1 || levels > kMaxLevels) return bad("level count out of range", kAtLevelCount);
    const uint32_t degree = load_le<uint16_t>(h + kAtDegree);
    if (degree < 2 || degree > kMaxDegree) return bad("degree out of range", kAtDegree);
    for (size_t i = 0; i < 3; ++i) {
        const int32_t origin = load_le<int32_t>(h + kAtOrigin + 4 * i);
        if (origin <= -format::kMaxCoordinate || origin >= format::kMaxCoordinate - UINT16_MAX)
            return bad("lattice origin out of range", kAtOrigin + 4 * i);
    }
    const int32_t step = load_le<int16_t>(h + kAtStepExponent);
    if (step < format::kMinStepExponent || step > format::kMaxStepExponent)
        return bad("lattice step out of range", kAtStepExponent);
    if (!is_metric(load_le<double>(h + kAtSolidVolume))) return bad("solid volume out of range", kAtSolidVolume);
    if (load_le<uint8_t>(h + kAtMethod) > static_cast<uint8_t>(Method::analytic))
        return bad("unknown method", kAtMethod);
    if (load_le<uint8_t>(h + kAtPrimitive) > static_cast<uint8_t>(Primitive::sphere))
        return bad("unknown primitive", kAtPrimitive);
    if (load_le<uint8_t>(h + kAtQuality) > static_cast<uint8_t>(Quality::best))
        return bad("unknown quality", kAtQuality);
    for (const size_t at : {kAtAlpha, kAtBeta, kAtTolerance, kAtDistance})
        if (!std::isfinite(load_le<float>(h + at)) || load_le<float>(h + at) < 0) return bad("option out of range", at);
    if (!all_zero(h + kAtReserved0, 2)) return bad("reserved bytes are not zero", kAtReserved0);
    if (!all_zero(h + kAtReserved1, 1)) return bad("reserved bytes are not zero", kAtReserved1);
    if (!is_metric(load_le<double>(h + kAtDiagonal))) return bad("diagonal out of range", kAtDiagonal);
    if (!is_metric(load_le<float>(h + kAtSolidVolumeError)))
        return bad("solid volume error out of range", kAtSolidVolumeError);
    for (size_t i = 0; i < 3; ++i) {
        const double scale = load_le<double>(h + kAtScale + 8 * i);
        if (!std::isfinite(scale) || scale == 0) return bad("scale of the mesh out of range", kAtScale + 8 * i);
        if (!std::isfinite(load_le<double>(h + kAtMeshOrigin + 8 * i)))
            return bad("origin of the mesh out of range", kAtMeshOrigin + 8 * i);
    }
    if (!std::isfinite(load_le<float>(h + kAtWeld))) return bad("option out of range", kAtWeld);
    if (!std::isfinite(load_le<float>(h + kAtBall))) return bad("option out of range", kAtBall);
    if (const auto mass = check_mass(h); !mass) return mass;
    return check_triangle_counts(h, (flags & kExact) != 0);
}

// What the levels table says.
struct Levels {
    uint64_t nodes = 0, blocks = 0; // of the whole file
    uint32_t present = 0;           // levels that the bytes hold
    uint64_t bounding_blocks = 0;
};

// The table: consecutive levels of whole blocks, and no block without a node.
Result<Levels> check_levels(std::span<const std::byte> bytes, uint32_t level_count, bool exact) {
    const std::byte* const h = bytes.data();
    Levels out;
    if (!exact) // as many as there are blocks before the last level
        out.bounding_blocks = load_le<uint32_t>(h + kHeaderBytes + (level_count - 1) * kLevelBytes + kLevelFirstBlock);
    auto& [nodes, blocks, present, bounding_blocks] = out;
    for (uint32_t l = 0; l < level_count; ++l) {
        const size_t at = kHeaderBytes + l * kLevelBytes;
        if (load_le<uint32_t>(h + at + kLevelFirstBlock) != blocks) return bad("levels are not consecutive", at);
        const uint64_t begin = end_of_blocks(level_count, bounding_blocks + blocks),
                       end = load_le<uint64_t>(h + at + kLevelEndByte);
        const uint64_t more = end > begin ? (end - begin) / kBlockBytes : 0;
        if (more == 0 || more > kMaxBlocks - blocks || end != begin + more * kBlockBytes || (l == 0 && more != 1))
            return bad("wrong byte count of a level", at + kLevelEndByte);
        const uint32_t count = load_le<uint32_t>(h + at + kLevelNodeCount);
        if (count < more || count > kBlockLanes * more || (l == 0 && count != 1))
            return bad("wrong node count of a level", at + kLevelNodeCount);
        nodes += count;
        blocks += more;
        bool sound = is_metric(load_le<double>(h + at + kLevelUnionVolume));
        for (size_t i = kLevelFigures; i < kLevelBytes; i += sizeof(float))
            sound = sound && is_metric(load_le<float>(h + at + i));
        if (!sound) return bad("level figures out of range", at + kLevelUnionVolume);
        if (end <= bytes.size()) present = l + 1;
    }
    return out;
}

// Checks the nodes level by level: each has its fields in range, siblings fill the lanes of their blocks from the first
// on, the rest is empty, and children and triangles follow each other in breadth-first order. So each node but the root
// has one parent, before it, and each triangle one leaf.
class NodeCheck {
public:
    NodeCheck(const std::byte* file, size_t first_block, uint32_t degree, bool exact, const LatticeInfo& lattice)
        : file_(file), first_block_(first_block), degree_(degree), exact_(exact), lattice_(lattice) {}

    // The next level's blocks begin at block `end` of the tree.
    void begin_level(uint32_t end) { children_ = 0, level_end_ = next_child_block_ = end; }

    // The next `count` siblings, in blocks that the caller has found to be there.
    Result<void> family(uint32_t count) {
        for (uint32_t i = 0; i < count; ++i) {
            const size_t block = at(block_ + i / kBlockLanes);
            if (i % kBlockLanes == 0)
                if (const auto sound = begin_block(block); !sound) return sound;
            if (const auto sound = node(block, i % kBlockLanes); !sound) return sound;
        }
        for (uint32_t i = 0; i < blocks_for(count); ++i)
            if (const auto sound = box_frame(at(block_ + i)); !sound) return sound;
        block_ += blocks_for(count);
        if (count % kBlockLanes == 0) return {};
        return no_nodes_from(at(block_ - 1), count % kBlockLanes);
    }

    uint32_t child_count(uint32_t slot) const {
        const auto count = load_le<uint8_t>(file_ + at(slot / kBlockLanes) + kBlockCount + slot % kBlockLanes);
        return count & kTriangleLeaf ? 0 : count;
    }

    // The bounding block at `where` of block `b`, which has been found to be sound: the same nodes, and their
    // ellipsoids and boxes are sound, too.
    Result<void> bounding_block(uint32_t b, size_t where) const {
        const std::byte *const from = file_ + where, *const nodes = file_ + at(b);
        for (const size_t array : {kBlockChildren, kBlockTriangles})
            if (load_le<uint32_t>(from + array) != load_le<uint32_t>(nodes + array))
                return bad("a bounding block has other children than its block", where + array);
        uint32_t lane = 0;
        for (; lane < kBlockLanes && load_le<uint16_t>(nodes + block_offset(kBlockDiagonal, 0, lane)) != 0; ++lane) {
            for (const size_t array : {kBlockCount, kBlockOffset})
                if (from[array + lane] != nodes[array + lane])
                    return bad("a bounding block has other nodes than its block", where + array + lane);
            if (nodes[kBlockCount + lane] == std::byte{0} && !same_ellipsoid(from, nodes, lane))
                return bad("a bounding block has another leaf than its block",
                           where + block_offset(kBlockCenter, 0, lane));
            if (const auto sound = shape(where, lane); !sound) return sound;
        }
        if (const auto sound = box_frame(where); !sound) return sound;
        return lane < kBlockLanes ? no_nodes_from(where, lane) : Result<void>{};
    }

    uint64_t children() const { return children_; } // of the level's nodes so far, and the blocks that they take
    uint64_t child_blocks() const { return next_child_block_ - level_end_; }
    uint64_t triangles() const { return next_triangle_; } // of all nodes so far

private:
    size_t at(uint32_t block) const { return first_block_ + size_t{block} * kBlockBytes; }

    // Where the children and triangles of a block's nodes begin: behind those of the nodes before.
    Result<void> begin_block(size_t block) const {
        if (load_le<uint32_t>(file_ + block + kBlockChildren) != next_child_block_)
            return bad("children are not in breadth-first order", block + kBlockChildren);
        if (load_le<uint32_t>(file_ + block + kBlockTriangles) != next_triangle_)
            return bad("triangles are not in breadth-first order", block + kBlockTriangles);
        return {};
    }

    Result<void> node(size_t block, size_t lane) {
        const std::byte* const from = file_ + block;
        const size_t at_count = kBlockCount + lane;
        const uint32_t count = load_le<uint8_t>(from + at_count);
        const bool has_triangles = (count & kTriangleLeaf) != 0;
        const uint32_t children = has_triangles ? 0 : count, triangles = has_triangles ? count - kTriangleLeaf : 0;
        if (children > degree_) return bad("a node has more children than the degree", block + at_count);
        if (has_triangles != (exact_ && children == 0) || has_triangles != (triangles > 0))
            return bad("a leaf has no triangles, or some in a tree without", block + at_count);
        const uint64_t offset = children > 0 ? next_child_block_ - load_le<uint32_t>(from + kBlockChildren) : 0;
        if (load_le<uint8_t>(from + kBlockOffset + lane) != offset)
            return bad("children are not in breadth-first order", block + kBlockOffset + lane);
        children_ += children;
        next_child_block_ += blocks_for(children);
        next_triangle_ += triangles;
        return shape(block, lane);
    }

    // Center, size, ellipsoid and box of a node.
    Result<void> shape(size_t block, size_t lane) const {
        const std::byte* const from = file_ + block;
        if (load_le<uint16_t>(from + kBlockFraction + 2 * lane) & kNoFraction)
            return bad("reserved bits are not zero", block + kBlockFraction + 2 * lane);
        for (size_t i = 0; i < 3; ++i) {
            const int32_t stored = stored_center(from, i, lane);
            if (stored > kMaxCenter) return bad("a center lies beyond the lattice", block + kBlockFraction + 2 * lane);
            const auto x = static_cast<uint64_t>(std::abs(int64_t{lattice_.origin[i]} * kCenterUnits + stored));
            if (x != 0 && std::bit_width(x) - std::countr_zero(x) > format::kCenterBits)
                return bad("a center has more bits than a float", block + kBlockFraction + 2 * lane);
        }
        const size_t at_size = kBlockExponent + lane;
        const auto exponent = load_le<int8_t>(from + at_size);
        if (exponent < format::kMinNodeExponent || exponent > format::kMaxNodeExponent)
            return bad("node size out of range", block + at_size);
        if (exponent - lattice_.step_exponent > kMaxNodeSize)
            return bad("a node is too large for the lattice's step", block + at_size);
        if (exponent - lattice_.step_exponent < kMinNodeSize)
            return bad("a node is too small for the lattice's step", block + at_size);
        for (size_t i = 0; i < 3; ++i)
            if (const size_t here = block_offset(kBlockDiagonal, i, lane); load_le<uint16_t>(from + here) == 0)
                return bad("a node has no extent", block + here);
        for (size_t i = 0; i < 3; ++i) {
            const size_t low = kBlockBoxLow + kBlockLanes * i + lane, high = kBlockBoxHigh + kBlockLanes * i + lane;
            if (load_le<uint8_t>(from + low) > load_le<uint8_t>(from + high)) return bad("a box is empty", block + low);
        }
        return {};
    }

    Result<void> box_frame(size_t block) const {
        const std::byte* const from = file_ + block;
        for (size_t i = 0; i < 3; ++i) {
            const int32_t origin = load_le<int32_t>(from + kBlockBoxOrigin + 4 * i);
            if (origin <= -kMaxBoxOrigin || origin >= kMaxBoxOrigin)
                return bad("box origin out of range", block + kBlockBoxOrigin + 4 * i);
            if (load_le<uint8_t>(from + kBlockBoxExponent + i) > kMaxBoxExponent)
                return bad("box step out of range", block + kBlockBoxExponent + i);
        }
        if (from[kBlockReserved] != std::byte{0}) return bad("reserved bytes are not zero", block + kBlockReserved);
        return {};
    }

    static bool same_ellipsoid(const std::byte* a, const std::byte* b, size_t lane) {
        bool same = a[kBlockExponent + lane] == b[kBlockExponent + lane];
        for (const size_t array : {kBlockDiagonal, kBlockOffDiagonal})
            for (size_t i = 0; i < 3; ++i) {
                const size_t at = block_offset(array, i, lane);
                same = same && load_le<uint16_t>(a + at) == load_le<uint16_t>(b + at);
            }
        for (size_t i = 0; i < 3; ++i) same = same && stored_center(a, i, lane) == stored_center(b, i, lane);
        return same;
    }

    // The lanes of `block` from `lane` on are empty.
    Result<void> no_nodes_from(size_t block, size_t lane) const {
        struct Row { // eight numbers of one kind
            size_t begin, width;
        };
        Row rows[19] = {{kBlockExponent, 1}, {kBlockCount, 1}, {kBlockOffset, 1}, {kBlockFraction, 2}};
        size_t count = 4;
        for (const size_t array : {kBlockBoxLow, kBlockBoxHigh})
            for (size_t i = 0; i < 3; ++i) rows[count++] = {array + kBlockLanes * i, 1};
        for (const size_t array : {kBlockCenter, kBlockDiagonal, kBlockOffDiagonal})
            for (size_t i = 0; i < 3; ++i) rows[count++] = {block_offset(array, i, 0), 2};
        for (const auto [begin, width] : rows) {
            const size_t end = block + begin + kBlockLanes * width;
            const size_t found = first_nonzero(file_, block + begin + lane * width, end);
            if (found < end) return bad("a lane without a node is not zero", found);
        }
        return {};
    }

    const std::byte* const file_;
    const size_t first_block_;
    const uint32_t degree_;
    const bool exact_;
    const LatticeInfo lattice_;
    uint32_t block_ = 0; // of the next family
    uint64_t level_end_ = 0, next_child_block_ = 0;
    uint64_t children_ = 0, next_triangle_ = 0;
};

// What the header and the levels table say of the whole file, and which of its levels the bytes hold.
struct Layout : Levels {
    uint32_t level_count = 0;
    bool exact = false;
    uint64_t total = 0;       // bytes of the whole file
    uint64_t tree_end = 0;    // where its sections begin, but for the zeros before, or it ends
    uint64_t present_end = 0; // where the last of these levels ends
};

// The header, the table, and how many bytes there are.
Result<Layout> check_layout(std::span<const std::byte> bytes, bool check_hash) {
    if (const auto header = check_header(bytes); !header) return header.error();
    const std::byte* const h = bytes.data();
    Layout out;
    out.level_count = load_le<uint16_t>(h + kAtLevelCount);
    const size_t table_bytes = table_end(out.level_count);
    if (bytes.size() < table_bytes) return bad("the file ends inside its levels table", bytes.size());
    if (check_hash && header_hash(bytes.first(table_bytes)) != load_le<uint64_t>(h + kAtHeaderHash))
        return bad("the header is damaged (hash mismatch)", kAtHeaderHash);

    out.exact = (load_le<uint32_t>(h + kAtFlags) & kExact) != 0;
    const auto levels = check_levels(bytes, out.level_count, out.exact);
    if (!levels) return levels.error();
    static_cast<Levels&>(out) = *levels;
    if (load_le<uint32_t>(h + kAtNodeCount) != out.nodes) return bad("wrong node count", kAtNodeCount);
    out.tree_end = end_of_blocks(out.level_count, out.bounding_blocks + out.blocks);
    if (out.exact)
        out.tree_end +=
            section_bytes(out.blocks, load_le<uint32_t>(h + kAtVertexCount), load_le<uint32_t>(h + kAtTriangleCount));
    out.total = load_le<uint64_t>(h + kAtTotalSize);
    const bool has_sections = (load_le<uint32_t>(h + kAtFlags) & kHasSections) != 0;
    if (has_sections ? out.total < section_aligned(out.tree_end) + kSectionContent || out.total % kBlockAlignment != 0
                     : out.total != out.tree_end)
        return bad("wrong total size", kAtTotalSize);
    if (out.present == 0) return bad("the file is cut off before the end of its first level", bytes.size());
    out.present_end = load_le<uint64_t>(h + kHeaderBytes + (out.present - 1) * kLevelBytes + kLevelEndByte);
    if (bytes.size() > out.total) return bad("bytes follow the end of the tree", out.total);
    if (bytes.size() != out.total && bytes.size() != out.present_end)
        return out.present < out.level_count  ? bad("the file is cut off inside a level", bytes.size())
               : bytes.size() >= out.tree_end ? bad("the file is cut off inside its sections", bytes.size())
                                              : bad("the file is cut off inside its triangles", bytes.size());
    const size_t bounding = bounding_begin(out.level_count);
    if (const size_t at = first_nonzero(h, table_bytes, bounding); at < bounding)
        return bad("bytes between the levels table and the nodes are not zero", at);
    return out;
}

// Of the hull record at `at`.
Result<void> check_slab(const std::byte* h, size_t at, uint32_t triangle_count) {
    if (!has_slab(h + at)) {
        const size_t found = first_nonzero(h, at + kHullPlane, at + kHullBytes);
        return found < at + kHullBytes ? bad("a slab without a normal", found) : Result<void>{};
    }
    if (load_le<uint32_t>(h + at + kHullPlane) >= triangle_count)
        return bad("a slab names a triangle that does not exist", at + kHullPlane);
    const float low = load_le<float>(h + at + kHullLow), high = load_le<float>(h + at + kHullHigh);
    if (!(std::isfinite(low) && std::isfinite(high) && low <= high))
        return bad("heights of a slab out of range", at + kHullLow);
    return {};
}

// The section at `at`: its header, its zeros and its hash. Returns where the next one begins.
Result<size_t> check_section(std::span<const std::byte> file, size_t at, bool check_hash) {
    const std::byte* const h = file.data() + at;
    for (size_t i = 0; i < sizeof kInnerKind; ++i)
        if (const auto c = load_le<uint8_t>(h + i); c <= ' ' || c > '~')
            return bad("the kind of a section is no word", at + i);
    if (!all_zero(h + sizeof kInnerKind, kSectionSize - sizeof kInnerKind))
        return bad("reserved bytes are not zero", at + sizeof kInnerKind);
    const uint64_t room = file.size() - at - kSectionContent; // a multiple of the alignment
    const auto size = load_le<uint64_t>(h + kSectionSize);
    if (size == 0 || size > room) return bad("wrong size of a section", at + kSectionSize);
    if (const size_t found = first_nonzero(h, kSectionZeros, kSectionContent); found < kSectionContent)
        return bad("reserved bytes are not zero", at + found);
    const size_t begin = at + kSectionContent, end = begin + static_cast<size_t>(size);
    if (check_hash && kind_hash(h, file.subspan(begin, end - begin)) != load_le<uint64_t>(h + kSectionHash))
        return bad("a section is damaged (hash mismatch)", at + kSectionHash);
    const auto next = static_cast<size_t>(section_aligned(end));
    if (const size_t found = first_nonzero(file.data(), end, next); found < next)
        return bad("bytes behind a section are not zero", found);
    return next;
}

// One level's nodes: the only root, or the children of the level above.
Result<void> check_families(NodeCheck& check, const LevelInfo* above) {
    if (above == nullptr) return check.family(1);
    for (uint32_t i = 0; i < kBlockLanes * above->block_count; ++i) {
        const uint32_t children = check.child_count(above->first_slot + i); // none of a lane without a node
        if (children == 0) continue;
        if (const auto sound = check.family(children); !sound) return sound;
    }
    return {};
}

} // namespace

Result<TreeView> TreeView::open(std::span<const std::byte> bytes, const OpenOptions& options) noexcept {
    const auto layout = check_layout(bytes, options.check_hash);
    if (!layout) return layout.error();
    const std::byte* const h = bytes.data();
    TreeView view;
    view.bytes_ = bytes;
    view.raw_.blocks_ = h + static_cast<size_t>(end_of_blocks(layout->level_count, layout->bounding_blocks));
    view.level_count_ = layout->level_count; // for a look beyond the bytes, at the table
    view.is_prefix_ = bytes.size() < layout->total;
    view.raw_.lattice_ = lattice_of(h);
    if (const auto sound = view.open_nodes(layout->present, layout->exact, options.check_hash); !sound)
        return sound.error();
    if (view.is_prefix_) return view;
    if (layout->exact)
        if (const auto sound = view.open_triangles(static_cast<size_t>(layout->present_end), options.check_hash);
            !sound)
            return sound.error();
    if (layout->total > layout->tree_end)
        if (const auto sound = view.open_sections(static_cast<size_t>(layout->tree_end), options.check_hash); !sound)
            return sound.error();
    return view;
}

Result<void> TreeView::open_nodes(uint32_t present, bool exact, bool check_hash) noexcept {
    const std::byte* const h = bytes_.data();
    const uint32_t level_count = level_count_;
    const size_t bounding = bounding_begin(level_count), first_block = static_cast<size_t>(raw_.blocks_ - h);
    NodeCheck check(h, first_block, load_le<uint16_t>(h + kAtDegree), exact, raw_.lattice_);
    LevelInfo above;
    for (uint32_t l = 0; l < present; ++l) {
        const LevelInfo level = this->level(l);
        node_count_ += level.node_count;
        block_count_ += level.block_count;
        const size_t level_bytes = level.block_count * kBlockBytes;
        const size_t begin = static_cast<size_t>(level.end_byte) - level_bytes;
        const auto hash = [&] {
            return l > 0 ? hash_bytes(bytes_.subspan(begin, level_bytes))
                         : root_hash(bytes_, level_count, (first_block - bounding) / kBlockBytes);
        };
        if (check_hash && hash() != load_le<uint64_t>(h + kHeaderBytes + l * kLevelBytes + kLevelHash))
            return bad("the nodes of a level are damaged (hash mismatch)", begin);
        check.begin_level(block_count_);
        if (const auto sound = check_families(check, l > 0 ? &above : nullptr); !sound) return sound;
        const LevelInfo below = l + 1 < level_count ? this->level(l + 1) : LevelInfo{};
        if (check.children() != below.node_count || check.child_blocks() != below.block_count)
            return bad("the children of a level are not the next level", begin);
        above = level;
    }
    level_count_ = present;
    if (!exact) {
        raw_.bounding_blocks_ = h + bounding;
        raw_.bounding_count_ = first_slot(present - 1) / kBlockLanes;
        for (uint32_t b = 0; b < raw_.bounding_count_; ++b)
            if (const auto sound = check.bounding_block(b, bounding + size_t{b} * kBlockBytes); !sound) return sound;
    }
    find_root();
    const uint32_t triangle_count = load_le<uint32_t>(h + kAtTriangleCount);
    if (check.triangles() > triangle_count || (present == level_count && check.triangles() != triangle_count))
        return bad("the leaves do not share out the triangles", kAtTriangleCount);
    return {};
}

Result<void> TreeView::open_triangles(size_t hulls, bool check_hash) noexcept {
    const std::byte* const h = bytes_.data();
    const size_t hull_bytes = block_count_ * kHullBytes, hash = hulls + hull_bytes;
    const size_t vertices = hash + kSectionHashBytes;
    vertex_count_ = load_le<uint32_t>(h + kAtVertexCount);
    triangle_count_ = load_le<uint32_t>(h + kAtTriangleCount);
    const auto size = static_cast<size_t>(section_bytes(block_count_, vertex_count_, triangle_count_));
    if (check_hash && section_hash(bytes_.subspan(hulls, size), hull_bytes) != load_le<uint64_t>(h + hash))
        return bad("the triangles are damaged (hash mismatch)", hash);
    for (size_t at = hulls; at < hash; at += kHullBytes) {
        if (const auto sound = check_slab(h, at, triangle_count_); !sound) return sound;
        raw_.has_slabs_ = raw_.has_slabs_ || has_slab(h + at);
    }
    component_count_ = load_le<uint32_t>(h + kAtComponentCount);
    raw_.hulls_ = h + hulls;
    raw_.vertices_ = h + vertices;
    raw_.triangles_ = raw_.vertices_ + size_t{vertex_count_} * kVertexBytes;
    for (uint32_t v = 0; v < vertex_count_; ++v) {
        const Vec3 p = vertex(v);
        for (const float x : {p.x, p.y, p.z})
            if (!(std::abs(x) <= kLargestCoordinate)) // also a NaN
                return bad("a vertex is not finite, or beyond the largest coordinate (2^74 m)",
                           vertices + size_t{v} * kVertexBytes);
    }
    for (uint32_t t = 0; t < triangle_count_; ++t)
        for (const uint32_t corner : triangle(t))
            if (corner >= vertex_count_)
                return bad("a triangle names a vertex that does not exist",
                           static_cast<size_t>(raw_.triangles_ - h) + size_t{t} * 3 * index_bytes(vertex_count_));
    find_root();
    return {};
}

Result<void> TreeView::open_sections(size_t begin, bool check_hash) noexcept {
    size_t at = static_cast<size_t>(section_aligned(begin));
    if (const size_t found = first_nonzero(bytes_.data(), begin, at); found < at)
        return bad("bytes before the sections are not zero", found);
    sections_ = at;
    for (size_t next; at < bytes_.size(); at = next) {
        const auto end = check_section(bytes_, at, check_hash);
        if (!end) return end.error();
        next = *end;
        const Section found = section(section_count_++);
        const auto is = [&found](const char(&known)[4]) { return std::memcmp(found.kind, known, sizeof known) == 0; };
        const auto sound = is(kInnerKind)         ? open_inner(found.content, at, check_hash)
                           : is(kDeformationKind) ? open_deformation(found.content, at)
                           : is(kSkinKind)        ? open_skin(found.content, at)
                                                  : Result<void>{}; // skipped, if it is not known
        if (!sound) return sound;
    }
    const auto modes = deformation();
    const auto bones = skin();
    if (!modes || !bones || has_triangles()) return {};
    bool same = modes->point_count() == bones->point_count();
    for (uint32_t p = 0; same && p < bones->point_count(); ++p) same = modes->point(p) == bones->point(p);
    if (!same) return bad("a skin of other points than the deformation's", sections_);
    return {};
}

// The section at `at`.
Result<void> TreeView::open_inner(std::span<const std::byte> content, size_t at, bool check_hash) noexcept {
    const size_t where = at + kSectionContent;
    if (!inner_.empty()) return bad("two inner covers", at);
    if (content.size() < kHeaderBytes || (load_le<uint32_t>(content.data() + kAtFlags) & kInner) == 0)
        return bad("an inner cover that says it is none", where);
    const auto tree = open(content, {.check_hash = check_hash}); // it has no sections: no deeper than this
    if (!tree) return Error{tree.error().code, tree.error().what, tree.error().where + where};
    if (tree->is_prefix()) return bad("an inner cover that is cut off", where);
    inner_ = content;
    return {};
}

Result<void> TreeView::open_deformation(std::span<const std::byte> content, size_t at) noexcept {
    if (!modes_.empty()) return bad("two deformations", at);
    if (const auto sound = check_deformation(content, *this); !sound)
        return bad(sound.error().what, at + kSectionContent + static_cast<size_t>(sound.error().where));
    modes_ = content;
    return {};
}

Result<void> TreeView::open_skin(std::span<const std::byte> content, size_t at) noexcept {
    if (!skin_.empty()) return bad("two skins", at);
    if (const auto sound = check_skin(content, *this); !sound)
        return bad(sound.error().what, at + kSectionContent + static_cast<size_t>(sound.error().where));
    skin_ = content;
    return {};
}

} // namespace prolate
