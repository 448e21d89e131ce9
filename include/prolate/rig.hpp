// From a tree and the weights of its mesh's vertices to a tree that bones move (skin.hpp), and the proof of it; and the
// rigs of glTF files: their skins and morph targets.
#pragma once

#include <prolate/mesh.hpp>
#include <prolate/modes.hpp>
#include <prolate/tree.hpp>

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

namespace prolate {

/// The weights of a vertex may differ from 1 in sum by this much: bytes and short floats are rounded. It is each one's
/// share of the sum that counts.
inline constexpr double kWeightTolerance = 0.01;

/// How bones move a mesh of V vertices, those of the mesh as it was read, before clean(). Borrowed.
struct BoneWeights {
    uint32_t bones = 0; ///< 1 ... kMaxBones
    uint32_t each = 0;  ///< of a vertex, 1 ... kMaxInfluences
    /// V by `each`, row by row: which bones, and how much; at least 0, the sum of a row 1 but for kWeightTolerance.
    std::span<const uint16_t> indices;
    std::span<const float> weights;
};

/// What verify_skin() found.
struct SkinProof {
    bool proved = false;
    // If not: of which node the bound fails, by which bone; or 0, where stored weights are other ones.
    uint32_t node = 0, bone = 0;
};

/// The same tree with its skin, proved as verify_skin() does. `mesh` is what `tree` was baked from, in the pose in
/// which all matrices are the identity. Vertices in one place must have the same weights. Cost: as many passes over the
/// vertices as the tree has levels. The same bytes everywhere. Fails with bad_options for another number of bones or
/// weights than BoneWeights says; with bad_mesh for another mesh, weights of another count, below 0 or not finite, or
/// that do not add up to 1, a bone that does not exist (`where` is the vertex), or vertices in one place that move
/// apart (likewise); with unsupported for a prefix, a tree that has a skin, one of a filled mesh, and a mesh of which
/// welding moved vertices; with out_of_memory. Thread-safe.
Result<Tree> add_skin(const TreeView& tree, MeshView mesh, const BoneWeights& weights);

/// Proves a tree's skin from its bytes, the mesh and the weights: for every corner of every triangle that a node stands
/// for, that it lies in the ball of each bone that moves it, and that its weights are within the spreads, as all of
/// these decode; and that stored weights are those given. That the tree covers at rest is for verify() to prove. Fails
/// as add_skin() does, and with bad_options for another number of bones. Thread-safe.
Result<SkinProof> verify_skin(const TreeView& tree, MeshView mesh, const BoneWeights& weights);

/// A mesh with all that moves it.
struct RiggedMesh {
    Mesh mesh;
    std::vector<std::string> bones; ///< names of the joints, by number; none if the file has no skin
    std::vector<uint32_t> parents;  ///< the bone of the nearest joint above each one's, or itself if there is none
    std::vector<Vec3> joints;       ///< where each joint is in the bind pose, metres
    uint32_t weights_each = 0;
    std::vector<uint16_t> indices;
    std::vector<float> weights;
    std::vector<std::string> modes;   ///< names of the morph targets
    std::vector<float> displacements; ///< as in Modes, in the mesh's frame
    std::vector<float> ranges;

    BoneWeights skin() const noexcept { return {static_cast<uint32_t>(bones.size()), weights_each, indices, weights}; }
    Modes morphs() const noexcept { return {displacements, ranges}; }
};

/// Reads a glTF or GLB as load_mesh() does: the same mesh, which is that of the bind pose, in its base shape. Its bones
/// are the joints of all skins that meshes use, skin by skin; at an animation's time the matrix of bone b is the
/// joint's world matrix times its inverse bind matrix (where the mesh was scaled or moved, P times that times P^-1, P:
/// from the file's coordinates to the mesh's). Its modes are the morph targets of each mesh that has some, in the order
/// in which nodes are read; the range of each is 1, or what the mesh's own weight is, if that is more.
///
/// Fails as load_mesh() does; and with bad_file for a file of another kind, or one without a skin and morph targets,
/// for a mesh without a skin beside skinned ones, and for skins, weights and targets that the specification does not
/// allow. `report->detail` says where. Thread-safe.
Result<RiggedMesh> load_rigged_mesh(const char* path, const ImportOptions& options = {}, ImportReport* report = nullptr,
                                    const std::function<bool()>& go_on = {});

} // namespace prolate
