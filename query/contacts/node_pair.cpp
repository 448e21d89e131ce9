#include "query/contacts/node_pair.hpp"

#include "query/triangle/placed.hpp"
#include "query/triangle/support.hpp"
#include "src/block.hpp"
#include "src/bytes.hpp"
#include "src/hull.hpp"
#include "src/slab.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace prolate::query {
namespace {

using glm::dvec3;

// Of a node's size: what its triangles may be off a plane by. The builder gives slabs to what is half as thick.
constexpr double kFlat = 0x1p-11;
constexpr double kParallel = 1 - 1e-6; // cosine

// In its tree's frame; 0 if it is not flat.
dvec3 normal_of(const NodeWithHull& at) {
    if (!at.tree.has_triangles()) return dvec3(0);
    const double thin = kFlat * place(at.tree.bound(at.node), at.tree.scale()).size;
    const auto normal = [](const Slab& slab) { return dvec3(slab.normal[0], slab.normal[1], slab.normal[2]); };
    if (at.hull != nullptr) {
        if (!has_slab(at.hull)) return dvec3(0);
        const Slab slab = slab_of(at.tree, at.hull);
        return slab.high - slab.low <= thin ? normal(slab) : dvec3(0);
    }
    const TriangleRange range = at.tree.triangles(at.node);
    const Slab plane = plane_of(at.tree, range.first);
    for (uint32_t t = range.first + 1; t < range.first + range.count; ++t)
        for (const uint32_t v : at.tree.triangle(t)) {
            const dvec3 p = position(at.tree, v);
            const double x[] = {p.x, p.y, p.z};
            if (!(std::abs(plane.height(x)) <= thin)) return dvec3(0);
        }
    return normal(plane);
}

// Along d, in the tree's frame.
Extent extent_of(const NodeWithHull& at, const dvec3& d) {
    if (at.hull == nullptr && at.tree.has_triangles()) {
        const TriangleRange range = at.tree.triangles(at.node);
        return {-triangle_support(at.tree, range, -d), triangle_support(at.tree, range, d)};
    }
    const PlacedEllipsoid e = place(at.tree.bound(at.node), at.tree.scale());
    const dvec3 v = d * e.factor;
    const double middle = glm::dot(d, e.center), half = glm::length(v);
    const uint8_t share = at.hull != nullptr ? load_le<uint8_t>(at.hull + kHullShare) : 0;
    if (share == 0) return {middle - half, middle + half};
    Extent hull{HUGE_VAL, -HUGE_VAL};
    for (size_t i = 0; i < kHullPoints; ++i) {
        const auto q = [&](size_t k) { return load_le<int8_t>(at.hull + kHullPoint + kHullPoints * k + i); };
        const double height = v.x * q(0) + v.y * q(1) + v.z * q(2);
        hull.low = std::min(hull.low, height), hull.high = std::max(hull.high, height);
    }
    const double more = half * share / kHullShares;
    return {middle + hull.low / kHullUnit - more, middle + hull.high / kHullUnit + more};
}

// Below a node with a hull: its descendants of a level have successive blocks, and a block says how many triangles, and
// how many blocks of children, there are before its own.
uint64_t triangles_below(const NodeWithHull& at) {
    const TreeView& tree = at.tree;
    if (at.hull == nullptr) return std::max(tree.triangles(at.node).count, 1u);
    const auto before = [&](size_t field, uint32_t block, uint32_t all) {
        return block < tree.block_count() ? load_le<uint32_t>(tree.raw().block(block) + field) : all;
    };
    const ChildRange children = tree.children(at.node);
    uint64_t count = 0;
    for (uint32_t first = children.first / kBlockLanes, end = first + blocks_for(children.count); first < end;) {
        const uint32_t all = tree.triangle_count();
        count += before(kBlockTriangles, end, all) - before(kBlockTriangles, first, all);
        first = before(kBlockChildren, first, tree.block_count());
        end = before(kBlockChildren, end, tree.block_count());
    }
    return count;
}

} // namespace

NodePair::NodePair(const CollideSearch& search, uint32_t node_a, uint32_t node_b) noexcept
    : s_(search), a_(with_hull(search.a.tree, node_a)), b_(with_hull(search.b.tree, node_b)) {}

dvec3 NodePair::normal() const noexcept {
    const dvec3 of_a = normal_of(a_);
    if (of_a == dvec3(0)) return of_a;
    const dvec3 of_b = s_.b_to_a.rotation * normal_of(b_);
    return std::abs(glm::dot(of_a, of_b)) > kParallel ? of_a : dvec3(0);
}

double NodePair::overlap(const dvec3& n) const noexcept {
    return -gap_along(n, a_, b_, s_.b_to_a);
}

bool NodePair::resolved_by(const Way& way, double same_point, std::optional<dvec3>& normal) const noexcept {
    const double between = overlap(way.normal);
    if (!(between <= way.depth + same_point)) return false;
    if (between <= same_point) return true;
    if (!normal) normal = this->normal();
    return std::abs(glm::dot(way.normal, *normal)) > kSameAsFace;
}

Extent NodePair::extent(const dvec3& d, double beside) const noexcept {
    const Extent of_a = extent_of(a_, d), of_b = extent_of(b_, d * s_.b_to_a.rotation); // the transpose times it
    const double shift = glm::dot(d, s_.b_to_a.translation);
    return {std::max(of_a.low, of_b.low + shift) - beside, std::min(of_a.high, of_b.high + shift) + beside};
}

uint64_t NodePair::triangles() const noexcept {
    return triangles_below(a_) + triangles_below(b_);
}

} // namespace prolate::query
