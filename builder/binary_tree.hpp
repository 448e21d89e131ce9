// A binary tree over a mesh's triangles, down to single ones: the raw material of an exact tree.
#pragma once

#include "builder/eigen.hpp"

#include <prolate/mesh.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <numbers>
#include <span>
#include <vector>

namespace prolate {

inline constexpr uint32_t kParallelAbove = 512; ///< triangles of a node whose children are worth tasks of their own

/// How far points reach along the axes and the face diagonals: loops over lanes, which compilers vectorise.
class Extents {
public:
    Extents() { reach_.fill(-HUGE_VALF), reach_[kUnused] = reach_[kDown + kUnused] = 0; }
    void add(const Vec3& p) {
        const float heights[] = {p.x, p.y, p.z, p.x + p.y, p.x - p.y, p.y + p.z, p.y - p.z, p.z + p.x, p.z - p.x};
        for (size_t d = 0; d < std::size(heights); ++d) {
            reach_[d] = std::max(reach_[d], heights[d]);
            reach_[kDown + d] = std::max(reach_[kDown + d], -heights[d]);
        }
    }
    void add(const Extents& e) {
        for (size_t i = 0; i < reach_.size(); ++i) reach_[i] = reach_[i] < e.reach_[i] ? e.reach_[i] : reach_[i];
    }
    Vec center() const { return {middle(0), middle(1), middle(2)}; }
    double squared_width() const {
        constexpr float kDiagonal = std::numbers::sqrt2_v<float> / 2;
        constexpr float kWeight[8] = {1, 1, 1, kDiagonal, kDiagonal, kDiagonal, kDiagonal, kDiagonal};
        const auto extent = [this](size_t d) { return reach_[d] + reach_[kDown + d]; };
        float sum[4];
        for (size_t d = 0; d < 4; ++d) sum[d] = kWeight[d] * extent(d) + kWeight[4 + d] * extent(4 + d);
        const double width = double{sum[0] + sum[1]} + (sum[2] + sum[3]) + kDiagonal * extent(8);
        return width * width;
    }

private:
    static constexpr size_t kUnused = 9, kDown = 10; // up along each direction first, then down, as negative numbers
    double middle(size_t d) const { return 0.5 * (double{reach_[d]} - reach_[kDown + d]); }

    std::array<float, 20> reach_;
};

/// Made in parallel, and the same for any number of threads. O(n log n) time, O(n) memory. A part is split in two
/// through the order of the boxes' centers along an axis, principal or world, where it makes the sum of costs least:
///
///     cost = n w^2,   w = mean width of the part in the 3 directions of the axes and the 6 of their face diagonals
///
/// The chance that another body meets a convex one grows with its surface (the surface area heuristic, Goldsmith and
/// Salmon 1987), and a nearly round body's surface with its mean width squared; running widths cost nothing.
class BinaryTree {
public:
    static constexpr size_t kMostAxes = 6;
    struct Part {
        uint32_t begin, end; ///< of the order of triangles
        uint32_t size() const { return end - begin; }
    };
    /// Depth first: the left child is the next, the right child comes after the 2 left - 1 nodes below and with the
    /// left one. So subtrees can be made in parallel, and children come after their parents.
    struct Node {
        Part part;
        uint32_t left = 0;        ///< triangles in the left child; 0 for a single triangle
        double squared_width = 0; ///< of its Extents
    };

    /// Tries the first `axes` of kMostAxes: the principal ones, longest first, and the world's. At most 2^(kMaxLevels -
    /// 1) triangles, so that it has no more levels than a file may have. `report` is called, from many threads, for
    /// each triangle that is come down to.
    BinaryTree(MeshView mesh, size_t axes, std::function<void()> report);

    std::span<const Node> nodes() const { return nodes_; }
    static uint32_t left_of(uint32_t node) { return node + 1; }
    uint32_t right_of(uint32_t node) const { return node + 2 * nodes_[node].left; }
    /// The node's triangles, as indices into the mesh's.
    std::span<const uint32_t> triangles(uint32_t node) const {
        return std::span(order_).subspan(nodes_[node].part.begin, nodes_[node].part.size());
    }

private:
    uint32_t cut_sorted(const Part& p, uint64_t most);
    uint32_t cut_binned(const Part& p, uint64_t most);
    void reorder(const Part& p, std::span<const uint32_t> from);
    Extents split(uint32_t index, const Part& p, uint32_t levels);

    const size_t axes_;
    const std::function<void()> report_;
    std::vector<uint32_t> order_;  // of the triangles: a node's are consecutive
    std::vector<Extents> extents_; // of the triangles, in this order
    std::vector<Node> nodes_;
};

} // namespace prolate
