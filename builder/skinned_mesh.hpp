// A mesh with its bones' weights, as a tree of it stands for it.
#pragma once

#include "builder/moving_mesh.hpp"

#include <prolate/rig.hpp>

#include <span>
#include <vector>

namespace prolate {

class SkinnedMesh {
public:
    /// Fails as add_skin() does, but for what it says of a tree that has a skin.
    static Result<SkinnedMesh> of(const TreeView& tree, MeshView mesh, const BoneWeights& weights);

    /// A bone that moves a vertex; its share of the sum of weights, as queries have it, is above 0.
    struct Share {
        uint32_t bone;
        float weight;
        double share;
    };

    const MovingMesh& mesh() const { return mesh_; }
    uint32_t bone_count() const { return bones_; }
    /// Most bones of a vertex.
    uint32_t most_shares() const;
    /// Of one of the mesh's vertices(), by rising bones.
    std::span<const Share> shares(uint32_t vertex) const {
        return std::span(shares_).subspan(first_[vertex], first_[vertex + 1] - first_[vertex]);
    }

private:
    SkinnedMesh(MovingMesh mesh, const BoneWeights& weights);

    MovingMesh mesh_;
    uint32_t bones_;
    std::vector<Share> shares_;
    std::vector<size_t> first_{0};
};

} // namespace prolate
