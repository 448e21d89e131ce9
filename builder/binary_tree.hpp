// A binary tree over a mesh's triangles, down to single ones: the raw material of an exact tree.
#pragma once

#include "builder/eigen.hpp"

#include <prolate/mesh.hpp>

#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

namespace prolate {

inline constexpr uint32_t kParallelAbove = 512; ///< triangles of a node whose children are worth tasks of their own

/// Of points along the axes and face diagonals.
struct Extents {
    static constexpr size_t kDirections = 9;
    std::array<float, kDirections> low, high;

    Extents() { low.fill(HUGE_VALF), high.fill(-HUGE_VALF); }
    void add(const Vec3& p) {
        const float heights[] = {p.x, p.y, p.z, p.x + p.y, p.x - p.y, p.y + p.z, p.y - p.z, p.z + p.x, p.z - p.x};
        for (size_t d = 0; d < kDirections; ++d)
            low[d] = std::min(low[d], heights[d]), high[d] = std::max(high[d], heights[d]);
    }
    void add(const Extents& e) {
        for (size_t d = 0; d < kDirections; ++d)
            low[d] = std::min(low[d], e.low[d]), high[d] = std::max(high[d], e.high[d]);
    }
    Vec center() const { return {0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), 0.5 * (low[2] + high[2])}; }
    double squared_width() const {
        double straight = 0, diagonal = 0;
        for (size_t d = 0; d < kDirections; ++d) (d < 3 ? straight : diagonal) += double{high[d]} - low[d];
        const double width = straight + std::numbers::sqrt2 / 2 * diagonal;
        return width * width;
    }
};

/// Made in parallel, and the same for any number of threads. O(n log n) time, O(n) memory. A part is split in two
/// through the order of the boxes' centers along an axis, world or principal, where it makes the sum of costs least:
///
///     cost = n w^2,   w = mean width of the part in the 3 directions of the axes and the 6 of their face diagonals
///
/// The chance that another body meets a convex one grows with its surface (the surface area heuristic, Goldsmith and
/// Salmon 1987), and a nearly round body's surface with its mean width squared; running widths cost nothing.
class BinaryTree {
public:
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

    /// At most 2^(kMaxLevels - 1) triangles, so that it has no more levels than a file may have. `report` is called,
    /// from many threads, for each triangle that is come down to.
    BinaryTree(MeshView mesh, std::function<void()> report);

    std::span<const Node> nodes() const { return nodes_; }
    static uint32_t left_of(uint32_t node) { return node + 1; }
    uint32_t right_of(uint32_t node) const { return node + 2 * nodes_[node].left; }
    /// The node's triangles, as indices into the mesh's.
    std::span<const uint32_t> triangles(uint32_t node) const {
        return std::span(order_).subspan(nodes_[node].part.begin, nodes_[node].part.size());
    }

private:
    // Where to cut a part in the order along an axis.
    struct Cut {
        double cost = HUGE_VAL; // of both sides together
        uint32_t left = 0;      // triangles on the lower side; 0: no cut found
    };
    struct Group {
        Extents extents;
        uint32_t triangles = 0;
    };
    using Key = std::pair<double, uint32_t>; // height of a triangle and its index: a total order

    std::vector<Key> keys(const Part& p, const Vec& axis) const;
    static Cut best_cut(std::span<const Group> groups);
    Cut cut_sorted(const Part& p, const Vec& axis) const;
    Cut cut_binned(const Part& p, const Vec& axis) const;
    std::array<Vec, 3> principal_axes(const Part& p) const;
    uint32_t cut(const Part& p, uint64_t most);
    Extents split(uint32_t index, const Part& p, uint32_t levels);

    const std::function<void()> report_;
    std::vector<Extents> extents_; // of each triangle
    std::vector<uint32_t> order_;  // of the triangles: a node's are consecutive
    std::vector<Node> nodes_;
};

} // namespace prolate
