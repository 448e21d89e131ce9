#include "builder/gltf_rig.hpp"

#include "builder/job.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

namespace prolate {
namespace {

using Rows = GltfDocument::Rows;

constexpr size_t kSets = kMaxInfluences / 4; // JOINTS_0, WEIGHTS_0 and on, of four numbers

std::string name_of(const GltfValue& value, const std::string& otherwise) {
    return value.has("name") ? value["name"].text() : otherwise;
}

// Where the inverse of a matrix, column by column, takes (0, 0, 0).
Vec3 origin_of_inverse(const double* m) {
    const auto cofactor = [m](size_t i, size_t k) { // of entry (k, i): this is entry (i, k) of the adjugate
        const size_t r = (k + 1) % 3, s = (k + 2) % 3, c = (i + 1) % 3, d = (i + 2) % 3;
        return m[4 * c + r] * m[4 * d + s] - m[4 * d + r] * m[4 * c + s];
    };
    const double determinant = m[0] * cofactor(0, 0) + m[4] * cofactor(1, 0) + m[8] * cofactor(2, 0);
    double out[3];
    for (size_t i = 0; i < 3; ++i)
        out[i] = -(cofactor(i, 0) * m[12] + cofactor(i, 1) * m[13] + cofactor(i, 2) * m[14]) / determinant;
    const bool sound = std::all_of(out, out + 3, [](double x) { return std::abs(x) <= double{kLargestCoordinate}; });
    if (!sound) return {}; // a matrix without an inverse says nothing of its joint
    return {static_cast<float>(out[0]), static_cast<float>(out[1]), static_cast<float>(out[2])};
}

} // namespace

void GltfRig::begin(const GltfValue& node, const GltfValue& mesh) {
    skinned_ = node.has("skin");
    (skinned_ ? skinned_at_ : unskinned_at_) = node["mesh"].place();
    if (skinned_) begin_skin(node["skin"]);
    begin_morphs(node, mesh);
}

void GltfRig::begin_skin(const GltfValue& index) {
    const GltfValue skin = document_.named("skins", index), joints = skin["joints"];
    joints_ = static_cast<uint32_t>(joints.size());
    const auto [found, is_new] = bones_before_.try_emplace(index.whole(), static_cast<uint32_t>(out_.bones.size()));
    first_bone_ = found->second;
    if (!is_new) return;
    if (joints.size() < 1) joints.fail("a skin without joints");
    if (out_.bones.size() + joints.size() > kMaxBones) joints.fail("more than 1024 joints");
    for (uint64_t i = 0; i < joints.size(); ++i)
        out_.bones.push_back(name_of(document_.named("nodes", joints.element(i)), "joint " + std::to_string(i)));
    add_parents(joints);
    out_.joints.resize(out_.bones.size()); // where there are no matrices, they are the identity
    if (!skin.has("inverseBindMatrices")) return;
    const std::vector<double> bind = document_.rows(skin["inverseBindMatrices"], Rows::mat4);
    if (bind.size() / 16 < joints.size()) skin["inverseBindMatrices"].fail("fewer matrices than joints");
    if (!std::all_of(bind.begin(), bind.end(), [](double x) { return std::isfinite(x); }))
        skin["inverseBindMatrices"].fail("a matrix that is not finite");
    for (size_t i = 0; i < joints.size(); ++i) out_.joints[first_bone_ + i] = origin_of_inverse(&bind[16 * i]);
}

void GltfRig::add_parents(const GltfValue& joints) {
    const GltfValue nodes = document_.root()["nodes"];
    std::vector<uint64_t> above(nodes.size(), nodes.size()); // of each node; of a root none
    for (uint64_t n = 0; n < nodes.size(); ++n)
        if (const GltfValue node = nodes.element(n); node.has("children"))
            for (uint64_t c = 0; c < node["children"].size(); ++c)
                if (const uint64_t child = node["children"].element(c).whole(); child < nodes.size()) above[child] = n;
    std::map<uint64_t, uint32_t> bones;
    for (uint64_t i = 0; i < joints.size(); ++i)
        bones.emplace(joints.element(i).whole(), first_bone_ + static_cast<uint32_t>(i));
    for (uint64_t i = 0; i < joints.size(); ++i) {
        const uint32_t own = first_bone_ + static_cast<uint32_t>(i);
        uint64_t at = above[joints.element(i).whole()];
        // No more steps than there are nodes: what is above may be a circle.
        for (uint64_t steps = 0; at < nodes.size() && !bones.contains(at) && steps < nodes.size(); ++steps)
            at = above[at];
        const auto parent = at < nodes.size() ? bones.find(at) : bones.end();
        out_.parents.push_back(parent == bones.end() ? own : parent->second);
    }
}

// Modes of the mesh's targets; all its primitives have as many.
void GltfRig::begin_morphs(const GltfValue& node, const GltfValue& mesh) {
    modes_before_ = out_.modes.size(), target_count_ = 0;
    const GltfValue primitives = mesh["primitives"];
    for (uint64_t i = 0; i < primitives.size(); ++i) {
        const GltfValue primitive = primitives.element(i);
        const size_t count = primitive.has("targets") ? primitive["targets"].size() : 0;
        if (i > 0 && count != target_count_) primitive.fail("primitives of a mesh that differ in morph targets");
        target_count_ = count;
    }
    if (target_count_ == 0) return;
    if (modes_before_ + target_count_ > kMaxModes) mesh.fail("more than 64 morph targets");
    const GltfValue& holder = node.has("weights") ? node : mesh;
    const std::vector<double> weights =
        holder.has("weights") ? holder["weights"].numbers(target_count_) : std::vector<double>(target_count_);
    const std::string name = name_of(mesh, "mesh");
    const bool named = mesh.has("extras") && mesh["extras"].has("targetNames") &&
                       mesh["extras"]["targetNames"].size() == target_count_;
    for (size_t k = 0; k < target_count_; ++k) {
        out_.modes.push_back(named ? mesh["extras"]["targetNames"].element(k).text()
                                   : name + " target " + std::to_string(k));
        out_.ranges.push_back(static_cast<float>(std::max(1.0, std::abs(weights[k]))));
    }
}

std::string GltfRig::movers(const GltfValue& primitive) {
    std::string out = "moved by ";
    const GltfValue attributes = primitive["attributes"];
    for (const char* name : {"JOINTS_0", "WEIGHTS_0", "JOINTS_1", "WEIGHTS_1"})
        out += attributes.has(name) ? std::to_string(attributes[name].whole()) + ' ' : "- ";
    for (uint64_t k = primitive.has("targets") ? primitive["targets"].size() : 0; k-- > 0;) {
        const GltfValue target = primitive["targets"].element(k);
        out += target.has("POSITION") ? std::to_string(target["POSITION"].whole()) + ' ' : "- ";
    }
    return out;
}

void GltfRig::add(const GltfValue& primitive, size_t first, size_t count, const Affine& transform) {
    if (skinned_) add_weights(primitive, first, count);
    if (target_count_ > 0) add_targets(primitive, first, count, transform);
}

// For now kMaxInfluences of each point.
void GltfRig::add_weights(const GltfValue& primitive, size_t first, size_t count) {
    const GltfValue attributes = primitive["attributes"];
    if (attributes.has("JOINTS_2")) attributes["JOINTS_2"].fail("more than eight joints a vertex; export with fewer");
    if (!attributes.has("JOINTS_0")) attributes.fail("a skinned mesh without joints");
    out_.indices.resize((first + count) * kMaxInfluences);
    out_.weights.resize((first + count) * kMaxInfluences);
    Checkpoints checkpoint;
    for (size_t set = 0; set < kSets; ++set) {
        const std::string number = std::to_string(set), joints_name = "JOINTS_" + number,
                          weights_name = "WEIGHTS_" + number;
        if (!attributes.has(joints_name.c_str())) break;
        const GltfValue at = attributes[joints_name.c_str()];
        const auto joints = document_.rows(at, Rows::vec4),
                   weights = document_.rows(attributes[weights_name.c_str()], Rows::vec4);
        if (joints.size() != 4 * count || weights.size() != 4 * count)
            at.fail("joints and weights of another number of vertices than the positions");
        for (size_t i = 0; i < joints.size(); ++i) {
            checkpoint();
            const size_t to = (first + i / 4) * kMaxInfluences + 4 * set + i % 4;
            out_.weights[to] = static_cast<float>(weights[i]);
            if (weights[i] == 0) continue; // its joint means nothing
            if (!(joints[i] >= 0 && joints[i] < joints_ && joints[i] == std::floor(joints[i])))
                at.fail("a vertex names a joint that the skin does not have");
            out_.indices[to] = static_cast<uint16_t>(first_bone_ + static_cast<uint32_t>(joints[i]));
        }
    }
    for (size_t i = 0; i < count; ++i) { // add_skin() asks, too, but after a bake
        const float* const row = &out_.weights[(first + i) * kMaxInfluences];
        if (const double sum = std::accumulate(row, row + kMaxInfluences, 0.0);
            !(std::abs(sum - 1) <= kWeightTolerance))
            throw GltfFailure{"a vertex whose weights do not add up to 1; normalise them",
                              attributes["WEIGHTS_0"].place() + ", row " + std::to_string(i)};
    }
}

void GltfRig::add_targets(const GltfValue& primitive, size_t first, size_t count, const Affine& transform) {
    Affine turn = transform; // displacements are not moved
    for (auto& row : turn.m) row[3] = 0;
    const GltfValue targets = primitive["targets"];
    for (uint64_t k = 0; k < targets.size(); ++k) {
        const GltfValue target = targets.element(k);
        if (!target.has("POSITION")) continue;
        Target own{modes_before_ + static_cast<size_t>(k), first, document_.rows(target["POSITION"], Rows::vec3)};
        if (own.displacements.size() != 3 * count)
            target["POSITION"].fail("a morph target of another number of vertices than the positions");
        for (size_t i = 0; i < own.displacements.size(); i += 3) {
            const Point turned = turn({own.displacements[i], own.displacements[i + 1], own.displacements[i + 2]});
            std::copy(turned.begin(), turned.end(), own.displacements.begin() + static_cast<ptrdiff_t>(i));
        }
        targets_.push_back(std::move(own));
    }
}

void GltfRig::finish(size_t points) {
    if (!skinned_at_.empty() && !unskinned_at_.empty())
        throw GltfFailure{"a mesh without a skin, beside skinned ones; bind it to a joint, or leave it out",
                          unskinned_at_};
    if (out_.bones.empty() && out_.modes.empty())
        throw GltfFailure{"the file has neither skins nor morph targets; bake it without --skin", ""};
    out_.displacements.assign(3 * points * out_.modes.size(), 0.0f);
    for (const Target& target : targets_)
        for (size_t i = 0; i < target.displacements.size(); ++i)
            out_.displacements[3 * (target.mode * points + target.first) + i] =
                static_cast<float>(target.displacements[i]);
    if (out_.bones.empty()) return;
    out_.weights_each = kMaxInfluences;
    const auto fits = [this](uint32_t each) { // no point has a weight beyond
        for (size_t i = 0; i < out_.weights.size(); ++i)
            if (i % kMaxInfluences >= each && out_.weights[i] != 0) return false;
        return true;
    };
    if (!fits(4)) return;
    for (size_t i = 0; i < 4 * points; ++i) {
        const size_t from = i / 4 * kMaxInfluences + i % 4;
        out_.indices[i] = out_.indices[from], out_.weights[i] = out_.weights[from];
    }
    out_.weights_each = 4;
    out_.indices.resize(4 * points), out_.weights.resize(4 * points);
}

} // namespace prolate
