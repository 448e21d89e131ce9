// The ellipsoid tree: bytes of an .etree file, and a view that reads them in place.
//
// A tree of degree k is a hierarchy of ellipsoids. Level 0 is one ellipsoid around everything; the children of a node
// together cover the part of the solid that the node stands for. A *cut* takes the nodes of one level, plus the leaves
// above it; every cut covers the solid. A child need not lie inside its parent's ellipsoid.
//
// The bytes are the object: open() checks them once, allocates nothing, and every later access is memory-safe and
// finite whatever the bytes hold. src/FORMAT.md is the normative description.
#pragma once

#include <prolate/error.hpp>
#include <prolate/types.hpp>

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace prolate {

inline constexpr uint32_t kMaxDegree = 64; ///< children per node, at most
inline constexpr uint32_t kMaxLevels = 32; ///< levels including the root, at most
inline constexpr size_t kNodeBytes = 24;   ///< bytes of one node in the file

/// How E_vol was evaluated (paper, section 3.2).
enum class Method : uint8_t { voxel = 0, analytic = 1 };
/// What the nodes are.
enum class Primitive : uint8_t { ellipsoid = 0, sphere = 1 };
/// Effort of the bake.
enum class Quality : uint8_t { fast = 0, normal = 1, best = 2 };

/// What the file says of its own making.
struct BakeInfo {
    uint64_t source_hash = 0;  ///< hash(MeshView) of the cleaned mesh
    uint64_t options_hash = 0; ///< hash of the bake options, see hash(BuildOptions)
    bool surface_mode = false; ///< true: the mesh was open, and only its triangles are guaranteed covered
    double solid_volume = 0;   ///< volume of the solid, cubic metres; 0 where there is no inside
    Method method = Method::voxel;
    Primitive primitive = Primitive::ellipsoid;
    Quality quality = Quality::normal;
    float alpha = 0, beta = 0; ///< weights of E_sur^3 and E_vol (paper, eq. 3)
    float tolerance = 0;       ///< asked outside ratio, 0 = not asked
    uint32_t levels = 0;       ///< asked levels below the root, 0 = not asked
    uint32_t ellipsoids = 0;   ///< asked leaves, 0 = not asked
    uint64_t seed = 0;         ///< of the surface sampling
    uint32_t resolution = 0;   ///< voxels along the longest side
};

/// One level of the tree.
struct LevelInfo {
    uint32_t first_node = 0; ///< index of its first node
    uint32_t node_count = 0; ///< nodes of this level
    uint64_t end_byte = 0;   ///< the file's first end_byte bytes are a valid tree that ends with this level
    float outside_ratio = 0; ///< volume of (union of the cut \ solid) / volume of the solid, as baked; NaN if unknown
    float surface_error = 0; ///< largest E_sur of the cut (paper, eq. 1), metres
};

/// Children of a node: indices first ... first + count - 1. A leaf has count 0.
struct ChildRange {
    uint32_t first = 0;
    uint32_t count = 0;
};

/// How open() checks.
struct OpenOptions {
    /// Compare the content hashes: finds every accidental change of a byte. Off, open() costs less and still
    /// guarantees memory-safe, finite queries.
    bool check_hash = true;
};

/// Borrowed, read-only tree over bytes that the caller keeps alive. Cheap to copy. Safe to share between threads.
class TreeView {
public:
    /// Checks `bytes` and returns a view of them. Bytes need no alignment and may come from an untrusted source.
    /// Accepts a whole file, or a prefix that ends exactly where a level ends (a coarser tree).
    /// Fails with bad_file or newer_version; `where` is the byte offset of the first offence. Allocates nothing.
    static Result<TreeView> open(std::span<const std::byte> bytes, const OpenOptions& options = {}) noexcept;

    uint32_t node_count() const noexcept { return node_count_; }
    /// Levels present, the root included: at least 1, at most kMaxLevels.
    uint32_t level_count() const noexcept { return level_count_; }
    /// True if the bytes are a prefix of a longer file.
    bool is_prefix() const noexcept { return is_prefix_; }
    /// Largest number of children of a node, 2 ... kMaxDegree.
    uint32_t degree() const noexcept;
    /// `l` < level_count().
    LevelInfo level(uint32_t l) const noexcept;
    BakeInfo bake_info() const noexcept;
    std::span<const std::byte> bytes() const noexcept { return bytes_; }

    /// The ellipsoid of `node` < node_count(), exactly as stored: every float is an integer times a power of two.
    Ellipsoid ellipsoid(uint32_t node) const noexcept;
    /// The children of `node` < node_count(); none for a leaf, and none for the last level of a prefix.
    ChildRange children(uint32_t node) const noexcept;
    bool is_leaf(uint32_t node) const noexcept { return children(node).count == 0; }

    /// Calls visit(node) for each node of the cut at `l`: the nodes of that level and the leaves above it.
    template <class Visit> void for_each_in_cut(uint32_t l, Visit&& visit) const {
        const LevelInfo last = level(l);
        for (uint32_t node = 0; node < last.first_node + last.node_count; ++node)
            if (node >= last.first_node || is_leaf(node)) visit(node);
    }

private:
    TreeView() = default;
    std::span<const std::byte> bytes_;
    const std::byte* nodes_ = nullptr;
    int32_t origin_[3] = {};
    int32_t step_exponent_ = 0;
    uint32_t node_count_ = 0;
    uint32_t level_count_ = 0;
    bool is_prefix_ = false;
};

/// A tree that owns its bytes.
class Tree {
public:
    /// Takes over `bytes` after checking them as TreeView::open does.
    static Result<Tree> open(std::vector<std::byte> bytes, const OpenOptions& options = {});
    TreeView view() const noexcept { return view_; }
    std::span<const std::byte> bytes() const noexcept { return bytes_; }

private:
    Tree(std::vector<std::byte> bytes, TreeView view) : bytes_(std::move(bytes)), view_(view) {}
    std::vector<std::byte> bytes_; // moving a vector keeps its buffer, so the view stays valid; copying is not allowed
    TreeView view_;

public:
    Tree(Tree&&) = default;
    Tree& operator=(Tree&&) = default;
    Tree(const Tree&) = delete;
    Tree& operator=(const Tree&) = delete;
};

/// Reads a whole .etree file. Fails with io, bad_file or newer_version.
Result<Tree> load(const char* path);

/// Writes `bytes` to `path` so that an interruption at any moment leaves the old file or the new one, never a part:
/// temporary file beside it, fsync, rename. An existing target that is not a regular file (a pipe, /dev/stdout) is
/// written directly. Fails with io; `where` is then errno.
Result<void> save(const char* path, std::span<const std::byte> bytes);

} // namespace prolate
