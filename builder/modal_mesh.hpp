// A mesh with its modes, as a tree of it stands for it.
#pragma once

#include "builder/moving_mesh.hpp"

#include <prolate/modes.hpp>

namespace prolate {

class ModalMesh {
public:
    /// Fails as add_modes() does, but for what it says of a tree that has a deformation. `modes` must outlive it.
    static Result<ModalMesh> of(const TreeView& tree, MeshView mesh, const Modes& modes);

    const MovingMesh& mesh() const { return mesh_; }
    uint32_t mode_count() const { return static_cast<uint32_t>(modes_.ranges.size()); }
    float range(uint32_t mode) const { return modes_.ranges[mode]; }
    /// Of the mesh's vertices().
    Vec3 displacement(uint32_t vertex, uint32_t mode) const {
        return displacement_of(modes_, mesh_.source(vertex), mode);
    }

private:
    static Vec3 displacement_of(const Modes& modes, uint32_t vertex, uint32_t mode) {
        const size_t vertices = modes.displacements.size() / (3 * modes.ranges.size());
        const float* const u = modes.displacements.data() + 3 * (mode * vertices + vertex);
        return {u[0], u[1], u[2]};
    }
    ModalMesh(MovingMesh mesh, const Modes& modes) : mesh_(std::move(mesh)), modes_(modes) {}

    MovingMesh mesh_;
    Modes modes_;
};

} // namespace prolate
