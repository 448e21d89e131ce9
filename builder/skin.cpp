// add_skin(): for each node and bone, a ball around the corners that the bone moves, and how much their weights vary.
// The mean weight is the middle of the least and the greatest, so that the spread is least; then all are made to add up
// to 1, and rounded, and spreads measured from the rounded ones.
#include <prolate/rig.hpp>

#include "builder/ball.hpp"
#include "builder/skinned_mesh.hpp"
#include "src/bytes.hpp"
#include "src/format.hpp"
#include "src/skin.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <new>
#include <numeric>
#include <utility>
#include <vector>

namespace prolate {
namespace {

// Radii are this much larger than measured, relatively: far more than the proof asks for.
constexpr double kBallMargin = 1e-12;

struct NodeBone {
    uint32_t bone = 0, weight = 0, spread = 0; // in kWeightSteps
    Vec3 center = {};
    float radius = 0;
};

// What a bone does to the corners of a node.
struct Gathered {
    std::vector<Vec> points;
    double least = 1, greatest = 0; // of the shares of the points
};

// In kWeightSteps, in proportion to `parts`, and exactly 1 in sum: what rounding down leaves goes to the largest.
std::vector<uint32_t> divided(const std::vector<double>& parts) {
    const double all = std::accumulate(parts.begin(), parts.end(), 0.0);
    std::vector<uint32_t> out;
    uint32_t left = kWeightSteps;
    for (const double part : parts) {
        out.push_back(std::min(left, static_cast<uint32_t>(part / all * kWeightSteps)));
        left -= out.back();
    }
    const auto largest = std::max_element(parts.begin(), parts.end()) - parts.begin();
    out[static_cast<size_t>(largest)] += left;
    return out;
}

class Influences {
public:
    Influences(const TreeView& tree, const SkinnedMesh& skinned)
        : tree_(tree), skinned_(skinned), nodes_(tree.slot_count()) {
        skinned.mesh().for_each_node(tree, [this](uint32_t node, std::span<const uint32_t> vertices) {
            // A leaf deep in the solid stands for no surface, and goes where the nearest of it goes.
            const uint32_t nearest[] = {vertices.empty() ? nearest_vertex(node) : 0};
            nodes_[node] = of_node(vertices.empty() ? nearest : vertices);
        });
    }

    // The content of the section.
    std::vector<std::byte> content() const {
        const std::vector<uint32_t> points = skinned_.mesh().witnesses();
        const auto point_count = static_cast<uint32_t>(points.size());
        uint32_t count = 0;
        for (const auto& node : nodes_) count += static_cast<uint32_t>(node.size());
        const uint32_t weights = skinned_.most_shares();
        const bool exact = tree_.has_triangles();
        std::vector<std::byte> out(
            static_cast<size_t>(skin_bytes(tree_.slot_count(), count, point_count, weights, exact)));
        std::byte* to = out.data();
        const auto put = [&to](auto value) {
            store_le(to, value);
            to += sizeof value;
        };
        const auto put_point = [&put](const Vec3& p) { put(p.x), put(p.y), put(p.z); };
        put(skinned_.bone_count()), put(point_count), put(weights), put(count), put(uint64_t{0});
        uint32_t before = 0;
        put(before);
        for (const auto& node : nodes_) put(before += static_cast<uint32_t>(node.size()));
        for (const auto& node : nodes_)
            for (const NodeBone& of : node) {
                for (const uint32_t x : {of.bone, of.weight, of.spread, 0u}) put(static_cast<uint16_t>(x));
                put_point(of.center), put(of.radius);
            }
        if (!exact)
            for (const uint32_t v : points) put_point(skinned_.mesh().vertices()[v]);
        for (const uint32_t v : points) {
            const auto shares = skinned_.shares(v);
            for (uint32_t i = 0; i < weights; ++i) put(i < shares.size() ? shares[i].weight : 0.0f);
            for (uint32_t i = 0; i < weights; ++i) put(static_cast<uint16_t>(i < shares.size() ? shares[i].bone : 0));
        }
        return out;
    }

private:
    uint32_t nearest_vertex(uint32_t node) const {
        const Vec center = to_vec(tree_.bound(node).center);
        const auto vertices = skinned_.mesh().vertices();
        const auto nearer = [&](const Vec3& a, const Vec3& b) {
            return (to_vec(a) - center).squaredNorm() < (to_vec(b) - center).squaredNorm();
        };
        return static_cast<uint32_t>(std::min_element(vertices.begin(), vertices.end(), nearer) - vertices.begin());
    }

    std::vector<NodeBone> of_node(std::span<const uint32_t> vertices) const {
        std::map<uint32_t, Gathered> bones;
        for (const uint32_t v : vertices)
            for (const auto& [bone, weight, share] : skinned_.shares(v)) {
                Gathered& of = bones[bone];
                of.points.push_back(to_vec(skinned_.mesh().vertices()[v]));
                of.least = std::min(of.least, share), of.greatest = std::max(of.greatest, share);
            }
        std::vector<double> middles;
        for (auto& [bone, of] : bones) {
            if (of.points.size() < vertices.size()) of.least = 0;
            middles.push_back((of.least + of.greatest) / 2);
        }
        const std::vector<uint32_t> weights = divided(middles);
        std::vector<NodeBone> out;
        for (const auto& [bone, of] : bones) {
            NodeBone node{.bone = bone, .weight = weights[out.size()]};
            const double weight = node.weight / double{kWeightSteps};
            const double spread = std::max(of.greatest - weight, weight - of.least);
            node.spread = std::min(static_cast<uint32_t>(std::ceil(spread * kWeightSteps)), uint32_t{kWeightSteps});
            const Vec middle = middle_of(of.points);
            node.center = {static_cast<float>(middle.x()), static_cast<float>(middle.y()),
                           static_cast<float>(middle.z())};
            double radius = 0;
            for (const Vec& p : of.points) radius = std::max(radius, (p - to_vec(node.center)).norm());
            node.radius = round_up(radius * (1 + kBallMargin));
            out.push_back(node);
        }
        return out;
    }

    const TreeView& tree_;
    const SkinnedMesh& skinned_;
    std::vector<std::vector<NodeBone>> nodes_; // by slots
};

Result<Tree> with_skin(const TreeView& tree, MeshView mesh, const BoneWeights& weights) {
    if (tree.skin()) return Error{ErrorCode::unsupported, "the tree has a skin already; bake it anew", 0};
    const auto skinned = SkinnedMesh::of(tree, mesh, weights);
    if (!skinned) return skinned.error();
    std::vector<std::byte> file(tree.bytes().begin(), tree.bytes().end());
    format::append_section(file, kSkinKind, Influences(tree, *skinned).content());
    auto out = Tree::open(std::move(file));
    if (!out) return out.error();
    const auto proof = verify_skin(out->view(), mesh, weights);
    if (!proof) return proof.error();
    if (!proof->proved)
        return Error{ErrorCode::internal, "what bones do to a node could not be proved; please report this mesh",
                     proof->node};
    return out;
}

} // namespace

Result<Tree> add_skin(const TreeView& tree, MeshView mesh, const BoneWeights& weights) {
    try {
        return with_skin(tree, mesh, weights);
    } catch (const std::bad_alloc&) {
        return Error{ErrorCode::out_of_memory, "there is not enough memory", 0};
    }
}

} // namespace prolate
