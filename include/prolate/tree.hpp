// The ellipsoid tree: bytes of an .etree file, and a view that reads them in place.
//
// A tree of degree k is a hierarchy of ellipsoids. Level 0 is one ellipsoid around everything; the children of a node
// together cover the part of the solid that the node stands for. A *cut* takes the nodes of one level, plus the leaves
// above it; every cut covers the solid. A child need not lie inside its parent's ellipsoid.
//
// Nodes are stored in *blocks* of eight siblings, as the runtime tests them: one node against eight at once. A node's
// index is its *slot*, 8 * block + lane. The children of a node fill the lanes of blocks of their own from the first
// on; lanes that are left over hold no node, so slots are not consecutive from family to family: is_node() tells.
//
// An *exact* tree also holds the triangles of its mesh, a few in each leaf. Its ellipsoids cover these triangles, not
// what they enclose, and only cull; queries answer as the triangles do. These are the triangles as clean() leaves them
// (mesh.hpp): where it joined vertices that nearly met, they stand up to the weld tolerance from where the file has
// them.
//
// The bytes are the object: open() checks them once, allocates nothing, and every later access is memory-safe and
// finite whatever the bytes hold. src/FORMAT.md is the normative description.
#pragma once

#include <prolate/error.hpp>
#include <prolate/types.hpp>

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

namespace prolate {

inline constexpr uint32_t kMaxDegree = 64; ///< children per node, at most
inline constexpr uint32_t kMaxLevels = 32; ///< levels including the root, at most
inline constexpr uint32_t kBlockLanes = 8; ///< nodes that a block has room for
inline constexpr size_t kBlockBytes = 256; ///< bytes of one block in the file
inline constexpr size_t kHullBytes = 64;   ///< bytes of one hull record in the file

/// Absolute value of a vertex' coordinate, metres, at most: build(), verify() and open() refuse meshes beyond it. Two
/// things set it. The coarsest lattice, of 2^16 steps of 2^60 m, holds the centers of nodes; and queries multiply up to
/// twelve lengths (a triple product's factor of edges and normals, squared), none of which exceeds the diameter 2^76,
/// so that all stays below 2^912, within a double.
inline constexpr float kLargestCoordinate = 0x1p74f; // 1.9e22

/// Triangles in a leaf of an exact tree, at most.
inline constexpr uint32_t kMaxLeafTriangles = 127;

/// How E_vol was evaluated (paper, section 3.2).
enum class Method : uint8_t { voxel = 0, analytic = 1 };
/// What the nodes are.
enum class Primitive : uint8_t { ellipsoid = 0, sphere = 1 };
/// Effort of the bake.
enum class Quality : uint8_t { fast = 0, normal = 1, best = 2 };

/// What the file says of its own making.
struct BakeInfo {
    uint64_t source_hash = 0;  ///< hash(MeshView) of the cleaned mesh
    uint64_t options_hash = 0; ///< hash of the options and of the builder's version, see hash(BuildOptions)
    bool surface_mode = false; ///< true: the mesh was open, and only its triangles are guaranteed covered
    bool exact = false;        ///< an exact tree: only the triangles are covered, and stored beside the nodes
    bool proved = false;       ///< the cover of every level was proved, after quantisation, before the file was written
    bool goal_reached = true;  ///< false: the asked count, tolerance or distance could not be met
    double solid_volume = 0;   ///< of the solid, cubic metres; 0 where there is no inside, and of exact open meshes
    float solid_volume_error = 0; ///< of solid_volume, relative; found as LevelFigures::outside_ratio_error is
    double diagonal = 0;          ///< of the mesh's bounding box, metres
    Method method = Method::voxel;
    Primitive primitive = Primitive::ellipsoid;
    Quality quality = Quality::normal;
    float alpha = 0, beta = 0; ///< weights of E_sur^3 and E_vol (paper, eq. 3)
    float tolerance = 0;       ///< asked outside ratio, 0 = not asked
    float distance = 0;        ///< asked Hausdorff distance, in % of the diagonal, 0 = not asked
    uint32_t levels = 0;       ///< asked levels below the root, 0 = not asked
    uint32_t ellipsoids = 0;   ///< asked leaves, 0 = not asked
    uint64_t seed = 0;         ///< of the surface sampling
    uint32_t resolution = 0;   ///< voxels along the longest side
    Placement placement;       ///< of the mesh in the frame of its file: answers are relative to its origin
    float weld = -1;           ///< asked tolerance for vertices that nearly meet, metres; below 0: the default
};

/// How close one level's cut is to the mesh, as measured on the decoded nodes when it was baked. NaN is unknown: ratios
/// have no meaning where the solid has no volume. Lengths in metres, volumes in cubic metres. The file rounds all but
/// union_volume to floats.
struct LevelFigures {
    static constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

    double outside_ratio = kUnknown; ///< volume of (union of the cut \ solid) / volume of the solid
    /// Of outside_ratio, absolute. Lengths along z are exact, so the error is that of the quadrature over a lattice of
    /// columns in x and y. This is how far the outside volume moves, at most, if only one of the four interleaved
    /// lattices of twice the pitch is used, plus two of the longest columns; and the same for the solid's volume. It is
    /// an estimate and no strict bound, but on the large side: usually several times the true error.
    double outside_ratio_error = kUnknown;
    double sum_outside_ratio = kUnknown; ///< sum of the single ellipsoids' outside volumes / volume of the solid
    double union_volume = kUnknown;      ///< of the cut
    double surface_error = kUnknown;     ///< largest E_sur of the cut (paper, eq. 1)
    /// No point of the cover is farther from the solid (of an open mesh: from its triangles): the one-sided Hausdorff
    /// distance, too large by at most 0.01 % of the diagonal (quality fast: 0.1 %).
    double hausdorff_max = kUnknown;
    double hausdorff_mean = kUnknown; ///< the same distance, on average over the cover's surface, to about 1 %
    double hausdorff_p99 = kUnknown;  ///< 99 % of the cover's surface is at most so far from the solid
};

/// One level of the tree.
struct LevelInfo : LevelFigures {
    uint32_t first_slot = 0;  ///< of its first node: slots first_slot ... first_slot + kBlockLanes * block_count - 1
    uint32_t block_count = 0; ///< blocks of this level
    uint32_t node_count = 0;  ///< nodes of this level
    uint64_t end_byte = 0;    ///< the file's first end_byte bytes are a valid tree that ends with this level
};

/// The lattice that the nodes' centers lie on: center_i = (origin_i + q_i) * 2^step_exponent metres, q_i as stored.
struct LatticeInfo {
    int32_t origin[3] = {};    ///< |origin_i + q_i| < 2^24: an integer that a float holds exactly
    int32_t step_exponent = 0; ///< -120 ... 60
};

/// Children of a node: slots first ... first + count - 1, all of them nodes. A leaf has count 0.
struct ChildRange {
    uint32_t first = 0;
    uint32_t count = 0;
};

/// Triangles of a leaf: indices first ... first + count - 1.
struct TriangleRange {
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
    /// Accepts a whole file, or a prefix that ends exactly where a level ends (a coarser tree, without triangles).
    /// Fails with bad_file or newer_version; `where` is the byte offset of the first offence. Allocates nothing.
    static Result<TreeView> open(std::span<const std::byte> bytes, const OpenOptions& options = {}) noexcept;

    uint32_t node_count() const noexcept { return node_count_; }
    uint32_t block_count() const noexcept { return block_count_; }
    /// Slots of nodes lie below this: kBlockLanes * block_count(). The root's is 0.
    uint32_t slot_count() const noexcept { return kBlockLanes * block_count_; }
    /// Does `slot` < slot_count() hold a node?
    bool is_node(uint32_t slot) const noexcept;
    /// Levels present, the root included: at least 1, at most kMaxLevels.
    uint32_t level_count() const noexcept { return level_count_; }
    /// True if the bytes are a prefix of a longer file.
    bool is_prefix() const noexcept { return is_prefix_; }
    /// Largest number of children of a node, 2 ... kMaxDegree.
    uint32_t degree() const noexcept;
    /// `l` < level_count().
    LevelInfo level(uint32_t l) const noexcept;
    /// First slot of level `l` < level_count().
    uint32_t first_slot(uint32_t l) const noexcept;
    /// The level whose blocks hold slot `slot` < slot_count().
    uint32_t level_of(uint32_t slot) const noexcept;
    BakeInfo bake_info() const noexcept;
    /// BakeInfo::surface_mode
    bool surface_mode() const noexcept;
    std::span<const std::byte> bytes() const noexcept { return bytes_; }
    LatticeInfo lattice() const noexcept { return lattice_; }
    /// The kBlockBytes bytes of block `b` < block_count(), a structure of arrays (src/FORMAT.md): nodes b * kBlockLanes
    /// and following. Aligned to 64 bytes if the tree's bytes are. In a prefix, the last level's nodes may still count
    /// children, which are not there: children() knows.
    const std::byte* block(uint32_t b) const noexcept { return blocks_ + size_t{b} * kBlockBytes; }

    /// The block as queries of the whole tree take it: the same nodes, but in a tree without triangles the ellipsoid
    /// and the box of an inner node hold those of all nodes below it. Its own ellipsoid does not: it approximates the
    /// part of the solid that the node stands for, out of which those below stick in other places.
    const std::byte* bounding_block(uint32_t b) const noexcept {
        return (b < bounding_count_ ? bounding_blocks_ : blocks_) + size_t{b} * kBlockBytes;
    }

    /// The ellipsoid of `node`, exactly as stored: every float is an integer times a power of two. Here and below, a
    /// node is a slot for which is_node() holds.
    Ellipsoid ellipsoid(uint32_t node) const noexcept;
    /// ellipsoid(0), which holds the solid.
    const Ellipsoid& root() const noexcept { return root_; }
    /// The ellipsoid in bounding_block(): of a leaf, its own; of an inner node, it holds all leaves below, or if
    /// has_triangles() all triangles.
    Ellipsoid bound(uint32_t node) const noexcept;
    /// The children of `node`; none for a leaf, and none for the last level of a prefix.
    ChildRange children(uint32_t node) const noexcept;
    bool is_leaf(uint32_t node) const noexcept { return children(node).count == 0; }

    /// The kHullBytes bytes (src/FORMAT.md) that tell in what polytope the triangles below an inner node lie, if
    /// has_triangles(): `b` is the block of the node's first child.
    const std::byte* hull(uint32_t b) const noexcept { return hulls_ + size_t{b} * kHullBytes; }

    /// True for an exact tree that is no prefix: each leaf then has 1 ... kMaxLeafTriangles triangles, and each
    /// triangle belongs to one leaf. Without triangles the counts below are 0.
    bool has_triangles() const noexcept { return vertices_ != nullptr; }
    uint32_t triangle_count() const noexcept { return triangle_count_; }
    uint32_t vertex_count() const noexcept { return vertex_count_; }
    /// Vertices 0 ... component_count() - 1 are one of each part of the surface that hangs together: what a point-in-
    /// solid test needs to tell whether one solid holds a part of another whose surface it does not meet.
    uint32_t component_count() const noexcept { return component_count_; }
    /// Triangles of `node`; none for an inner node.
    TriangleRange triangles(uint32_t node) const noexcept;
    /// Vertex indices of triangle `t` < triangle_count(), in the mesh's order: counter-clockwise seen from outside.
    Triangle triangle(uint32_t t) const noexcept;
    /// Position of vertex `v` < vertex_count(), the mesh's own float coordinates, metres.
    Vec3 vertex(uint32_t v) const noexcept;
    /// The bytes of all vertices, three floats each, and of all triangles, three vertex indices each, of two bytes if
    /// vertex_count() <= 65536, else of four; little-endian, without alignment (src/FORMAT.md).
    const std::byte* vertex_bytes() const noexcept { return vertices_; }
    const std::byte* triangle_bytes() const noexcept { return triangles_; }

    /// Calls visit(node) for each node of level `l`, in order of slots.
    template <class Visit> void for_each_node(uint32_t l, Visit&& visit) const {
        const LevelInfo at = level(l);
        for_each_node_in(at.first_slot, at.first_slot + kBlockLanes * at.block_count, visit);
    }
    /// Calls visit(node) for each node, in order of slots: parents before their children.
    template <class Visit> void for_each_node(Visit&& visit) const { for_each_node_in(0, slot_count(), visit); }
    /// Calls visit(node) for each node of the cut at `l`: the nodes of that level and the leaves above it.
    template <class Visit> void for_each_in_cut(uint32_t l, Visit&& visit) const {
        for_each_node_in(0, level(l).first_slot, [&](uint32_t node) {
            if (is_leaf(node)) visit(node);
        });
        for_each_node(l, visit);
    }

private:
    TreeView() = default;
    template <class Visit> void for_each_node_in(uint32_t begin, uint32_t end, Visit&& visit) const {
        for (uint32_t slot = begin; slot < end; ++slot)
            if (is_node(slot)) visit(slot);
    }
    std::span<const std::byte> bytes_;
    const std::byte* blocks_ = nullptr;
    const std::byte* bounding_blocks_ = nullptr; // of blocks 0 ... bounding_count_ - 1
    uint32_t bounding_count_ = 0;
    const std::byte* hulls_ = nullptr; // null without triangles
    LatticeInfo lattice_;
    Ellipsoid root_;
    uint32_t node_count_ = 0;
    uint32_t block_count_ = 0;
    uint32_t level_count_ = 0;
    bool is_prefix_ = false;
    const std::byte* vertices_ = nullptr;  // null without triangles
    const std::byte* triangles_ = nullptr; // vertex indices, three each
    uint32_t vertex_count_ = 0;
    uint32_t triangle_count_ = 0;
    uint32_t component_count_ = 0;
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
/// temporary file beside it, fsync, rename. Symbolic links are followed. An existing target that is not a regular file
/// (a pipe, /dev/stdout) is written directly. Fails with io; `where` is then errno.
Result<void> save(const char* path, std::span<const std::byte> bytes);

} // namespace prolate
