#include "query/triangle/slab.hpp"
#include "query/ellipsoid/separation.hpp"
#include "query/triangle/support.hpp"
#include "src/bytes.hpp"
#include "src/hull.hpp"
#include "src/slab.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace prolate::query {
namespace {

using glm::dvec3;

constexpr double kAboutTheSame = 0.95; // cosine
constexpr double kNothing = 0x1p-50;   // of a direction of length 1: what it costs is within kSeparationMargin S

dvec3 vector(const double (&v)[3]) {
    return {v[0], v[1], v[2]};
}

// A node in its tree's frame, ready to say how far it reaches.
struct Reaching {
    const NodeWithHull& at;
    const bool flat; // it has a slab:
    dvec3 normal{0}, point{0};
    double low = 0, high = 0; // along the normal

    explicit Reaching(const NodeWithHull& node) : at(node), flat(node.hull != nullptr && has_slab(node.hull)) {
        if (!flat) return;
        const Slab slab = slab_of(node.tree, node.hull);
        normal = vector(slab.normal), point = vector(slab.origin);
        const double plane = glm::dot(normal, point);
        low = plane + slab.low, high = plane + slab.high;
    }
    double along(const dvec3& d) const {
        if (!flat) {
            const bool is_leaf = at.hull == nullptr && at.tree.has_triangles();
            return is_leaf ? triangle_support(at.tree, at.tree.triangles(at.node), d) : support(bound(), d);
        }
        const double part = glm::dot(d, normal);
        const dvec3 rest = d - part * normal;
        const double in_slab = part * (part > 0 ? high : low);
        // Mere rounding, of lengths within S, is not looked into.
        return glm::dot(rest, rest) < kNothing * kNothing ? in_slab : in_slab + support(bound(), rest);
    }
    dvec3 about_center() const { return flat ? point : bound().center; }

private:
    PlacedEllipsoid bound() const { return place(at.tree.bound(at.node)); }
};

double gap_along(const dvec3& n, const Reaching& a, const Reaching& b, const RelativePose& b_to_a) {
    return (glm::dot(n, b_to_a.translation) - b.along(-(n * b_to_a.rotation))) - a.along(n);
}

// The normal of a node's slab to a 127th; 0 without one.
dvec3 about_normal(const NodeWithHull& at) {
    if (at.hull == nullptr) return dvec3(0);
    const auto component = [&](size_t k) { return static_cast<double>(load_le<int8_t>(at.hull + kHullNormal + k)); };
    return dvec3(component(0), component(1), component(2)) / kHullUnit;
}

} // namespace

bool may_tell(const NodeWithHull& a, const NodeWithHull& b, const RelativePose& b_to_a, const dvec3& n) noexcept {
    const dvec3 of_a = about_normal(a), of_b = b_to_a.rotation * about_normal(b);
    const auto about_the_same = [](const dvec3& x, const dvec3& y) { return std::abs(glm::dot(x, y)) > kAboutTheSame; };
    return about_the_same(of_a, n) || about_the_same(of_b, n) || about_the_same(of_a, of_b);
}

double gap_along(const dvec3& n, const NodeWithHull& a, const NodeWithHull& b, const RelativePose& b_to_a) noexcept {
    return gap_along(n, Reaching(a), Reaching(b), b_to_a);
}

double gap_of_slabs(const NodeWithHull& a, const NodeWithHull& b, const RelativePose& b_to_a, double reach) noexcept {
    const Reaching in_a(a), in_b(b);
    // Of flat nodes that are near each other, the centers are where rounding has put them.
    const dvec3 between = b_to_a.rotation * in_b.about_center() + b_to_a.translation - in_a.about_center();
    const auto gap_of = [&](const dvec3& normal) {
        return gap_along(glm::dot(normal, between) < 0 ? -normal : normal, in_a, in_b, b_to_a);
    };
    double gap = -HUGE_VAL;
    if (in_a.flat) gap = std::max(gap, gap_of(in_a.normal));
    if (in_b.flat && !(gap > 0)) gap = std::max(gap, gap_of(b_to_a.rotation * in_b.normal));
    return (gap - kSeparationMargin * reach) * (1 - 0x1p-49);
}

} // namespace prolate::query
