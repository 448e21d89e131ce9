#include "src/skin.hpp"

#include "src/bytes.hpp"

#include <cassert>
#include <cmath>

namespace prolate {
namespace {

Error bad_skin(const char* what, uint64_t where) {
    return {ErrorCode::bad_file, what, where};
}

// Also false for a NaN.
bool is_coordinate(const std::byte* at) {
    return std::abs(load_le<float>(at)) <= kLargestCoordinate;
}

// The influences of a node: bones rise, weights add up to 1, all is in range.
Result<void> check_influences(std::span<const std::byte> content, size_t at, uint32_t count, uint32_t bones) {
    uint32_t sum = 0, next = 0;
    for (const size_t end = at + size_t{count} * kInfluenceBytes; at < end; at += kInfluenceBytes) {
        const std::byte* const row = content.data() + at;
        const auto bone = load_le<uint16_t>(row + kInfluenceBone);
        if (bone < next || bone >= bones) return bad_skin("a node names a bone twice, or one that does not exist", at);
        next = bone + 1u;
        sum += load_le<uint16_t>(row + kInfluenceWeight);
        if (load_le<uint16_t>(row + kInfluenceSpread) > kWeightSteps) return bad_skin("a spread above 1", at);
        if (load_le<uint16_t>(row + kInfluenceZeros) != 0) return bad_skin("reserved bytes are not zero", at);
        for (size_t i = 0; i < 3; ++i)
            if (!is_coordinate(row + kInfluenceCenter + 4 * i))
                return bad_skin("a ball's center is not finite, or beyond the largest coordinate (2^74 m)", at);
        const auto radius = load_le<float>(row + kInfluenceRadius);
        if (!(radius >= 0 && radius <= 2 * kLargestCoordinate)) return bad_skin("a ball's radius is out of range", at);
    }
    if (sum != kWeightSteps) return bad_skin("a node's weights do not add up to 1", at);
    return {};
}

Result<void> check_nodes(std::span<const std::byte> content, const TreeView& tree, uint32_t bones,
                         uint32_t influences) {
    uint32_t before = 0;
    for (uint32_t slot = 0; slot < tree.slot_count(); ++slot) {
        const size_t at = kFirstInfluences + size_t{slot} * 4;
        const auto first = load_le<uint32_t>(content.data() + at), end = load_le<uint32_t>(content.data() + at + 4);
        if (first != before || end < first || end > influences || (tree.is_node(slot) ? end == first : end != first))
            return bad_skin("the nodes do not share out the influences", at);
        before = end;
        if (end == first) continue;
        const auto begin = static_cast<size_t>(influences_begin(tree.slot_count())) + size_t{first} * kInfluenceBytes;
        if (const auto sound = check_influences(content, begin, end - first, bones); !sound) return sound;
    }
    if (before != influences) return bad_skin("the nodes do not share out the influences", kSkinInfluenceCount);
    return {};
}

// Weights are so that their shares are finite.
Result<void> check_weights(std::span<const std::byte> content, size_t at, uint32_t weights, uint32_t bones) {
    constexpr double kLeastSum = 0.5, kMostSum = 2;
    for (; at < content.size(); at += point_weights_bytes(weights)) {
        double sum = 0;
        for (uint32_t i = 0; i < weights; ++i) {
            const auto weight = load_le<float>(content.data() + at + 4 * size_t{i});
            if (!(weight >= 0)) return bad_skin("a point's weight is not a number, or below 0", at);
            sum += double{weight};
            if (load_le<uint16_t>(content.data() + at + 4 * size_t{weights} + 2 * size_t{i}) >= bones)
                return bad_skin("a point names a bone that does not exist", at);
        }
        if (!(sum >= kLeastSum && sum <= kMostSum)) return bad_skin("a point's weights do not add up to about 1", at);
    }
    return {};
}

} // namespace

uint32_t Skin::bone_count() const noexcept {
    return load_le<uint32_t>(content_.data() + kBoneCount);
}

uint32_t Skin::point_count() const noexcept {
    return load_le<uint32_t>(content_.data() + kSkinPointCount);
}

uint32_t Skin::weight_count() const noexcept {
    return load_le<uint32_t>(content_.data() + kSkinWeightCount);
}

uint32_t Skin::influence_count(uint32_t slot) const noexcept {
    assert(slot < slots_);
    const std::byte* const at = content_.data() + kFirstInfluences + size_t{slot} * 4;
    return load_le<uint32_t>(at + 4) - load_le<uint32_t>(at);
}

Skin::Influence Skin::influence(uint32_t slot, uint32_t i) const noexcept {
    assert(i < influence_count(slot));
    const auto first = load_le<uint32_t>(content_.data() + kFirstInfluences + size_t{slot} * 4);
    const std::byte* const at =
        content_.data() + static_cast<size_t>(influences_begin(slots_)) + (size_t{first} + i) * kInfluenceBytes;
    constexpr double kStep = 1.0 / kWeightSteps;
    Influence out{};
    out.bone = load_le<uint16_t>(at + kInfluenceBone);
    out.weight = load_le<uint16_t>(at + kInfluenceWeight) * kStep;
    out.spread = load_le<uint16_t>(at + kInfluenceSpread) * kStep;
    for (size_t k = 0; k < 3; ++k) out.center[k] = load_le<float>(at + kInfluenceCenter + 4 * k);
    out.radius = load_le<float>(at + kInfluenceRadius);
    return out;
}

const std::byte* Skin::points() const noexcept {
    const auto influences = load_le<uint32_t>(content_.data() + kSkinInfluenceCount);
    return content_.data() + static_cast<size_t>(skin_points_begin(slots_, influences));
}

Vec3 Skin::point(uint32_t p) const noexcept {
    assert(p < point_count() && !exact_);
    const std::byte* const at = points() + size_t{p} * kSkinPointBytes;
    return {load_le<float>(at), load_le<float>(at + 4), load_le<float>(at + 8)};
}

Skin::Weight Skin::weight(uint32_t p, uint32_t i) const noexcept {
    const uint32_t weights = weight_count();
    assert(p < point_count() && i < weights);
    const std::byte* const at =
        points() + (exact_ ? 0 : size_t{point_count()} * kSkinPointBytes) + size_t{p} * point_weights_bytes(weights);
    return {load_le<uint16_t>(at + 4 * size_t{weights} + 2 * size_t{i}), load_le<float>(at + 4 * size_t{i})};
}

Result<void> check_skin(std::span<const std::byte> content, const TreeView& tree) noexcept {
    if (content.size() < kFirstInfluences) return bad_skin("wrong size of a skin", 0);
    const auto bones = load_le<uint32_t>(content.data() + kBoneCount),
               points = load_le<uint32_t>(content.data() + kSkinPointCount),
               weights = load_le<uint32_t>(content.data() + kSkinWeightCount),
               influences = load_le<uint32_t>(content.data() + kSkinInfluenceCount), slots = tree.slot_count();
    const bool exact = tree.has_triangles();
    if (bones < 1 || bones > kMaxBones) return bad_skin("a skin has 1 to 1024 bones", kBoneCount);
    if (exact ? points != tree.vertex_count() : points < 1)
        return bad_skin("a skin of other points than the tree's", kSkinPointCount);
    if (weights < 1 || weights > kMaxInfluences) return bad_skin("a point has 1 to 8 weights", kSkinWeightCount);
    if (load_le<uint64_t>(content.data() + kSkinZeros) != 0) return bad_skin("reserved bytes are not zero", kSkinZeros);
    if (content.size() != skin_bytes(slots, influences, points, weights, exact))
        return bad_skin("wrong size of a skin", 0);
    if (const auto sound = check_nodes(content, tree, bones, influences); !sound) return sound;
    auto at = static_cast<size_t>(skin_points_begin(slots, influences));
    if (!exact)
        for (const size_t end = at + size_t{points} * kSkinPointBytes; at < end; at += 4)
            if (!is_coordinate(content.data() + at))
                return bad_skin("a point is not finite, or beyond the largest coordinate (2^74 m)", at);
    return check_weights(content, at, weights, bones);
}

} // namespace prolate
