// A mesh that moves by modes, as a tree of it stands for it: which of its vertices each node has to hold.
#pragma once

#include "builder/eigen.hpp"

#include <prolate/modes.hpp>

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

namespace prolate {

class MovingMesh {
public:
    /// Fails as add_modes() does, but for what it says of a tree that has a deformation. `modes` must outlive it.
    static Result<MovingMesh> of(const TreeView& tree, MeshView mesh, const Modes& modes);

    /// The cleaned mesh; of an exact tree its own vertices, as it numbers them.
    std::span<const Vec3> vertices() const { return vertices_; }
    uint32_t mode_count() const { return static_cast<uint32_t>(modes_.ranges.size()); }
    float range(uint32_t mode) const { return modes_.ranges[mode]; }
    /// Of vertices().
    Vec3 displacement(uint32_t vertex, uint32_t mode) const {
        return input_displacement(modes_, source_[vertex], mode, input_vertices_);
    }
    /// One vertex of each connected part.
    std::vector<uint32_t> witnesses() const;

    /// Calls visit(node, vertices) for each node of the tree, children first: the corners of all triangles that meet
    /// the leaf ellipsoids below the node, or of an exact tree of those in these leaves; sorted.
    using Visit = std::function<void(uint32_t node, std::span<const uint32_t> vertices)>;
    void for_each_node(const TreeView& tree, const Visit& visit) const;

private:
    static Vec3 input_displacement(const Modes& modes, uint32_t vertex, uint32_t mode, size_t vertices) {
        const size_t at = 3 * (mode * vertices + vertex);
        return {modes.displacements[at], modes.displacements[at + 1], modes.displacements[at + 2]};
    }
    Result<void> find_sources(MeshView input);
    std::vector<uint32_t> visit_below(const TreeView& tree, uint32_t node, std::span<const uint32_t> candidates,
                                      const Visit& visit) const;
    std::vector<uint32_t> meeting(const Ellipsoid& ellipsoid, std::span<const uint32_t> candidates) const;

    Modes modes_;
    size_t input_vertices_ = 0;
    std::vector<Vec3> vertices_;
    std::vector<Triangle> triangles_;
    std::vector<uint32_t> source_; // of each vertex: one in the same place of the mesh as read
};

} // namespace prolate
