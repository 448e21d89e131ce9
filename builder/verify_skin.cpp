// verify_skin(): decoded balls and spreads against every vertex.
//
// Rounding: a distance is found within 4 u, relatively, which kDistances pays for; a share within 4 u of 1, which
// queries pay for (query/deform/skinning.hpp), because a node that one bone moves alone has no spread at all.
#include <prolate/rig.hpp>

#include "builder/skinned_mesh.hpp"
#include "src/skin.hpp"

#include <algorithm>
#include <cmath>
#include <new>
#include <optional>
#include <vector>

namespace prolate {
namespace {

constexpr double kDistances = 0x1p-50;

bool weights_agree(const TreeView& tree, const Skin& stored, const SkinnedMesh& skinned) {
    const std::vector<uint32_t> witnesses = skinned.mesh().witnesses();
    if (stored.point_count() != witnesses.size()) return false;
    for (uint32_t p = 0; p < stored.point_count(); ++p) {
        const uint32_t v = witnesses[p];
        if (!tree.has_triangles() && stored.point(p) != skinned.mesh().vertices()[v]) return false;
        const auto shares = skinned.shares(v);
        if (stored.weight_count() < shares.size()) return false;
        for (uint32_t i = 0; i < stored.weight_count(); ++i) {
            const Skin::Weight own = stored.weight(p, i);
            if (own.weight != (i < shares.size() ? shares[i].weight : 0)) return false;
            if (i < shares.size() && own.bone != shares[i].bone) return false;
        }
    }
    return true;
}

// Which bone of the node does not hold vertex `v`?
std::optional<uint32_t> fault_at(const std::vector<Skin::Influence>& node, const SkinnedMesh& skinned, uint32_t v) {
    const Vec x = to_vec(skinned.mesh().vertices()[v]);
    const auto shares = skinned.shares(v);
    size_t found = 0;
    for (const Skin::Influence& of : node) {
        const auto own =
            std::find_if(shares.begin(), shares.end(), [&of](const auto& share) { return share.bone == of.bone; });
        const double share = own == shares.end() ? 0 : own->share;
        if (!(std::abs(share - of.weight) <= of.spread)) return of.bone;
        if (own == shares.end()) continue;
        ++found;
        const Vec center(of.center[0], of.center[1], of.center[2]);
        if (!((x - center).norm() * (1 + kDistances) <= of.radius)) return of.bone;
    }
    if (found < shares.size()) return shares[0].bone; // one of them the node does not know
    return {};
}

Result<SkinProof> prove_skin(const TreeView& tree, MeshView mesh, const BoneWeights& weights) {
    const std::optional<Skin> stored = tree.skin();
    if (!stored) return Error{ErrorCode::unsupported, "the tree has no skin; bake it with one", 0};
    const auto skinned = SkinnedMesh::of(tree, mesh, weights);
    if (!skinned) return skinned.error();
    if (stored->bone_count() != weights.bones)
        return Error{ErrorCode::bad_options, "the tree was baked with another number of bones", 0};
    if (!weights_agree(tree, *stored, *skinned)) return SkinProof{};
    SkinProof proof{.proved = true};
    skinned->mesh().for_each_node(tree, [&](uint32_t node, std::span<const uint32_t> vertices) {
        std::vector<Skin::Influence> influences;
        for (uint32_t i = 0; i < stored->influence_count(node); ++i) influences.push_back(stored->influence(node, i));
        for (const uint32_t v : vertices)
            if (const auto bone = fault_at(influences, *skinned, v); bone && proof.proved)
                proof = {.proved = false, .node = node, .bone = *bone};
    });
    return proof;
}

} // namespace

Result<SkinProof> verify_skin(const TreeView& tree, MeshView mesh, const BoneWeights& weights) {
    try {
        return prove_skin(tree, mesh, weights);
    } catch (const std::bad_alloc&) {
        return Error{ErrorCode::out_of_memory, "there is not enough memory", 0};
    }
}

} // namespace prolate
