// verify_modes(): decoded bounds against every vertex.
//
// Rounding: y = L^-1 (U - d) by forward substitution is the exact solution for a factor of which each entry is wrong by
// 3 u relatively (Higham, Accuracy and Stability of Numerical Algorithms, theorem 8.5), so |L y - (U - d)| is below 8 u
// |L| |y|. That residual is found in double precision and, as an error of y, costs |L^-1| times as much: with axis
// ratios up to kMaxAxisRatio, 2^14, less than 2^-34 |y|, which kSolving pays for.
#include <prolate/modes.hpp>

#include "builder/modal_mesh.hpp"
#include "src/deformation.hpp"

#include <cmath>
#include <new>
#include <optional>

namespace prolate {
namespace {

constexpr double kSolving = 0x1p-33; // of the radial length

// L^-1 x.
Vec solve(const Ellipsoid& e, const Vec& x) {
    const double u = x.x() / e.l11, v = (x.y() - e.l21 * u) / e.l22;
    return {u, v, (x.z() - e.l31 * u - e.l32 * v) / e.l33};
}

bool displacements_agree(const TreeView& tree, const Deformation& stored, const ModalMesh& mesh) {
    const std::vector<uint32_t> witnesses = mesh.mesh().witnesses();
    if (stored.point_count() != witnesses.size()) return false;
    for (uint32_t p = 0; p < stored.point_count(); ++p) {
        const uint32_t v = witnesses[p];
        if (!tree.has_triangles() && stored.point(p) != mesh.mesh().vertices()[v]) return false;
        for (uint32_t m = 0; m < mesh.mode_count(); ++m)
            if (stored.displacement(p, m) != mesh.displacement(v, m)) return false;
    }
    return true;
}

Result<ModesProof> prove(const TreeView& tree, MeshView mesh, const Modes& modes) {
    const std::optional<Deformation> stored = tree.deformation();
    if (!stored) return Error{ErrorCode::unsupported, "the tree has no deformation; bake it with its modes", 0};
    const auto moving = ModalMesh::of(tree, mesh, modes);
    if (!moving) return moving.error();
    bool same = stored->mode_count() == moving->mode_count();
    for (uint32_t m = 0; same && m < stored->mode_count(); ++m) same = stored->range(m) == moving->range(m);
    if (!same) return Error{ErrorCode::bad_options, "the tree was baked with other modes or ranges", 0};
    if (!displacements_agree(tree, *stored, *moving)) return ModesProof{};
    ModesProof proof{.proved = true};
    moving->mesh().for_each_node(tree, [&](uint32_t node, std::span<const uint32_t> vertices) {
        const Ellipsoid bound = tree.bound(node);
        for (uint32_t m = 0; m < stored->mode_count(); ++m) {
            const Deformation::Motion motion = stored->motion(node, m);
            const Vec shift(motion.shift[0], motion.shift[1], motion.shift[2]);
            for (const uint32_t v : vertices) {
                const Vec rest = to_vec(moving->displacement(v, m)) - shift;
                if (rest.norm() * (1 + kSolving) <= motion.radius) continue;
                if (solve(bound, rest).norm() * (1 + kSolving) <= motion.growth) continue;
                if (proof.proved) proof = {.proved = false, .node = node, .mode = m};
            }
        }
    });
    return proof;
}

} // namespace

Result<ModesProof> verify_modes(const TreeView& tree, MeshView mesh, const Modes& modes) {
    try {
        return prove(tree, mesh, modes);
    } catch (const std::bad_alloc&) {
        return Error{ErrorCode::out_of_memory, "there is not enough memory", 0};
    }
}

} // namespace prolate
