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
    kAtReserved2 = 116,
    kHeaderBytes = 128,
};
constexpr uint32_t kFlagSurfaceMode = 1;

// A row of the levels table, which follows the header.
enum LevelOffset : size_t {
    kLevelFirstNode = 0,
    kLevelNodeCount = 4,
    kLevelEndByte = 8,
    kLevelHash = 16,
    kLevelOutsideRatio = 24,
    kLevelSurfaceError = 28,
    kLevelBytes = 32,
};

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
    node.child_count = load_le<uint8_t>(from + kNodeChildCount);
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
    store_le(to + kNodeChildCount, node.child_count);
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
    if (version != kFormatVersion) return bad("unknown format version", kAtVersion);
    if (bytes.size() < kHeaderBytes) return bad("the file ends inside its header", bytes.size());
    if (load_le<uint16_t>(h + kAtHeaderSize) != kHeaderBytes) return bad("wrong header size", kAtHeaderSize);
    if ((load_le<uint32_t>(h + kAtFlags) & ~kFlagSurfaceMode) != 0) return bad("unknown flag", kAtFlags);
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
    for (const size_t at : {kAtAlpha, kAtBeta, kAtTolerance})
        if (!std::isfinite(load_le<float>(h + at)) || load_le<float>(h + at) < 0) return bad("option out of range", at);
    if (!all_zero(h + kAtReserved0, 2)) return bad("reserved bytes are not zero", kAtReserved0);
    if (!all_zero(h + kAtReserved1, 1)) return bad("reserved bytes are not zero", kAtReserved1);
    if (!all_zero(h + kAtReserved2, kHeaderBytes - kAtReserved2))
        return bad("reserved bytes are not zero", kAtReserved2);
    return {};
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
                              std::span<const PackedLevel> levels) {
    assert(!levels.empty() && levels.size() <= kMaxLevels && levels[0].nodes.size() == 1);
    const auto level_count = static_cast<uint32_t>(levels.size());
    uint64_t node_count = 0;
    for (const PackedLevel& level : levels) node_count += level.nodes.size();
    const size_t table_end = kHeaderBytes + level_count * kLevelBytes;
    std::vector<std::byte> bytes(end_of_nodes(level_count, node_count));
    std::byte* const h = bytes.data();

    std::memcpy(h + kAtMagic, kMagic, sizeof kMagic);
    store_le(h + kAtVersion, kFormatVersion);
    store_le(h + kAtHeaderSize, static_cast<uint16_t>(kHeaderBytes));
    store_le(h + kAtFlags, info.surface_mode ? kFlagSurfaceMode : 0);
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
    store_le(h + kAtLevels, info.levels);
    store_le(h + kAtEllipsoids, info.ellipsoids);
    store_le(h + kAtSeed, info.seed);
    store_le(h + kAtResolution, info.resolution);

    uint32_t first_node = 0;
    for (uint32_t l = 0; l < level_count; ++l) {
        const PackedLevel& level = levels[l];
        const auto count = static_cast<uint32_t>(level.nodes.size());
        uint32_t next_child = first_node + count;
        std::byte* const begin = h + table_end + size_t{first_node} * kNodeBytes;
        for (uint32_t i = 0; i < count; ++i) {
            PackedNode node = level.nodes[i];
            node.first_child = node.child_count ? next_child : 0;
            next_child += node.child_count;
            store_node(begin + size_t{i} * kNodeBytes, node);
        }
        std::byte* const row = h + kHeaderBytes + l * kLevelBytes;
        store_le(row + kLevelFirstNode, first_node);
        store_le(row + kLevelNodeCount, count);
        store_le(row + kLevelEndByte, end_of_nodes(level_count, uint64_t{first_node} + count));
        store_le(row + kLevelHash, hash_bytes({begin, size_t{count} * kNodeBytes}));
        store_le(row + kLevelOutsideRatio, level.outside_ratio);
        store_le(row + kLevelSurfaceError, level.surface_error);
        first_node += count;
    }
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
        if (!is_metric(load_le<float>(h + at + kLevelOutsideRatio)) ||
            !is_metric(load_le<float>(h + at + kLevelSurfaceError)))
            return bad("level figures out of range", at + kLevelOutsideRatio);
        if (end_of_nodes(level_count, nodes) <= bytes.size()) present = l + 1;
    }
    if (load_le<uint32_t>(h + kAtNodeCount) != nodes) return bad("wrong node count", kAtNodeCount);
    if (load_le<uint64_t>(h + kAtTotalSize) != end_of_nodes(level_count, nodes))
        return bad("wrong total size", kAtTotalSize);
    if (present == 0) return bad("the file is cut off before the end of its first level", bytes.size());
    const uint64_t present_end = load_le<uint64_t>(h + kHeaderBytes + (present - 1) * kLevelBytes + kLevelEndByte);
    if (present_end != bytes.size())
        return present == level_count ? bad("bytes follow the end of the tree", present_end)
                                      : bad("the file is cut off inside a level", bytes.size());

    // The nodes: children in breadth-first order, so that each node has one parent, before it.
    TreeView view;
    view.bytes_ = bytes;
    view.nodes_ = h + table_end;
    view.level_count_ = present;
    view.is_prefix_ = present < level_count;
    for (size_t i = 0; i < 3; ++i) view.origin_[i] = load_le<int32_t>(h + kAtOrigin + 4 * i);
    view.step_exponent_ = load_le<int16_t>(h + kAtStepExponent);
    uint64_t next_child = 1;
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
            if (node.first_child != (node.child_count ? next_child : 0))
                return bad("children are not in breadth-first order", at + kNodeFirstChild);
            next_child += node.child_count;
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
    return view;
}

uint32_t TreeView::degree() const noexcept {
    return load_le<uint16_t>(bytes_.data() + kAtDegree);
}

LevelInfo TreeView::level(uint32_t l) const noexcept {
    assert(l < level_count_);
    const std::byte* const row = bytes_.data() + kHeaderBytes + l * kLevelBytes;
    return {.first_node = load_le<uint32_t>(row + kLevelFirstNode),
            .node_count = load_le<uint32_t>(row + kLevelNodeCount),
            .end_byte = load_le<uint64_t>(row + kLevelEndByte),
            .outside_ratio = load_le<float>(row + kLevelOutsideRatio),
            .surface_error = load_le<float>(row + kLevelSurfaceError)};
}

BakeInfo TreeView::bake_info() const noexcept {
    const std::byte* const h = bytes_.data();
    return {.source_hash = load_le<uint64_t>(h + kAtSourceHash),
            .options_hash = load_le<uint64_t>(h + kAtOptionsHash),
            .surface_mode = (load_le<uint32_t>(h + kAtFlags) & kFlagSurfaceMode) != 0,
            .solid_volume = load_le<double>(h + kAtSolidVolume),
            .method = static_cast<Method>(load_le<uint8_t>(h + kAtMethod)),
            .primitive = static_cast<Primitive>(load_le<uint8_t>(h + kAtPrimitive)),
            .quality = static_cast<Quality>(load_le<uint8_t>(h + kAtQuality)),
            .alpha = load_le<float>(h + kAtAlpha),
            .beta = load_le<float>(h + kAtBeta),
            .tolerance = load_le<float>(h + kAtTolerance),
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
    return range.first < node_count_ ? range : ChildRange{};
}

} // namespace prolate
