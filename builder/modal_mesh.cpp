#include "builder/modal_mesh.hpp"

#include <cmath>
#include <utility>

namespace prolate {
namespace {

Error bad_modes(const char* what, uint64_t where) {
    return {ErrorCode::bad_mesh, what, where};
}

// Are the numbers by themselves such that a deformation can be made of them?
Result<void> check_modes(MeshView mesh, const Modes& modes) {
    const size_t m = modes.ranges.size(), vertices = mesh.vertices.size();
    if (m < 1 || m > kMaxModes) return Error{ErrorCode::bad_options, "a body deforms by 1 to 64 modes", m};
    for (size_t i = 0; i < m; ++i)
        if (!(modes.ranges[i] > 0 && std::isfinite(modes.ranges[i])))
            return Error{ErrorCode::bad_options, "the range of a mode must be finite and above 0", i};
    if (modes.displacements.size() != 3 * m * vertices)
        return bad_modes("the modes are of another number of vertices, or modes, than the mesh and the ranges; give a "
                         "displacement for each vertex as it is read",
                         vertices);
    for (size_t i = 0; i < modes.displacements.size(); ++i) {
        const float x = modes.displacements[i];
        if (!std::isfinite(x))
            return bad_modes("vertex displacement is not finite; repair the modes", i / 3 % vertices);
        if (std::abs(double{x}) * modes.ranges[i / (3 * vertices)] > double{kLargestCoordinate})
            return bad_modes("vertex moves beyond 1.9e22 m (2^74); give a smaller range", i / 3 % vertices);
    }
    return {};
}

} // namespace

Result<ModalMesh> ModalMesh::of(const TreeView& tree, MeshView mesh, const Modes& modes) {
    if (const auto sound = check_modes(mesh, modes); !sound) return sound.error();
    auto moving = MovingMesh::of(tree, mesh, [&modes](uint32_t v, uint32_t w) {
        for (uint32_t m = 0; m < modes.ranges.size(); ++m)
            if (displacement_of(modes, v, m) != displacement_of(modes, w, m)) return false;
        return true;
    });
    if (!moving) return moving.error();
    return ModalMesh(std::move(*moving), modes);
}

} // namespace prolate
