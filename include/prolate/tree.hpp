// The ellipsoid tree: the bytes of an .etree file, and a view that reads them in place.
//
// A tree of degree k is a hierarchy of ellipsoids. Level 0 is a single ellipsoid around everything. A *cut* at a level
// consists of its nodes and the leaves above it. Every cut covers the solid. A node's children are near it, but need
// neither lie in it nor cover what it covers: nodes of several levels do not add up to a cover.
//
// An *exact* tree also holds the triangles of its mesh, a few in each leaf. Its ellipsoids cover these triangles but
// not what they enclose. They only cull; queries answer for the triangles. These are the triangles as clean() leaves
// them (mesh.hpp): vertices that it joined are up to the weld tolerance away from where the file has them.
//
// Nodes are stored in *blocks* of eight siblings, because the runtime tests one node against eight at once. A node's
// index is its *slot*, 8 * block + lane. The children of a node fill the lanes of their own blocks from the first lane
// on. Lanes that are left over hold no node, so there are gaps between the slots of different families; is_node() tells
// which slots are nodes.
//
// The file's bytes are the tree: open() checks them once and allocates nothing, and every later access is memory-safe
// and yields finite numbers, whatever the bytes hold. src/FORMAT.md is the normative description.
//
// The idea is that of S. Liu, C. C. L. Wang, G. Brunnett, J. Wang, "Approximating Solid Objects by Ellipsoid-Tree",
// 11th IEEE International Conference on Computer-Aided Design and Computer Graphics, 2009.
#pragma once

#include <prolate/bake_info.hpp>
#include <prolate/deformation.hpp>
#include <prolate/detail/tree_bytes.hpp>
#include <prolate/error.hpp>
#include <prolate/skin.hpp>
#include <prolate/types.hpp>

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

namespace prolate {

inline constexpr uint32_t kMaxDegree = 64;         ///< most children of a node
inline constexpr uint32_t kMaxLevels = 32;         ///< most levels of a tree, the root included
inline constexpr uint32_t kMaxLeafTriangles = 127; ///< most triangles in a leaf of an exact tree
inline constexpr uint32_t kBlockLanes = 8;         ///< nodes that a block has room for

/// Largest absolute value of a vertex coordinate, metres. build(), verify() and open() refuse meshes beyond it.
// Two things set it. The coarsest lattice, of 2^16 steps of 2^60 m, holds the centers of nodes. And queries multiply up
// to twelve lengths (a triple product's factor of edges and normals, squared), none above the diameter 2^76, so that
// all products stay below 2^912, within a double.
inline constexpr float kLargestCoordinate = 0x1p74f; // 1.9e22

/// One level of the tree.
struct LevelInfo : LevelFigures {
    uint32_t first_slot = 0;  ///< of its first node: slots first_slot ... first_slot + kBlockLanes * block_count - 1
    uint32_t block_count = 0; ///< blocks of this level
    uint32_t node_count = 0;  ///< nodes of this level
    uint64_t end_byte = 0;    ///< the file's first end_byte bytes are a valid tree that ends with this level
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

/// What follows the tree in its file (src/FORMAT.md, "Sections").
struct Section {
    char kind[4];                       ///< printable; "INNR": an inner cover, "DFRM": a deformation, "SKIN"
    std::span<const std::byte> content; ///< of the file's bytes
};

/// How open() checks.
struct OpenOptions {
    /// Compare the content hashes, which finds every accidental change of a byte. Without, open() takes less time, and
    /// queries are still memory-safe and finite.
    bool check_hash = true;
};

/// Borrowed, read-only tree over bytes that the caller keeps alive. Cheap to copy. Safe to share between threads.
class TreeView {
public:
    /// Checks `bytes` and returns a view of them. The bytes need no alignment and may come from an untrusted source.
    /// Accepts a whole file, or a prefix that ends exactly where a level ends (a coarser tree, without triangles).
    /// Fails with bad_file or newer_version; `where` is the byte offset of the first offence. Allocates nothing.
    static Result<TreeView> open(std::span<const std::byte> bytes, const OpenOptions& options = {}) noexcept;

    /// The same tree, but queries see it `scale` times as large as it is stored, about its frame's origin: as
    /// certified, because products of two floats are exact in double precision. A power of two costs no bit of any
    /// answer. It is a view of the same bytes. Fails with bad_options if `scale` is not finite and above 0, or the tree
    /// would leave the format's range (src/FORMAT.md, "Known limits").
    Result<TreeView> scaled(float scale) const noexcept;
    /// What queries multiply all lengths by; 1 unless it comes from scaled(). All numbers below are as stored.
    float scale() const noexcept { return raw_.lattice().scale; }

    /// The same tree, but a body for queries is all that lies within `radius`, metres, of it (after scaled()): capsules
    /// of segments, balls of points (primitives.hpp), boxes with round edges. As certified as without, and exact but
    /// for the rounding of floats, 1e-7 of the radius. Fails with bad_options if it is not finite, or negative.
    Result<TreeView> rounded(float radius) const noexcept;
    /// What it was rounded by; 0 unless it comes from rounded().
    float radius() const noexcept { return radius_; }

    /// The tree that ends with level `last`: what the prefix of the file is that ends there. The same tree if `last` is
    /// its last level or beyond. Of a tree without triangles every level is a cover by itself, so queries of a coarser
    /// tree are as certified, and cost less. It has no triangles and no sections. A view of the same bytes.
    TreeView coarser(uint32_t last) const noexcept;

    /// The *inner cover*, if the file holds one: a tree whose ellipsoids, those of all nodes, lie inside the solid. It
    /// is scaled and rounded like this tree. bake_info().inner is true of it. solids.hpp asks about both covers. Takes
    /// about as long as one ellipsoid takes to decode.
    std::optional<TreeView> inner() const noexcept;

    /// How the mesh deforms by modes, and what that does to the nodes, if the file says it: deform.hpp asks about
    /// bodies that deform. All other queries answer for the body at rest. Lengths are as stored, before scaled().
    std::optional<Deformation> deformation() const noexcept;
    /// How bones move the mesh, and which of them each node, likewise.
    std::optional<Skin> skin() const noexcept;

    /// Version of the format that the bytes are in.
    uint16_t format_version() const noexcept;
    /// Sections of the file, those included whose kind this library does not know. Queries that do not need a section
    /// answer without it. A prefix has none.
    uint32_t section_count() const noexcept { return section_count_; }
    Section section(uint32_t s) const noexcept; ///< `s` < section_count()

    uint32_t node_count() const noexcept { return node_count_; }
    uint32_t block_count() const noexcept { return block_count_; }
    /// All slots are below this: kBlockLanes * block_count(). The root's slot is 0.
    uint32_t slot_count() const noexcept { return kBlockLanes * block_count_; }
    /// Does `slot` < slot_count() hold a node?
    bool is_node(uint32_t slot) const noexcept;
    /// Levels present, the root included: 1 ... kMaxLevels.
    uint32_t level_count() const noexcept { return level_count_; }
    /// True if the bytes are a prefix of a longer file.
    bool is_prefix() const noexcept { return is_prefix_; }
    /// Largest number of children that a node may have, 2 ... kMaxDegree.
    uint32_t degree() const noexcept;
    /// Facts about level `l` < level_count().
    LevelInfo level(uint32_t l) const noexcept;
    /// First slot of level `l` < level_count().
    uint32_t first_slot(uint32_t l) const noexcept;
    /// The level that slot `slot` < slot_count() belongs to.
    uint32_t level_of(uint32_t slot) const noexcept;

    // In what follows, a node is a slot for which is_node() holds.

    /// The ellipsoid of `node`, exactly as stored: every float is an integer times a power of two.
    Ellipsoid ellipsoid(uint32_t node) const noexcept;
    /// ellipsoid(0), which holds the solid.
    const Ellipsoid& root() const noexcept { return root_; }
    /// An ellipsoid that holds all leaf ellipsoids below `node`, or if has_triangles() all triangles. Of a leaf, its
    /// own.
    Ellipsoid bound(uint32_t node) const noexcept;
    /// bound(0), with which queries begin.
    const Ellipsoid& root_bound() const noexcept { return root_bound_; }
    /// The children of `node`; none for a leaf, and none for the last level of a prefix.
    ChildRange children(uint32_t node) const noexcept;
    bool is_leaf(uint32_t node) const noexcept { return children(node).count == 0; }

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

    /// True for an exact tree that is no prefix: each leaf then has 1 ... kMaxLeafTriangles triangles, and each
    /// triangle belongs to one leaf. Without triangles, the counts below are 0.
    bool has_triangles() const noexcept { return raw_.vertices() != nullptr; }
    uint32_t triangle_count() const noexcept { return triangle_count_; }
    uint32_t vertex_count() const noexcept { return vertex_count_; }
    /// Number of connected parts of the surface. Vertices 0 ... component_count() - 1 lie in one part each. A test
    /// whether one solid holds a part of another whose surface it does not meet needs to look at no other vertices.
    uint32_t component_count() const noexcept { return component_count_; }
    /// Triangles of `node`; none for an inner node.
    TriangleRange triangles(uint32_t node) const noexcept;
    /// Vertex indices of triangle `t` < triangle_count(), in the mesh's order: counter-clockwise seen from outside.
    Triangle triangle(uint32_t t) const noexcept;
    /// Position of vertex `v` < vertex_count(), the mesh's own float coordinates, metres.
    Vec3 vertex(uint32_t v) const noexcept;

    /// How the tree was baked.
    BakeInfo bake_info() const noexcept;
    /// BakeInfo::surface_mode and BakeInfo::exact.
    bool surface_mode() const noexcept;
    bool is_exact() const noexcept;

    /// What was opened: the bytes of the file, or of its prefix.
    std::span<const std::byte> bytes() const noexcept { return bytes_; }
    /// The same, for the runtime to decode in place. Internal.
    const detail::TreeBytes& raw() const noexcept { return raw_; }

private:
    TreeView() = default;
    Result<void> open_nodes(uint32_t present, bool exact, bool check_hash) noexcept;
    Result<void> open_triangles(size_t hulls, bool check_hash) noexcept;
    Result<void> open_sections(size_t begin, bool check_hash) noexcept;
    Result<void> open_inner(std::span<const std::byte> content, size_t at, bool check_hash) noexcept;
    Result<void> open_deformation(std::span<const std::byte> content, size_t at) noexcept;
    Result<void> open_skin(std::span<const std::byte> content, size_t at) noexcept;
    static TreeView of_checked(std::span<const std::byte> bytes) noexcept;
    void count_levels(uint32_t count) noexcept;
    void find_root() noexcept;
    template <class Visit> void for_each_node_in(uint32_t begin, uint32_t end, Visit&& visit) const {
        for (uint32_t slot = begin; slot < end; ++slot)
            if (is_node(slot)) visit(slot);
    }
    std::span<const std::byte> bytes_;
    std::span<const std::byte> inner_; // the file of the inner cover; empty without
    std::span<const std::byte> modes_; // the section of the deformation; empty without
    std::span<const std::byte> skin_;  // that of the skin
    size_t sections_ = 0;              // where they begin
    detail::TreeBytes raw_;
    Ellipsoid root_, root_bound_;
    uint32_t node_count_ = 0;
    uint32_t block_count_ = 0;
    uint32_t level_count_ = 0;
    bool is_prefix_ = false;
    uint32_t section_count_ = 0;
    uint32_t vertex_count_ = 0;
    uint32_t triangle_count_ = 0;
    uint32_t component_count_ = 0;
    float radius_ = 0;
};

/// A tree that owns its bytes. Can be moved, but not copied.
class Tree {
public:
    /// Takes over `bytes` after checking them as TreeView::open() does.
    static Result<Tree> open(std::vector<std::byte> bytes, const OpenOptions& options = {});
    Tree(Tree&&) = default; // moving a vector keeps its buffer, so the view stays valid
    Tree& operator=(Tree&&) = default;
    Tree(const Tree&) = delete;
    Tree& operator=(const Tree&) = delete;

    /// The same bytes, of which view() is rounded() by `radius`. The bytes know nothing of it.
    Result<Tree> rounded(float radius) &&;

    TreeView view() const noexcept { return view_; }
    std::span<const std::byte> bytes() const noexcept { return bytes_; }

private:
    Tree(std::vector<std::byte> bytes, TreeView view) : bytes_(std::move(bytes)), view_(view) {}
    std::vector<std::byte> bytes_;
    TreeView view_;
};

/// Reads a whole .etree file. Fails with io, bad_file or newer_version.
Result<Tree> load(const char* path);

/// Writes `bytes` to `path` so that an interruption at any moment leaves the old file or the new one, never a part:
/// temporary file beside it, fsync, rename. Symbolic links are followed. An existing target that is not a regular file
/// (a pipe, /dev/stdout) is written directly. Fails with io; `where` is then errno.
Result<void> save(const char* path, std::span<const std::byte> bytes);

} // namespace prolate
