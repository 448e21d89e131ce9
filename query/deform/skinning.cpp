#include "query/deform/skinning.hpp"

#include <prolate/tree.hpp>

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <cmath>

namespace prolate::query {
namespace {

using glm::dmat3;
using glm::dvec3;

constexpr double kSkinRounding = 0x1p-49, kSkinRoundings = 32;
// A mean of rotations by half a turn flattens a node, or makes it a point. Beyond this, shares of its norm cubed, a
// ball is taken for the ellipsoid, because queries lose their way on flat ones.
constexpr double kFlattest = 0x1p-20;

// x goes to linear x + translation.
struct Transform {
    dmat3 linear{0};
    dvec3 translation{0};

    dvec3 operator()(const dvec3& x) const { return linear * x + translation; }
    void add(double weight, const Transform& t) { linear += weight * t.linear, translation += weight * t.translation; }
};

Transform transform_of(const BoneMatrix& bone, double scale) {
    Transform out;
    for (int i = 0; i < 3; ++i) {
        for (int k = 0; k < 3; ++k) out.linear[k][i] = double{bone.m[i][k]};
        out.translation[i] = scale * double{bone.m[i][3]};
    }
    return out;
}

double squared(const dmat3& a) {
    return glm::dot(a[0], a[0]) + glm::dot(a[1], a[1]) + glm::dot(a[2], a[2]);
}
double frobenius(const dmat3& a) {
    return std::sqrt(squared(a));
}

// No less than |A x| / |x|: |A|^2 is the largest eigenvalue of A^T A, which no row sum is below. Of rotations it is 1.
double norm(const dmat3& a) {
    const double xx = glm::dot(a[0], a[0]), yy = glm::dot(a[1], a[1]), zz = glm::dot(a[2], a[2]);
    const double xy = std::abs(glm::dot(a[0], a[1])), yz = std::abs(glm::dot(a[1], a[2])),
                 zx = std::abs(glm::dot(a[2], a[0]));
    return std::sqrt(std::min(std::max({xx + xy + zx, yy + xy + yz, zz + yz + zx}), xx + yy + zz));
}

} // namespace

bool are_sound(std::span<const BoneMatrix> bones) noexcept {
    for (const BoneMatrix& bone : bones)
        for (const auto& row : bone.m)
            for (size_t k = 0; k < 4; ++k) // also a NaN
                if (!(std::abs(row[k]) <= (k < 3 ? kLargestBoneFactor : kLargestCoordinate))) return false;
    return true;
}

Bound Skinning::moved(uint32_t node, const Bound& bound, const ModeShift& by) const noexcept {
    const uint32_t count = skin_.influence_count(node);
    const dvec3 c = bound.core.center;
    Transform mean;
    double largest = 0, farthest = 0, around = 0; // of matrices and translations, squared; of corners from c
    const auto ball = [&](const Skin::Influence& of) {
        return scale_ * dvec3(of.center[0], of.center[1], of.center[2]) + by.shift;
    };
    for (uint32_t i = 0; i < count; ++i) {
        const Skin::Influence of = skin_.influence(node, i);
        const Transform bone = transform_of(bones_[of.bone], scale_);
        mean.add(of.weight, bone);
        largest = std::max(largest, squared(bone.linear));
        farthest = std::max(farthest, glm::dot(bone.translation, bone.translation));
        around = std::max(around, glm::length(ball(of) - c) + scale_ * of.radius + by.spread);
    }
    double longest = 0, sum = 0, spreads = 0;
    for (uint32_t i = 0; i < count && count > 1; ++i) { // one bone alone is exact
        const Skin::Influence of = skin_.influence(node, i);
        Transform off = transform_of(bones_[of.bone], scale_);
        off.add(-1, mean);
        const double stretch = norm(off.linear);
        longest = std::max(longest, glm::length(off(ball(of))) + stretch * (scale_ * of.radius + by.spread));
        sum += of.spread * (glm::length(off(c)) + stretch * around);
        spreads += of.spread;
    }
    const double reach = std::sqrt(largest) * (bound.core.reach + around + glm::length(by.shift)) + std::sqrt(farthest);
    Bound out{};
    out.radius = norm(mean.linear) * bound.radius + std::min(longest, sum) +
                 kSkinRounding * (count + kSkinRoundings) * (1 + spreads) * reach;
    out.core.center = mean(c);
    out.core.factor = mean.linear * bound.core.factor;
    const double size = frobenius(mean.linear);
    if (!(std::abs(glm::determinant(mean.linear)) > kFlattest * size * size * size))
        out.core.factor = dmat3(frobenius(out.core.factor) + out.radius + kSkinRounding * bound.core.size); // above 0
    out.core.size = frobenius(out.core.factor);
    out.core.reach = reach + out.core.size + out.radius;
    return out;
}

PlacedPoint Skinning::moved(uint32_t p, const PlacedPoint& point) const noexcept {
    const uint32_t count = skin_.weight_count();
    double sum = 0;
    for (uint32_t i = 0; i < count; ++i) sum += double{skin_.weight(p, i).weight};
    PlacedPoint out{};
    for (uint32_t i = 0; i < count; ++i) {
        const Skin::Weight of = skin_.weight(p, i);
        if (of.weight == 0) continue;
        const Transform bone = transform_of(bones_[of.bone], scale_);
        const double share = double{of.weight} / sum;
        out.position += share * bone(point.position);
        out.reach += share * (frobenius(bone.linear) * point.reach + glm::length(bone.translation));
    }
    return out;
}

} // namespace prolate::query
