// What the float bounds of distance.cpp leave open is decided here, in double precision.
#include "query/corners.hpp"
#include "query/distance_search.hpp"
#include "query/gap.hpp"
#include "query/triangle_ellipsoid.hpp"
#include "query/triangle_lanes.hpp"

#include <glm/geometric.hpp>

#include <cmath>

namespace prolate::query {
using glm::dvec3;

DistanceSearch::DistanceSearch(const TreeView& tree_a, const Pose& pose_a, const TreeView& tree_b, const Pose& pose_b,
                               QueryContext& context, const DistanceOptions& distance_options) noexcept
    : a(body(tree_a, distance_options.max_level)), b(body(tree_b, distance_options.max_level)),
      b_to_a(relative_pose(pose_a, pose_b)), lattice_b_to_a(lattice_pose(b_to_a, b.lattice, a.lattice)),
      lattice_a_to_b(lattice_pose(inverse(b_to_a), a.lattice, b.lattice)), options(distance_options),
      entries(context.entries), corners_reach_(reach_of_corners(tree_a) + reach_of_corners(tree_b) + b_to_a.distance) {}

double root_bound(const DistanceSearch& search) noexcept {
    const PlacedEllipsoid x = place(search.a.tree.bound(0)), y = place(search.b.tree.bound(0), search.b_to_a);
    const double bound = glm::length(y.center - x.center) - x.size - y.size - kSeparationMargin * (x.reach + y.reach);
    return bound > 0 ? bound : 0;
}

void DistanceSearch::take(const TriangleDistance& found, const MeetingPair& pair, bool meet) noexcept {
    // Apart, but by no more than the bound's own rounding.
    decided = std::min(decided, meet ? 0 : std::max(found.lower, std::numeric_limits<double>::min()));
    if (!(found.upper < upper) && !meet) return;
    upper = found.upper, on_a = found.on_a, on_b = found.on_b, witness = pair, overlapping = meet;
    const dvec3 between = on_b - on_a;
    const double length = glm::length(between);
    normal = length > 0 ? between / length : dvec3(0);
    normal_b = normal * b_to_a.rotation;
    supports_a_ = supports_b_ = {};
}

void DistanceSearch::decide(uint32_t node_a, uint32_t node_b) noexcept {
    const TriangleRange in_a = a.tree.triangles(node_a), in_b = b.tree.triangles(node_b);
    if (in_a.count > 0 && in_b.count > 0) return decide_triangles(node_a, node_b, in_a, in_b);
    if (in_a.count == 0 && in_b.count == 0) {
        const PlacedEllipsoid x = place(a.tree.ellipsoid(node_a)), y = place(b.tree.ellipsoid(node_b), b_to_a);
        const Gap gap = distance_of(x, y, upper < kInfinity ? 0.25 * (upper - enough()) : 0, normal);
        const bool meet = !(gap.lower > 0) && test_pair(x, y).verdict != PairVerdict::separated;
        const double distance = std::max(0.0, gap.upper);
        return take({std::max(0.0, gap.lower), distance, gap.point_a, gap.point_b}, {node_a, node_b}, meet);
    }
    const bool triangles_in_a = in_a.count > 0;
    const TriangleRange range = triangles_in_a ? in_a : in_b;
    const PlacedEllipsoid ellipsoid =
        triangles_in_a ? place(b.tree.ellipsoid(node_b), b_to_a) : place(a.tree.ellipsoid(node_a));
    for (uint32_t t = range.first; t < range.first + range.count && !overlapping; ++t) {
        const PlacedTriangle triangle = triangles_in_a ? place(a.tree, t) : place(b.tree, t, b_to_a);
        TriangleDistance found = distance(triangle, ellipsoid);
        const bool meet = !apart(triangle, ellipsoid);
        ++stats.triangle_tests;
        if (!triangles_in_a) std::swap(found.on_a, found.on_b);
        take(found, {node_a, node_b, triangles_in_a ? t : kNoTriangle, triangles_in_a ? kNoTriangle : t}, meet);
    }
}

// A lower bound from `normal`.
double DistanceSearch::gap_along_normal(uint32_t node_a, uint32_t node_b, TriangleRange in_a,
                                        TriangleRange in_b) noexcept {
    const auto kept = [](Supports& supports, const TreeView& tree, uint32_t leaf, TriangleRange range, const dvec3& n) {
        Support& at = supports[leaf % supports.size()];
        if (at.leaf != leaf) at = {leaf, support_of_corners(tree, range, n)};
        return at.reach;
    };
    const double gap = (glm::dot(normal, b_to_a.translation) - kept(supports_b_, b.tree, node_b, in_b, -normal_b)) -
                       kept(supports_a_, a.tree, node_a, in_a, normal);
    return (gap - kSeparationMargin * corners_reach_) * (1 - 0x1p-50);
}

void DistanceSearch::decide_triangles(uint32_t node_a, uint32_t node_b, TriangleRange in_a,
                                      TriangleRange in_b) noexcept {
    const double limit = enough();
    if (normal != dvec3(0)) { // almost all leaves are far enough apart along the direction of the nearest ones
        const double gap = gap_along_normal(node_a, node_b, in_a, in_b);
        if (gap >= limit) {
            skipped = std::min(skipped, gap);
            return;
        }
    }
    const LeafDistance found = distance_of_leaves(a.tree, in_a, b.tree, in_b, b_to_a,
                                                  {limit, options.tolerance_absolute, relative_tolerance()}, normal);
    stats.triangle_tests += found.pair_tests;
    skipped = std::min(skipped, found.lower);
    if (found.nearest.upper < kInfinity)
        take(found.nearest, {node_a, node_b, found.triangle_a, found.triangle_b}, !(found.nearest.lower > 0));
}

void DistanceSearch::try_first(const MeetingPair& pair) noexcept {
    const auto is_leaf = [](const TreeView& tree, uint32_t node) {
        return node < tree.slot_count() && tree.is_node(node) && tree.is_leaf(node);
    };
    if (is_leaf(a.tree, pair.node_a) && is_leaf(b.tree, pair.node_b)) decide(pair.node_a, pair.node_b);
}

} // namespace prolate::query
