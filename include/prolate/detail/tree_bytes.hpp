// The bytes of a tree as the runtime reads them. Internal: programs use TreeView (tree.hpp), and nothing here is part
// of the stable interface.
#pragma once

#include <cstddef>
#include <cstdint>

namespace prolate {

class TreeView;

inline constexpr size_t kBlockBytes = 256; ///< bytes of one block in the file
inline constexpr size_t kHullBytes = 64;   ///< bytes of one hull record in the file

/// The lattice that the nodes' centers lie on: center_i = (origin_i + q_i) * 2^step_exponent metres, q_i as stored,
/// in 32nds.
struct LatticeInfo {
    int32_t origin[3] = {};    ///< |origin_i + q_i| < 2^24, and a float holds the sum exactly
    int32_t step_exponent = 0; ///< -112 ... 60
    float scale = 1;           ///< TreeView::scale(): queries see all lengths so many times as large
};

namespace detail {

/// A ball and a box about one center that hold all leaf ellipsoids, or if TreeView::has_triangles() all triangles: what
/// queries ask first. Metres, as stored, not rounded outward: double precision, and queries pay for that.
struct RootVolume {
    double center[3] = {}, radius = 0; ///< of the ball
    double half[3] = {};               ///< sides of the box, halved
    double reach = 0;                  ///< no point of the ball is farther from the origin
};

/// Pointers into the bytes that TreeView::open() has checked; src/FORMAT.md describes what they point at.
class TreeBytes {
public:
    LatticeInfo lattice() const noexcept { return lattice_; }

    /// The kBlockBytes bytes of block `b` < TreeView::block_count(), a structure of arrays: nodes b * kBlockLanes and
    /// following. Aligned to 64 bytes if the tree's bytes are. In a prefix, the last level's nodes may still count
    /// children that are not there: TreeView::children() knows.
    const std::byte* block(uint32_t b) const noexcept { return blocks_ + size_t{b} * kBlockBytes; }

    /// The block as queries of the whole tree take it: the same nodes, but in a tree without triangles the ellipsoid
    /// and the box of an inner node hold those of all nodes below it. Its own ellipsoid does not: it approximates the
    /// part of the solid that the node stands for, and nodes below stick out of it elsewhere.
    const std::byte* bounding_block(uint32_t b) const noexcept {
        return (b < bounding_count_ ? bounding_blocks_ : blocks_) + size_t{b} * kBlockBytes;
    }

    /// Found by open(). Of triangles the box is the smallest, and the ball the smallest about its center; else both are
    /// the smallest around root_bound(), the ball within 4 %.
    const RootVolume& root() const noexcept { return root_; }

    /// Of a tree with triangles: the kHullBytes bytes of the polytope that holds the triangles below an inner node.
    /// `b` is the block of the node's first child.
    const std::byte* hull(uint32_t b) const noexcept { return hulls_ + size_t{b} * kHullBytes; }

    /// Does any hull record have a slab (src/slab.hpp)?
    bool has_slabs() const noexcept { return has_slabs_; }

    /// Of a tree with triangles: all vertices, three floats each, and all triangles, three vertex indices each, of two
    /// bytes if vertex_count() <= 65536, else of four. Little-endian, without alignment.
    const std::byte* vertices() const noexcept { return vertices_; }
    const std::byte* triangles() const noexcept { return triangles_; }

private:
    friend TreeView;
    const std::byte* blocks_ = nullptr;
    const std::byte* bounding_blocks_ = nullptr; // of blocks 0 ... bounding_count_ - 1
    uint32_t bounding_count_ = 0;
    const std::byte* hulls_ = nullptr;     // null without triangles
    const std::byte* vertices_ = nullptr;  // null without triangles
    const std::byte* triangles_ = nullptr; // null without triangles
    bool has_slabs_ = false;
    LatticeInfo lattice_;
    RootVolume root_;
};

} // namespace detail
} // namespace prolate
