#include "query/triangle/slab.hpp"
#include "query/ellipsoid/separation.hpp"
#include "query/triangle/placed.hpp"
#include "query/triangle/support.hpp"
#include "src/bytes.hpp"
#include "src/hull.hpp"
#include "src/slab.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <utility>

namespace prolate::query {
namespace {

using glm::dvec3;

constexpr double kAboutTheSame = 0.95;  // cosine
constexpr double kAboutParallel = 0.98; // cosine of normals that are rounded to 127ths
constexpr double kOff = 0.008;          // which may lead astray by this share of a length
constexpr double kNothing = 0x1p-50;    // of a direction of length 1: what it costs is within kSeparationMargin S

dvec3 vector(const double (&v)[3]) {
    return {v[0], v[1], v[2]};
}

// A node in its tree's frame, ready to say how far it reaches.
struct Reaching {
    const NodeWithHull& at;
    const bool flat; // it has a slab:
    dvec3 normal{0}, point{0};
    double low = 0, high = 0; // along the normal

    explicit Reaching(const NodeWithHull& node) : at(node), flat(is_flat(node)) {
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
    PlacedEllipsoid bound() const { return place(at.tree.bound(at.node), at.tree.scale()); }
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

// Of two nodes that have slabs: are these about parallel, and perhaps farther apart than `least`? Wrong now and then.
bool face_each_other(const NodeWithHull& a, const NodeWithHull& b, const RelativePose& b_to_a, double least) {
    const dvec3 n = about_normal(a), of_b = b_to_a.rotation * about_normal(b);
    const double cosine = glm::dot(n, of_b);
    if (!(std::abs(cosine) > kAboutParallel)) return false;
    const auto corner = [](const NodeWithHull& at) {
        return position(at.tree, at.tree.triangle(load_le<uint32_t>(at.hull + kHullPlane))[0]);
    };
    const auto heights = [](const NodeWithHull& at) {
        const double scale = at.tree.scale();
        return std::pair(scale * load_le<float>(at.hull + kHullLow), scale * load_le<float>(at.hull + kHullHigh));
    };
    const dvec3 between = b_to_a.rotation * corner(b) + b_to_a.translation - corner(a);
    const double height = glm::dot(n, between);
    const auto [low_a, high_a] = heights(a);
    const auto [low_b, high_b] = heights(b);
    const double gap = cosine > 0 ? std::max(height + low_b - high_a, low_a - (height + high_b))
                                  : std::max(height - high_b - high_a, low_a - (height - low_b));
    return gap > least - kOff * glm::length(between);
}

} // namespace

NodeWithHull with_hull(const TreeView& tree, uint32_t node) noexcept {
    const ChildRange children = tree.children(node);
    return {tree, node,
            tree.has_triangles() && children.count > 0 ? tree.raw().hull(children.first / kBlockLanes) : nullptr};
}

bool is_flat(const NodeWithHull& at) noexcept {
    return at.hull != nullptr && has_slab(at.hull);
}

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

double gap_of_roots(const TreeView& a, const TreeView& b, const RelativePose& b_to_a, double least) noexcept {
    const NodeWithHull root_a = with_hull(a, 0), root_b = with_hull(b, 0);
    if (!is_flat(root_a) || !is_flat(root_b) || !face_each_other(root_a, root_b, b_to_a, least)) return -HUGE_VAL;
    return gap_of_slabs(root_a, root_b, b_to_a, triangle_reach(a) + triangle_reach(b) + b_to_a.distance);
}

} // namespace prolate::query
