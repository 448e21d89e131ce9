// The skins and morph targets of a glTF's meshes, gathered while the scene is read (rig.hpp).
#pragma once

#include "builder/gltf_document.hpp"
#include "builder/polygons.hpp"

#include <prolate/rig.hpp>

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace prolate {

class GltfRig {
public:
    /// Fills in all of `out` but the mesh; displacements and joints are in the file's coordinates.
    GltfRig(GltfDocument& document, RiggedMesh& out) : document_(document), out_(out) {}

    /// The parts to come are those of this node's mesh.
    void begin(const GltfValue& node, const GltfValue& mesh);
    /// What says how the primitive's vertices move: equal words, equal motion.
    static std::string movers(const GltfValue& primitive);
    /// Points first ... first + count - 1 are those of `primitive`, placed by `transform`.
    void add(const GltfValue& primitive, size_t first, size_t count, const Affine& transform);
    /// All is read; there are so many points.
    void finish(size_t points);

private:
    struct Target { // of some points
        size_t mode, first;
        std::vector<double> displacements;
    };

    void begin_skin(const GltfValue& skin);
    void add_parents(const GltfValue& joints);
    void begin_morphs(const GltfValue& node, const GltfValue& mesh);
    void add_weights(const GltfValue& primitive, size_t first, size_t count);
    void add_targets(const GltfValue& primitive, size_t first, size_t count, const Affine& transform);

    GltfDocument& document_;
    RiggedMesh& out_;
    std::map<uint64_t, uint32_t> bones_before_; // by skin
    std::vector<Target> targets_;
    size_t modes_before_ = 0, target_count_ = 0; // of the mesh
    uint32_t first_bone_ = 0, joints_ = 0;
    bool skinned_ = false;
    std::string skinned_at_, unskinned_at_; // places of meshes
};

} // namespace prolate
