#include "query/contacts/manifold.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

namespace prolate::query {
namespace {

using glm::dvec3;

constexpr double kNormalOfPatch = 0.9; // cosine
constexpr double kAgreeing = 1 - 1e-6; // of the weights: a mean that is as long is one of the same normals
constexpr double kPreferKnown = 1.1;

// What is known keeps its place against others that are no better than rounding.
bool instead(const Candidate& old, const Candidate& other, double ahead, double same_point) {
    if (old.known == other.known) return ahead > 0;
    return ahead > (other.known ? -same_point : same_point);
}

} // namespace

Patch::Patch(const dvec3& normal, double lean) noexcept
    : Patch(normal, glm::cross(normal, std::abs(normal.x) < 0.6 ? dvec3(1, 0, 0) : dvec3(0, 1, 0)), lean) {}

Patch::Patch(const dvec3& normal, const dvec3& along, double lean) noexcept : seed_(normal), lean_(lean) {
    x_ = glm::normalize(along - glm::dot(along, normal) * normal);
    y_ = glm::cross(normal, x_);
}

bool Patch::takes(const dvec3& normal) const noexcept {
    return glm::dot(normal, seed_) > kNormalOfPatch;
}

bool Patch::add(const dvec3& normal, const Candidate& candidate, double weight, double overlap,
                double same_point) noexcept {
    sum_ += weight * normal, weight_ += weight;
    overlap_ = std::max(overlap_, overlap);
    const double x = glm::dot(x_, candidate.middle), y = glm::dot(y_, candidate.middle);
    constexpr double kDiagonal = 0.7071067811865476;
    double values[] = {candidate.depth,    x, y, kDiagonal * (x + y), kDiagonal * (x - y), -x, -y, -kDiagonal * (x + y),
                       kDiagonal * (y - x)};
    if (lean_ != 0)
        for (uint32_t i = 1; i < kSieve; ++i) values[i] += lean_ * candidate.depth;
    uint32_t better = 0, others = 0; // bits of best_; of kept_, those that stay
    for (uint32_t i = 0; i < kSieve; ++i) {
        const double same = i == 0 ? std::min(same_point, kSameDepth * std::abs(candidate.depth)) : same_point;
        if (any_ && !instead(kept_[best_[i]], candidate, values[i] - reach_[i], same))
            others |= 1u << best_[i];
        else
            better |= 1u << i, reach_[i] = values[i];
    }
    if (better == 0) return false;
    const auto place = static_cast<uint8_t>(std::countr_one(others)); // there is one, for `better` has one
    kept_[place] = candidate;
    for (uint32_t i = 0; i < kSieve; ++i)
        if ((better >> i & 1) != 0) best_[i] = place;
    any_ = true;
    return true;
}

uint32_t Patch::kept(const Candidate* (&out)[kSieve]) const noexcept {
    uint32_t count = 0, seen = 0;
    for (const uint8_t place : best_)
        if ((seen >> place & 1) == 0) seen |= 1u << place, out[count++] = &kept_[place];
    return count;
}

dvec3 Patch::normal() const noexcept {
    const double length = glm::length(sum_);
    return length > 0 ? sum_ / length : seed_;
}

bool Patch::mixed() const noexcept {
    return glm::length(sum_) < kAgreeing * weight_;
}

uint32_t Patch::reduce(const dvec3& n, double same_point, const Candidate* (&out)[kManifoldPoints]) const noexcept {
    const Candidate* all[kSieve];
    const uint32_t all_count = kept(all);
    uint32_t count = 0;
    // Takes the point that `measure` rates best, if above `least`.
    const auto take = [&](double least, auto&& measure) {
        const Candidate* best = nullptr;
        for (uint32_t i = 0; i < all_count; ++i) {
            const Candidate& c = *all[i];
            const double value = measure(c) * (c.known ? kPreferKnown : 1);
            const auto same = [&](const Candidate* other) { return other->id == c.id; };
            if (value > least && std::none_of(out, out + count, same)) least = value, best = &c;
        }
        if (best != nullptr) out[count++] = best;
        return best != nullptr;
    };
    // Of what is as deep as the deepest, the outermost: with equal depths a corner, not what lies between two.
    dvec3 mean(0);
    for (const uint8_t place : best_) mean += kept_[place].middle / double{kSieve};
    const double as_deep = depth() - std::min(same_point, kSameDepth * std::abs(depth()));
    const auto outermost = [&](const Candidate& c) { return c.depth >= as_deep ? glm::length(c.middle - mean) : -1; };
    if (!take(-0.5, outermost)) out[count++] = &deepest();
    const dvec3 p = out[0]->middle;
    if (!take(same_point, [&](const Candidate& c) { return glm::length(c.middle - p); })) return count;
    const dvec3 q = out[1]->middle;
    const double least_area = same_point * glm::length(q - p);
    const auto area = [&](const dvec3& a, const dvec3& b, const dvec3& c) {
        return glm::dot(n, glm::cross(b - a, c - a));
    };
    if (!take(least_area, [&](const Candidate& c) { return std::abs(area(p, q, c.middle)); })) return count;
    // What lies beyond an edge of the triangle adds another one with it.
    const dvec3 r = out[2]->middle;
    const double outward = area(p, q, r) < 0 ? 1 : -1;
    take(least_area, [&](const Candidate& c) {
        const dvec3& s = c.middle;
        return std::max({outward * area(p, q, s), outward * area(q, r, s), outward * area(r, p, s)});
    });
    return count;
}

void Patches::add(const dvec3& normal, const Candidate& candidate, double weight, double overlap) noexcept {
    Patch* shallowest = &patches_[0];
    for (uint32_t i = 0; i < count_; ++i) {
        if (patches_[i].takes(normal)) {
            patches_[i].add(normal, candidate, weight, overlap, same_point_);
            return;
        }
        if (patches_[i].depth() < shallowest->depth()) shallowest = &patches_[i];
    }
    if (count_ < kMost)
        shallowest = &patches_[count_++];
    else if (!(candidate.depth > shallowest->depth()))
        return;
    *shallowest = Patch(normal);
    shallowest->add(normal, candidate, weight, overlap, same_point_);
}

namespace {

// `normal`: in the world, from A to B.
ContactPoint point_of(const Candidate& c, const dvec3& normal, bool exchanged, const RelativePose& to_world) {
    ContactPoint out;
    const dvec3 middle = to_world.rotation * c.middle + to_world.translation, half = 0.5 * c.depth * normal;
    out.point_a = to_float(exchanged ? middle - half : middle + half);
    out.point_b = to_float(exchanged ? middle + half : middle - half);
    out.depth = static_cast<float>(c.depth);
    out.id = c.id;
    return out;
}

} // namespace

Manifold manifold_of(const Patch& patch, double same_point, bool exchanged, const RelativePose& to_world) noexcept {
    Manifold out;
    const dvec3 normal = patch.normal(), world = to_world.rotation * normal;
    const Candidate* points[kManifoldPoints];
    out.count = patch.reduce(normal, same_point, points);
    for (uint32_t k = 1; k < out.count; ++k) // by id
        for (uint32_t at = k; at > 0 && points[at]->id < points[at - 1]->id; --at)
            std::swap(points[at], points[at - 1]);
    out.normal = to_float(exchanged ? -world : world);
    for (uint32_t k = 0; k < out.count; ++k) out.points[k] = point_of(*points[k], world, exchanged, to_world);
    return out;
}

void round_contacts(ContactManifolds& manifolds, float radius_a, float radius_b) noexcept {
    const auto move = [](Vec3& p, const Vec3& n, float by) { p = {p.x + by * n.x, p.y + by * n.y, p.z + by * n.z}; };
    for (uint32_t i = 0; i < manifolds.count; ++i) {
        Manifold& m = manifolds.manifolds[i];
        for (uint32_t k = 0; k < m.count; ++k) {
            ContactPoint& p = m.points[k];
            move(p.point_a, m.normal, radius_a), move(p.point_b, m.normal, -radius_b);
            p.depth += radius_a + radius_b;
        }
    }
}

} // namespace prolate::query
