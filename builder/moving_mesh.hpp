// A mesh that moves, as a tree of it stands for it: which of its vertices each node has to hold.
#pragma once

#include "builder/eigen.hpp"

#include <prolate/mesh.hpp>
#include <prolate/tree.hpp>

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

namespace prolate {

class MovingMesh {
public:
    /// Do two vertices of the mesh as read, which are in one place, move alike?
    using Alike = std::function<bool(uint32_t, uint32_t)>;
    /// Fails with bad_mesh for another mesh than the tree's, or vertices in one place that do not move alike (`where`
    /// is one of them), and with unsupported, as add_modes() says.
    static Result<MovingMesh> of(const TreeView& tree, MeshView mesh, const Alike& alike);

    /// The cleaned mesh; of an exact tree its own vertices, as it numbers them.
    std::span<const Vec3> vertices() const { return vertices_; }
    /// Of one of vertices(): one in its place of the mesh as read.
    uint32_t source(uint32_t vertex) const { return source_[vertex]; }
    /// The vertices that the file's section describes: if the tree is exact, all, else one of each connected part.
    std::vector<uint32_t> witnesses() const;

    /// Calls visit(node, vertices) for each node of the tree, children first: the corners of all triangles that meet
    /// the leaf ellipsoids below the node, or of an exact tree of those in these leaves; sorted.
    using Visit = std::function<void(uint32_t node, std::span<const uint32_t> vertices)>;
    void for_each_node(const TreeView& tree, const Visit& visit) const;

private:
    Result<void> find_sources(MeshView input, const Alike& alike);
    std::vector<uint32_t> visit_below(const TreeView& tree, uint32_t node, std::span<const uint32_t> candidates,
                                      const Visit& visit) const;
    std::vector<uint32_t> meeting(const Ellipsoid& ellipsoid, std::span<const uint32_t> candidates) const;

    bool exact_ = false;
    std::vector<Vec3> vertices_;
    std::vector<Triangle> triangles_;
    std::vector<uint32_t> source_;
};

} // namespace prolate
