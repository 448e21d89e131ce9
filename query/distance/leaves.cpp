// What the traversal's float bounds leave open is decided here, in double precision.
#include "query/triangle/leaves.hpp"
#include "query/distance/state.hpp"
#include "query/ellipsoid/gap.hpp"
#include "query/triangle/ellipsoid_distance.hpp"
#include "query/triangle/support.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace prolate::query {
using glm::dvec3;

namespace {

// Bounds of two leaves are so much nearer to each other than those of the bodies may be, that leaves as near as the
// nearest ones make no difference.
constexpr double kOfTolerance = 0.25;

// After so many much is equally near, along faces above all: these are worth a look before distance().
constexpr uint64_t kManyBlocks = 128;

DistanceOptions sound(DistanceOptions options) {
    options.tolerance_absolute = sound_tolerance(options.tolerance_absolute);
    options.tolerance_relative = std::clamp(sound_tolerance(options.tolerance_relative),
                                            DistanceSearch::kLeastTolerance, DistanceSearch::kMostTolerance);
    options.max_distance = sound_length(options.max_distance);
    return options;
}

} // namespace

DistanceSearch::DistanceSearch(const OrderedBodies<Pose>& bodies, Scratch context,
                               const DistanceOptions& distance_options) noexcept
    : a(tree_side(bodies.a, distance_options.max_level)), b(tree_side(bodies.b, distance_options.max_level)),
      b_to_a(relative_pose(bodies.place_a, bodies.place_b)), lattice_b_to_a(lattice_pose(b_to_a, b.lattice, a.lattice)),
      lattice_a_to_b(lattice_pose(inverse(b_to_a), a.lattice, b.lattice)), options(sound(distance_options)),
      radii(double{bodies.a.radius()} + bodies.b.radius()), entries(context.entries()),
      room(heap_room(context, a.tree, b.tree)),
      triangle_reach_(triangle_reach(a.tree) + triangle_reach(b.tree) + b_to_a.distance) {}

double root_bound(const DistanceSearch& search) noexcept {
    const PlacedEllipsoid x = place(search.a.tree.bound(0), search.a.tree.scale()),
                          y = place(search.b.tree.bound(0), search.b.tree.scale(), search.b_to_a);
    const double bound = glm::length(y.center - x.center) - x.size - y.size - kSeparationMargin * (x.reach + y.reach);
    return bound > 0 ? bound : 0;
}

double DistanceSearch::slabs_apart(const NodeWithHull& node_a, const NodeWithHull& node_b) const noexcept {
    return gap_of_slabs(node_a, node_b, b_to_a, triangle_reach_);
}

void DistanceSearch::take(const TriangleDistance& found, const MeetingPair& pair, double bound, bool meet) noexcept {
    // Apart, but perhaps by no more than the bound's own rounding.
    decided = std::min(decided, meet ? 0 : std::max({found.lower, bound, std::numeric_limits<double>::min()}));
    if (!(found.upper < upper) && !meet) return;
    upper = std::min(upper, found.upper), on_a = found.on_a, on_b = found.on_b, witness = pair, overlapping = meet;
    const dvec3 between = on_b - on_a;
    const double length = glm::length(between);
    normal = length > 0 ? between / length : dvec3(0);
    normal_b = normal * b_to_a.rotation;
    if (length > 0) ++normals_found;
}

bool DistanceSearch::decide(uint32_t node_a, uint32_t node_b, double bound) noexcept {
    const TriangleRange in_a = a.tree.triangles(node_a), in_b = b.tree.triangles(node_b);
    if (in_a.count == 0 && in_b.count == 0) return decide_ellipsoids(node_a, node_b, bound), true;
    if (uint64_t{std::max(in_a.count, 1u)} * std::max(in_b.count, 1u) > left()) return false;
    if (in_a.count > 0 && in_b.count > 0) return decide_triangles(node_a, node_b, in_a, in_b, bound), true;
    const bool triangles_in_a = in_a.count > 0;
    const TriangleRange range = triangles_in_a ? in_a : in_b;
    const PlacedEllipsoid ellipsoid = triangles_in_a ? place(b.tree.ellipsoid(node_b), b.tree.scale(), b_to_a)
                                                     : place(a.tree.ellipsoid(node_a), a.tree.scale());
    for (uint32_t t = range.first; t < range.first + range.count && !overlapping; ++t) {
        const PlacedTriangle triangle = triangles_in_a ? place(a.tree, t) : place(b.tree, t, b_to_a);
        TriangleDistance found = distance(triangle, ellipsoid);
        const bool meet = !separated(triangle, ellipsoid);
        ++stats.triangle_tests;
        if (!triangles_in_a) std::swap(found.on_a, found.on_b);
        take(found, {node_a, node_b, triangles_in_a ? t : kNoTriangle, triangles_in_a ? kNoTriangle : t}, bound, meet);
    }
    return true;
}

void DistanceSearch::decide_ellipsoids(uint32_t node_a, uint32_t node_b, double bound) noexcept {
    const PlacedEllipsoid x = place(a.tree.ellipsoid(node_a), a.tree.scale()),
                          y = place(b.tree.ellipsoid(node_b), b.tree.scale(), b_to_a);
    const bool meet = !separated(x, y);
    const double wanted = meet || !(upper < kInfinity) ? 0 : kOfTolerance * tolerance(upper);
    Gap gap = distance_of(x, y, wanted, normal);
    // If these are the nearest, what is wanted is a share of their own distance.
    if (const double least = kOfTolerance * tolerance(std::max(0.0, gap.lower));
        gap.upper < upper && gap.upper - gap.lower > least && least < wanted)
        gap = distance_of(x, y, least, gap.normal);
    take({std::max(0.0, gap.lower), std::max(0.0, gap.upper), gap.point_a, gap.point_b}, {node_a, node_b}, bound, meet);
}

void DistanceSearch::decide_triangles(uint32_t node_a, uint32_t node_b, TriangleRange in_a, TriangleRange in_b,
                                      double bound) noexcept {
    const double limit = enough();
    const LeafDistance found =
        distance_of_leaves(a.tree, in_a, b.tree, in_b, b_to_a,
                           {limit, options.tolerance_absolute, options.tolerance_relative, radii}, normal);
    stats.triangle_tests += found.pair_tests;
    const bool meet = found.nearest.upper < kInfinity && !(found.nearest.lower > 0);
    skipped = std::min(skipped, meet ? 0 : std::max(found.lower, bound));
    if (found.nearest.upper < kInfinity)
        take(found.nearest, {node_a, node_b, found.triangle_a, found.triangle_b}, bound, meet);
}

void DistanceSearch::decide_triangles(const MeetingPair& pair, double limit, double bound) noexcept {
    const PlacedTriangle x = place(a.tree, pair.triangle_a), y = place(b.tree, pair.triangle_b, b_to_a);
    const auto apart_along = [&](const dvec3& n) {
        const double along = gap_along(x, y, n);
        if (along >= limit) skipped = std::min(skipped, std::max(along, bound));
        return along >= limit;
    };
    const auto apart_along_face = [&](const dvec3& m) {
        const dvec3 n = m / glm::length(m);
        return apart_along(glm::dot(n, y.corner[0] - x.corner[0]) < 0 ? -n : n);
    };
    if (apart_along(normal)) return;
    if (stats.block_tests > kManyBlocks && (apart_along_face(face_normal(x)) || apart_along_face(face_normal(y))))
        return;
    const TriangleDistance found = distance(x, y);
    take(found, pair, bound, !(found.lower > 0));
}

bool DistanceSearch::try_first(const MeetingPair& pair) noexcept {
    const auto is_leaf = [](const TreeView& tree, uint32_t node) {
        return node < tree.slot_count() && tree.is_node(node) && tree.is_leaf(node);
    };
    return !is_leaf(a.tree, pair.node_a) || !is_leaf(b.tree, pair.node_b) || decide(pair.node_a, pair.node_b, 0);
}

} // namespace prolate::query
