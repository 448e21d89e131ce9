#include "builder/skinned_mesh.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace prolate {
namespace {

using Share = SkinnedMesh::Share;

// Of vertex `v` as read: what moves it, by rising bones.
std::vector<Share> shares_of(const BoneWeights& weights, uint32_t v) {
    std::vector<Share> out;
    for (size_t i = size_t{v} * weights.each; i < (size_t{v} + 1) * weights.each; ++i)
        if (weights.weights[i] != 0) out.push_back({weights.indices[i], weights.weights[i], 0});
    std::sort(out.begin(), out.end(), [](const Share& a, const Share& b) { return a.bone < b.bone; });
    double sum = 0;
    for (const Share& s : out) sum += double{s.weight};
    for (Share& s : out) s.share = double{s.weight} / sum;
    return out;
}

// The vertex's row by itself; nullptr if it is sound.
const char* fault_of(const BoneWeights& weights, uint32_t v) {
    double sum = 0;
    for (size_t i = size_t{v} * weights.each; i < (size_t{v} + 1) * weights.each; ++i) {
        if (!(weights.weights[i] >= 0 && std::isfinite(weights.weights[i])))
            return "vertex has a weight that is below 0 or not finite; repair the weights";
        if (weights.weights[i] != 0 && weights.indices[i] >= weights.bones)
            return "vertex is moved by a bone that does not exist; give as many bones as the weights name";
        sum += double{weights.weights[i]};
    }
    if (!(std::abs(sum - 1) <= kWeightTolerance))
        return "vertex has weights that do not add up to 1; normalise the weights";
    const std::vector<Share> shares = shares_of(weights, v);
    const auto same = [](const Share& a, const Share& b) { return a.bone == b.bone; };
    if (std::adjacent_find(shares.begin(), shares.end(), same) != shares.end())
        return "vertex has two weights for one bone; add them up";
    return nullptr;
}

Result<void> check_weights(MeshView mesh, const BoneWeights& weights) {
    if (weights.bones < 1 || weights.bones > kMaxBones)
        return Error{ErrorCode::bad_options, "a skin has 1 to 1024 bones", weights.bones};
    if (weights.each < 1 || weights.each > kMaxInfluences)
        return Error{ErrorCode::bad_options, "a vertex is moved by 1 to 8 bones; drop its least weights", weights.each};
    const size_t vertices = mesh.vertices.size(), count = vertices * weights.each;
    if (weights.weights.size() != count || weights.indices.size() != count)
        return Error{ErrorCode::bad_mesh,
                     "the weights are of another number of vertices than the mesh; give a row for each vertex as it is "
                     "read",
                     vertices};
    for (uint32_t v = 0; v < vertices; ++v)
        if (const char* const fault = fault_of(weights, v)) return Error{ErrorCode::bad_mesh, fault, v};
    return {};
}

} // namespace

SkinnedMesh::SkinnedMesh(MovingMesh mesh, const BoneWeights& weights) : mesh_(std::move(mesh)), bones_(weights.bones) {
    for (uint32_t v = 0; v < mesh_.vertices().size(); ++v) {
        const std::vector<Share> own = shares_of(weights, mesh_.source(v));
        shares_.insert(shares_.end(), own.begin(), own.end());
        first_.push_back(shares_.size());
    }
}

Result<SkinnedMesh> SkinnedMesh::of(const TreeView& tree, MeshView mesh, const BoneWeights& weights) {
    if (const auto sound = check_weights(mesh, weights); !sound) return sound.error();
    auto moving = MovingMesh::of(tree, mesh, [&weights](uint32_t v, uint32_t w) {
        const std::vector<Share> of_v = shares_of(weights, v), of_w = shares_of(weights, w);
        return std::equal(of_v.begin(), of_v.end(), of_w.begin(), of_w.end(),
                          [](const Share& a, const Share& b) { return a.bone == b.bone && a.share == b.share; });
    });
    if (!moving) return moving.error();
    return SkinnedMesh(std::move(*moving), weights);
}

uint32_t SkinnedMesh::most_shares() const {
    size_t most = 1;
    for (size_t v = 0; v + 1 < first_.size(); ++v) most = std::max(most, first_[v + 1] - first_[v]);
    return static_cast<uint32_t>(most);
}

} // namespace prolate
