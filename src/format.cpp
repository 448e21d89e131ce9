// Writing and validating .etree bytes (src/FORMAT.md).
//
// Validation makes every later query memory-safe and finite. It does not, and cannot, prove that the nodes cover
// anything: the content hashes find accidents, verify() proves cover against a mesh.
#include "src/format.hpp"

#include "src/bytes.hpp"
#include "src/hash.hpp"

#include <prolate/version.hpp>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstring>
#include <iterator>

namespace prolate {
namespace {

constexpr unsigned char kMagic[8] = {0x89, 'E', 'T', 'R', 'E', 'E', '\r', '\n'};

// Offsets of the header. Changing any of these is a new format version: add a row to FORMAT.md's history.
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
    kHeaderBytes = 144,
};
enum Flag : uint32_t { kSurfaceMode = 1, kExact = 2, kProved = 4, kGoalMissed = 8, kAllFlags = 15 };

// A row of the levels table, which follows the header.
enum LevelOffset : size_t {
    kLevelFirstNode = 0,
    kLevelNodeCount = 4,
    kLevelEndByte = 8,
    kLevelHash = 16,
    kLevelUnionVolume = 24,
    kLevelFigures = 32, // kFigures, in their order
    kLevelBytes = 60,
};
constexpr double LevelFigures::*kFigures[] = {
    &LevelFigures::outside_ratio, &LevelFigures::outside_ratio_error, &LevelFigures::sum_outside_ratio,
    &LevelFigures::surface_error, &LevelFigures::hausdorff_max,       &LevelFigures::hausdorff_mean,
    &LevelFigures::hausdorff_p99,
};
static_assert(kLevelFigures + sizeof(float) * std::size(kFigures) == kLevelBytes);

// A node.
enum NodeOffset : size_t {
    kNodeFirstChild = 0,
    kNodeCenter = 4,
    kNodeDiagonal = 10,
    kNodeOffDiagonal = 16,
    kNodeExponent = 22,
    kNodeChildCount = 23,
};
static_assert(kNodeChildCount + 1 == kNodeBytes, "a change of the node layout needs a new format version");
constexpr uint8_t kTriangleLeaf = 0x80; // this bit of the child count marks a count of triangles instead
static_assert(kMaxDegree < kTriangleLeaf && kMaxLeafTriangles < kTriangleLeaf);

// The triangle section of an exact tree, which follows the nodes: hash, vertices, indices.
constexpr size_t kSectionHashBytes = 8, kVertexBytes = 12;

// Bytes of a vertex index.
constexpr size_t index_bytes(uint32_t vertex_count) {
    return vertex_count <= 0x10000 ? 2 : 4;
}

uint64_t section_bytes(uint32_t vertices, uint32_t triangles) {
    return kSectionHashBytes + uint64_t{vertices} * kVertexBytes + uint64_t{triangles} * 3 * index_bytes(vertices);
}

// Also guards against a reader of 32-bit size_t: files stay below 2^32 nodes * 24 bytes in 64-bit arithmetic.
uint64_t end_of_nodes(uint32_t level_count, uint64_t nodes) {
    return kHeaderBytes + uint64_t{level_count} * kLevelBytes + nodes * kNodeBytes;
}

// Hash of header and levels table without the hash field itself.
uint64_t header_hash(std::span<const std::byte> header_and_table) {
    const uint64_t before = hash_bytes(header_and_table.first(kAtHeaderHash));
    return hash_bytes(header_and_table.subspan(kAtHeaderHash + 8), before);
}

Error bad(const char* what, uint64_t where) {
    return {ErrorCode::bad_file, what, where};
}

bool all_zero(const std::byte* from, size_t count) {
    return std::all_of(from, from + count, [](std::byte b) { return b == std::byte{0}; });
}

// A figure that is unknown (NaN) or finite and not negative.
template <class T> bool is_metric(T value) {
    return std::isnan(value) || (std::isfinite(value) && value >= 0);
}

format::PackedNode load_node(const std::byte* from) {
    format::PackedNode node;
    node.first_child = load_le<uint32_t>(from + kNodeFirstChild);
    for (size_t i = 0; i < 3; ++i) {
        node.center[i] = load_le<uint16_t>(from + kNodeCenter + 2 * i);
        node.diagonal[i] = load_le<uint16_t>(from + kNodeDiagonal + 2 * i);
        node.off_diagonal[i] = load_le<int16_t>(from + kNodeOffDiagonal + 2 * i);
    }
    node.exponent = load_le<int8_t>(from + kNodeExponent);
    const auto count = load_le<uint8_t>(from + kNodeChildCount);
    (count & kTriangleLeaf ? node.triangle_count : node.child_count) = count & ~kTriangleLeaf;
    return node;
}

void store_node(std::byte* to, const format::PackedNode& node) {
    store_le(to + kNodeFirstChild, node.first_child);
    for (size_t i = 0; i < 3; ++i) {
        store_le(to + kNodeCenter + 2 * i, node.center[i]);
        store_le(to + kNodeDiagonal + 2 * i, node.diagonal[i]);
        store_le(to + kNodeOffDiagonal + 2 * i, node.off_diagonal[i]);
    }
    store_le(to + kNodeExponent, node.exponent);
    const unsigned count = node.triangle_count ? kTriangleLeaf | node.triangle_count : node.child_count;
    store_le(to + kNodeChildCount, static_cast<uint8_t>(count));
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
    if (version < kFormatVersion) return bad("written by an older format version than this library reads", kAtVersion);
    if (bytes.size() < kHeaderBytes) return bad("the file ends inside its header", bytes.size());
    if (load_le<uint16_t>(h + kAtHeaderSize) != kHeaderBytes) return bad("wrong header size", kAtHeaderSize);
    const uint32_t flags = load_le<uint32_t>(h + kAtFlags);
    if ((flags & ~uint32_t{kAllFlags}) != 0) return bad("unknown flag", kAtFlags);
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
    if (!(flags & kExact)) {
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

void store_section(std::span<std::byte> section, const format::PackedTriangles& triangles) {
    std::byte* to = section.data() + kSectionHashBytes;
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
    store_le(section.data(), hash_bytes(section.subspan(kSectionHashBytes)));
}

} // namespace

namespace format {

Lattice lattice_for(const double low[3], const double high[3]) noexcept {
    double extent = 0, reach = 0;
    for (int i = 0; i < 3; ++i) {
        extent = std::max(extent, high[i] - low[i]);
        reach = std::max({reach, std::abs(low[i]), std::abs(high[i])});
    }
    // The smallest step for which the box spans fewer than 2^16 - 2 steps and lies within 2^24 - 2^17 steps of zero.
    const double needed = std::max(extent / (UINT16_MAX - 2.0), reach / (kMaxCoordinate - 2.0 * UINT16_MAX));
    int exponent = kMinStepExponent;
    if (needed > 0) exponent = std::clamp(std::ilogb(needed) + 1, kMinStepExponent, kMaxStepExponent);
    Lattice lattice;
    lattice.step_exponent = exponent;
    for (int i = 0; i < 3; ++i) // the clamp acts only beyond the coarsest step, where nothing fits anyway
        lattice.origin[i] = static_cast<int32_t>(std::clamp(std::floor(std::ldexp(low[i], -exponent)),
                                                            1.0 - kMaxCoordinate, kMaxCoordinate - UINT16_MAX - 1.0));
    return lattice;
}

void quantise(PackedNode& node, const Lattice& lattice, const double center[3], const double factor[6]) noexcept {
    for (size_t i = 0; i < 3; ++i) {
        const double q = std::nearbyint(std::ldexp(center[i], -lattice.step_exponent)) - lattice.origin[i];
        node.center[i] = static_cast<uint16_t>(std::clamp(q, 0.0, double{UINT16_MAX}));
    }
    const double diagonal[3] = {factor[0], factor[2], factor[5]};
    const double off[3] = {factor[1], factor[3], factor[4]};
    double largest = 0;
    for (int i = 0; i < 3; ++i) largest = std::max({largest, diagonal[i], std::abs(off[i])});
    // The smallest exponent at which the largest entry fits after rounding.
    int exponent =
        std::clamp(largest > 0 ? std::ilogb(largest) + 1 : kMinNodeExponent, kMinNodeExponent, kMaxNodeExponent);
    if (std::ldexp(largest, 16 - exponent) > UINT16_MAX - 1.0 && exponent < kMaxNodeExponent) ++exponent;
    node.exponent = static_cast<int8_t>(exponent);
    for (size_t i = 0; i < 3; ++i) {
        node.diagonal[i] = static_cast<uint16_t>(
            std::clamp(std::nearbyint(std::ldexp(diagonal[i], 16 - exponent)), 1.0, double{UINT16_MAX}));
        node.off_diagonal[i] = static_cast<int16_t>(
            std::clamp(std::nearbyint(std::ldexp(off[i], 15 - exponent)), double{INT16_MIN}, double{INT16_MAX}));
    }
}

Ellipsoid decode(const PackedNode& node, const Lattice& lattice) noexcept {
    const float step = std::ldexp(1.0f, lattice.step_exponent);
    const auto coordinate = [&](size_t i) {
        return static_cast<float>(lattice.origin[i] + int32_t{node.center[i]}) * step;
    };
    const float half_unit = std::ldexp(1.0f, node.exponent - 15);
    const auto diagonal = [&](size_t i) { return static_cast<float>(node.diagonal[i]) * (half_unit * 0.5f); };
    const auto off = [&](size_t i) { return static_cast<float>(node.off_diagonal[i]) * half_unit; };
    return {.center = {coordinate(0), coordinate(1), coordinate(2)},
            .l11 = diagonal(0),
            .l21 = off(0),
            .l22 = diagonal(1),
            .l31 = off(1),
            .l32 = off(2),
            .l33 = diagonal(2)};
}

std::vector<std::byte> encode(const BakeInfo& info, uint32_t degree, const Lattice& lattice,
                              std::span<const PackedLevel> levels, const PackedTriangles& triangles) {
    assert(!levels.empty() && levels.size() <= kMaxLevels && levels[0].nodes.size() == 1);
    const auto level_count = static_cast<uint32_t>(levels.size());
    uint64_t node_count = 0;
    for (const PackedLevel& level : levels) node_count += level.nodes.size();
    const size_t table_end = kHeaderBytes + level_count * kLevelBytes;
    const uint64_t nodes_end = end_of_nodes(level_count, node_count);
    const auto vertex_count = static_cast<uint32_t>(triangles.vertices.size());
    const auto triangle_count = static_cast<uint32_t>(triangles.triangles.size());
    std::vector<std::byte> bytes(nodes_end + (info.exact ? section_bytes(vertex_count, triangle_count) : 0));
    std::byte* const h = bytes.data();

    std::memcpy(h + kAtMagic, kMagic, sizeof kMagic);
    store_le(h + kAtVersion, kFormatVersion);
    store_le(h + kAtHeaderSize, static_cast<uint16_t>(kHeaderBytes));
    store_le(h + kAtFlags, (info.surface_mode ? kSurfaceMode : 0u) | (info.exact ? kExact : 0u) |
                               (info.proved ? kProved : 0u) | (info.goal_reached ? 0u : kGoalMissed));
    store_le(h + kAtTotalSize, uint64_t{bytes.size()});
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
    if (info.exact) {
        store_le(h + kAtVertexCount, vertex_count);
        store_le(h + kAtTriangleCount, triangle_count);
        store_le(h + kAtComponentCount, triangles.components);
        store_section({h + nodes_end, bytes.size() - nodes_end}, triangles);
    }

    uint32_t first_node = 0, next_triangle = 0;
    for (uint32_t l = 0; l < level_count; ++l) {
        const PackedLevel& level = levels[l];
        const auto count = static_cast<uint32_t>(level.nodes.size());
        uint32_t next_child = first_node + count;
        std::byte* const begin = h + table_end + size_t{first_node} * kNodeBytes;
        for (uint32_t i = 0; i < count; ++i) {
            PackedNode node = level.nodes[i];
            node.first_child = node.child_count ? next_child : node.triangle_count ? next_triangle : 0;
            next_child += node.child_count;
            next_triangle += node.triangle_count;
            store_node(begin + size_t{i} * kNodeBytes, node);
        }
        std::byte* const row = h + kHeaderBytes + l * kLevelBytes;
        store_le(row + kLevelFirstNode, first_node);
        store_le(row + kLevelNodeCount, count);
        store_le(row + kLevelEndByte, end_of_nodes(level_count, uint64_t{first_node} + count));
        store_le(row + kLevelHash, hash_bytes({begin, size_t{count} * kNodeBytes}));
        store_le(row + kLevelUnionVolume, level.figures.union_volume);
        for (size_t i = 0; i < std::size(kFigures); ++i)
            store_le(row + kLevelFigures + sizeof(float) * i, static_cast<float>(level.figures.*kFigures[i]));
        first_node += count;
    }
    assert(next_triangle == triangle_count);
    store_le(h + kAtHeaderHash, header_hash({h, table_end}));
    return bytes;
}

} // namespace format

Result<TreeView> TreeView::open(std::span<const std::byte> bytes, const OpenOptions& options) noexcept {
    if (const auto header = check_header(bytes); !header) return header.error();
    const std::byte* const h = bytes.data();
    const uint32_t level_count = load_le<uint16_t>(h + kAtLevelCount);
    const uint32_t degree = load_le<uint16_t>(h + kAtDegree);
    const size_t table_end = kHeaderBytes + level_count * kLevelBytes;
    if (bytes.size() < table_end) return bad("the file ends inside its levels table", bytes.size());
    if (options.check_hash && header_hash(bytes.first(table_end)) != load_le<uint64_t>(h + kAtHeaderHash))
        return bad("the header is damaged (hash mismatch)", kAtHeaderHash);

    // The table: consecutive levels, sizes that follow from the counts.
    uint64_t nodes = 0;
    uint32_t present = 0; // levels that the bytes hold
    for (uint32_t l = 0; l < level_count; ++l) {
        const size_t at = kHeaderBytes + l * kLevelBytes;
        const uint32_t count = load_le<uint32_t>(h + at + kLevelNodeCount);
        if (load_le<uint32_t>(h + at + kLevelFirstNode) != nodes) return bad("levels are not consecutive", at);
        if (count == 0 || (l == 0 && count != 1)) return bad("wrong node count of a level", at + kLevelNodeCount);
        nodes += count;
        if (nodes > UINT32_MAX) return bad("too many nodes", at + kLevelNodeCount);
        if (load_le<uint64_t>(h + at + kLevelEndByte) != end_of_nodes(level_count, nodes))
            return bad("wrong byte count of a level", at + kLevelEndByte);
        bool sound = is_metric(load_le<double>(h + at + kLevelUnionVolume));
        for (size_t i = kLevelFigures; i < kLevelBytes; i += sizeof(float))
            sound = sound && is_metric(load_le<float>(h + at + i));
        if (!sound) return bad("level figures out of range", at + kLevelUnionVolume);
        if (end_of_nodes(level_count, nodes) <= bytes.size()) present = l + 1;
    }
    if (load_le<uint32_t>(h + kAtNodeCount) != nodes) return bad("wrong node count", kAtNodeCount);
    const bool exact = (load_le<uint32_t>(h + kAtFlags) & kExact) != 0;
    const uint32_t vertex_count = load_le<uint32_t>(h + kAtVertexCount);
    const uint32_t triangle_count = load_le<uint32_t>(h + kAtTriangleCount);
    const uint64_t total = end_of_nodes(level_count, nodes) + (exact ? section_bytes(vertex_count, triangle_count) : 0);
    if (load_le<uint64_t>(h + kAtTotalSize) != total) return bad("wrong total size", kAtTotalSize);
    if (present == 0) return bad("the file is cut off before the end of its first level", bytes.size());
    const uint64_t present_end = load_le<uint64_t>(h + kHeaderBytes + (present - 1) * kLevelBytes + kLevelEndByte);
    if (bytes.size() > total) return bad("bytes follow the end of the tree", total);
    if (bytes.size() != total && bytes.size() != present_end)
        return present == level_count ? bad("the file is cut off inside its triangles", bytes.size())
                                      : bad("the file is cut off inside a level", bytes.size());

    // The nodes: children in breadth-first order, so that each node has one parent, before it.
    TreeView view;
    view.bytes_ = bytes;
    view.nodes_ = h + table_end;
    view.level_count_ = present;
    view.is_prefix_ = bytes.size() < total;
    for (size_t i = 0; i < 3; ++i) view.origin_[i] = load_le<int32_t>(h + kAtOrigin + 4 * i);
    view.step_exponent_ = load_le<int16_t>(h + kAtStepExponent);
    uint64_t next_child = 1, next_triangle = 0;
    for (uint32_t l = 0; l < present; ++l) {
        const LevelInfo level = view.level(l);
        view.node_count_ = level.first_node + level.node_count;
        const std::byte* const begin = view.nodes_ + size_t{level.first_node} * kNodeBytes;
        const size_t begin_byte = table_end + size_t{level.first_node} * kNodeBytes;
        if (options.check_hash && hash_bytes({begin, size_t{level.node_count} * kNodeBytes}) !=
                                      load_le<uint64_t>(h + kHeaderBytes + l * kLevelBytes + kLevelHash))
            return bad("the nodes of a level are damaged (hash mismatch)", begin_byte);
        for (uint32_t i = 0; i < level.node_count; ++i) {
            const size_t at = begin_byte + size_t{i} * kNodeBytes;
            const format::PackedNode node = load_node(h + at);
            if (node.child_count > degree) return bad("a node has more children than the degree", at + kNodeChildCount);
            const bool marked = (load_le<uint8_t>(h + at + kNodeChildCount) & kTriangleLeaf) != 0;
            if (marked != (exact && node.child_count == 0) || marked != (node.triangle_count > 0))
                return bad("a leaf has no triangles, or some in a tree without", at + kNodeChildCount);
            if (node.first_child != (node.child_count ? next_child : next_triangle))
                return bad("children or triangles are not in breadth-first order", at + kNodeFirstChild);
            next_child += node.child_count;
            next_triangle += node.triangle_count;
            if (node.exponent < format::kMinNodeExponent || node.exponent > format::kMaxNodeExponent)
                return bad("node size out of range", at + kNodeExponent);
            for (size_t k = 0; k < 3; ++k)
                if (node.diagonal[k] == 0) return bad("a node has no extent", at + kNodeDiagonal + 2 * k);
        }
        const uint32_t next_count =
            l + 1 < level_count ? load_le<uint32_t>(h + kHeaderBytes + (l + 1) * kLevelBytes + kLevelNodeCount) : 0;
        if (next_child != uint64_t{view.node_count_} + next_count)
            return bad("the children of a level are not the next level", begin_byte);
    }
    if (next_triangle > triangle_count || (present == level_count && next_triangle != triangle_count))
        return bad("the leaves do not share out the triangles", kAtTriangleCount);
    if (!exact || view.is_prefix_) return view;

    const size_t section = present_end, vertices = section + kSectionHashBytes;
    if (options.check_hash && hash_bytes(bytes.subspan(vertices)) != load_le<uint64_t>(h + section))
        return bad("the triangles are damaged (hash mismatch)", section);
    view.vertices_ = h + vertices;
    view.triangles_ = view.vertices_ + size_t{vertex_count} * kVertexBytes;
    view.vertex_count_ = vertex_count;
    view.triangle_count_ = triangle_count;
    view.component_count_ = load_le<uint32_t>(h + kAtComponentCount);
    for (uint32_t v = 0; v < vertex_count; ++v) {
        const Vec3 p = view.vertex(v);
        if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z))
            return bad("a vertex is not finite", vertices + size_t{v} * kVertexBytes);
    }
    for (uint32_t t = 0; t < triangle_count; ++t)
        for (const uint32_t corner : view.triangle(t))
            if (corner >= vertex_count)
                return bad("a triangle names a vertex that does not exist",
                           static_cast<size_t>(view.triangles_ - h) + size_t{t} * 3 * index_bytes(vertex_count));
    return view;
}

uint32_t TreeView::degree() const noexcept {
    return load_le<uint16_t>(bytes_.data() + kAtDegree);
}

LevelInfo TreeView::level(uint32_t l) const noexcept {
    assert(l < level_count_);
    const std::byte* const row = bytes_.data() + kHeaderBytes + l * kLevelBytes;
    LevelInfo level;
    level.first_node = load_le<uint32_t>(row + kLevelFirstNode);
    level.node_count = load_le<uint32_t>(row + kLevelNodeCount);
    level.end_byte = load_le<uint64_t>(row + kLevelEndByte);
    level.union_volume = load_le<double>(row + kLevelUnionVolume);
    for (size_t i = 0; i < std::size(kFigures); ++i)
        level.*kFigures[i] = load_le<float>(row + kLevelFigures + sizeof(float) * i);
    return level;
}

BakeInfo TreeView::bake_info() const noexcept {
    const std::byte* const h = bytes_.data();
    return {.source_hash = load_le<uint64_t>(h + kAtSourceHash),
            .options_hash = load_le<uint64_t>(h + kAtOptionsHash),
            .surface_mode = (load_le<uint32_t>(h + kAtFlags) & kSurfaceMode) != 0,
            .exact = (load_le<uint32_t>(h + kAtFlags) & kExact) != 0,
            .proved = (load_le<uint32_t>(h + kAtFlags) & kProved) != 0,
            .goal_reached = (load_le<uint32_t>(h + kAtFlags) & kGoalMissed) == 0,
            .solid_volume = load_le<double>(h + kAtSolidVolume),
            .solid_volume_error = load_le<float>(h + kAtSolidVolumeError),
            .diagonal = load_le<double>(h + kAtDiagonal),
            .method = static_cast<Method>(load_le<uint8_t>(h + kAtMethod)),
            .primitive = static_cast<Primitive>(load_le<uint8_t>(h + kAtPrimitive)),
            .quality = static_cast<Quality>(load_le<uint8_t>(h + kAtQuality)),
            .alpha = load_le<float>(h + kAtAlpha),
            .beta = load_le<float>(h + kAtBeta),
            .tolerance = load_le<float>(h + kAtTolerance),
            .distance = load_le<float>(h + kAtDistance),
            .levels = load_le<uint32_t>(h + kAtLevels),
            .ellipsoids = load_le<uint32_t>(h + kAtEllipsoids),
            .seed = load_le<uint64_t>(h + kAtSeed),
            .resolution = load_le<uint32_t>(h + kAtResolution)};
}

Ellipsoid TreeView::ellipsoid(uint32_t node) const noexcept {
    assert(node < node_count_);
    return format::decode(load_node(nodes_ + size_t{node} * kNodeBytes),
                          {{origin_[0], origin_[1], origin_[2]}, step_exponent_});
}

ChildRange TreeView::children(uint32_t node) const noexcept {
    assert(node < node_count_);
    const std::byte* const from = nodes_ + size_t{node} * kNodeBytes;
    const ChildRange range{load_le<uint32_t>(from + kNodeFirstChild), load_le<uint8_t>(from + kNodeChildCount)};
    return range.first < node_count_ && range.count < kTriangleLeaf ? range : ChildRange{};
}

TriangleRange TreeView::triangles(uint32_t node) const noexcept {
    assert(node < node_count_);
    const std::byte* const from = nodes_ + size_t{node} * kNodeBytes;
    const auto count = load_le<uint8_t>(from + kNodeChildCount);
    if (!has_triangles() || count < kTriangleLeaf) return {};
    return {load_le<uint32_t>(from + kNodeFirstChild), uint32_t{count} - kTriangleLeaf};
}

Triangle TreeView::triangle(uint32_t t) const noexcept {
    assert(t < triangle_count_);
    if (index_bytes(vertex_count_) == 2) {
        const std::byte* const from = triangles_ + size_t{t} * 6;
        return {load_le<uint16_t>(from), load_le<uint16_t>(from + 2), load_le<uint16_t>(from + 4)};
    }
    const std::byte* const from = triangles_ + size_t{t} * 12;
    return {load_le<uint32_t>(from), load_le<uint32_t>(from + 4), load_le<uint32_t>(from + 8)};
}

Vec3 TreeView::vertex(uint32_t v) const noexcept {
    assert(v < vertex_count_);
    const std::byte* const from = vertices_ + size_t{v} * kVertexBytes;
    return {load_le<float>(from), load_le<float>(from + 4), load_le<float>(from + 8)};
}

} // namespace prolate
