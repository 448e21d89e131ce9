// A hierarchy of boxes over the mesh's triangles: one tree for all that the builder asks of the surface - distances
// here, winding numbers in winding.hpp, the part in an ellipsoid in intersection.hpp.
#pragma once

#include "builder/eigen.hpp"
#include "builder/fit.hpp"

#include <prolate/mesh.hpp>

#include <array>
#include <span>
#include <vector>

namespace prolate {

class TriangleTree {
public:
    using Corners = std::array<Vec3, 3>; // as in the mesh: float holds them exactly, in half the memory

    struct Node {
        Box box;
        uint32_t begin, end; // of triangles()
        uint32_t right;      // second child; the first follows the node; 0 for a leaf
    };

    /// Halves the triangles at the median along the box's longest side. O(n log n), in parallel; the same tree
    /// everywhere, whatever the order of the mesh's triangles. An empty mesh is legal and is infinitely far away.
    explicit TriangleTree(MeshView mesh);

    /// Depth first, so that the root is the first and a subtree is contiguous. Empty for an empty mesh.
    std::span<const Node> nodes() const { return nodes_; }
    std::span<const Corners> triangles() const { return triangles_; }
    /// No path from the root is longer: a traversal's stack holds that many at most.
    static constexpr int kMaxDepth = 32;

    struct Nearest {
        double distance;
        Vec point;
    };
    /// The point of the triangles that is nearest to `p`, if it is nearer than `upper_bound`; if none is, the bound and
    /// `p` itself. The smaller the bound, the faster the answer. Exact up to rounding. O(log n) for points not equally
    /// far from many triangles. Thread-safe.
    Nearest nearest(const Vec& p, double upper_bound = HUGE_VAL) const;
    double distance(const Vec& p, double upper_bound = HUGE_VAL) const { return nearest(p, upper_bound).distance; }

    /// Visits the triangles that may meet the solid ellipsoid: inside(node index) for the topmost nodes that are wholly
    /// in it, triangle(corners) for each triangle of the leaves that may meet its surface. Nodes that are wholly
    /// outside are left out; a node is classified with a margin kMargin of the radial coordinate.
    template <class Inside, class EachTriangle>
    void visit(const Fit& ellipsoid, Inside&& inside, EachTriangle&& triangle) const;

private:
    static constexpr double kMargin = 1e-9;
    void build(uint32_t node, uint32_t begin, uint32_t end);

    std::vector<Corners> triangles_;
    std::vector<Node> nodes_;
};

template <class Inside, class EachTriangle>
void TriangleTree::visit(const Fit& ellipsoid, Inside&& inside, EachTriangle&& triangle) const {
    // In unit-ball coordinates y = L^-1 (x - center) a box is {y + sum of t_k half_k L^-1 e_k, |t_k| <= 1}. With
    // g = L^-T y its extent along y is e = sum of half_k |g_k|, and its half diagonal is at most the r below.
    const Mat& inverse = ellipsoid.inverse;
    const Mat gram = (inverse.transpose() * inverse).cwiseAbs();
    uint32_t stack[kMaxDepth];
    int top = 0;
    if (!nodes_.empty()) stack[top++] = 0;
    while (top > 0) {
        const uint32_t index = stack[--top];
        const Node& node = nodes_[index];
        const Vec half = 0.5 * node.box.size();
        const Vec y = ellipsoid.radial(node.box.center());
        const double radial = y.squaredNorm(), extent = half.dot((inverse.transpose() * y).cwiseAbs());
        // Outside, if the slab between the box and the plane across y that touches the ball is empty.
        if (const double near = radial - extent; near > 0 && near * near > radial * (1 + 2 * kMargin)) continue;
        // |y + z|^2 <= |y|^2 + 2 y.z + r^2
        const double nearly = radial + 2 * extent;
        if (nearly < 1 && nearly + half.dot(gram * half) < 1 - 2 * kMargin) {
            inside(index);
        } else if (node.right == 0) {
            for (uint32_t t = node.begin; t < node.end; ++t) triangle(triangles_[t]);
        } else {
            stack[top++] = node.right;
            stack[top++] = index + 1;
        }
    }
}

/// The point of the triangle a, b, c, which may be degenerate, that is nearest to `p`.
Vec nearest_point(const Vec& p, const Vec& a, const Vec& b, const Vec& c);

} // namespace prolate
