// What the traversal's float tests leave open is decided here, in double precision.
#include "query/triangle/leaves.hpp"
#include "query/collide/search.hpp"
#include "query/ellipsoid/gap.hpp"
#include "query/triangle/ellipsoid_distance.hpp"
#include "query/triangle/separation.hpp"
#include "query/triangle/support.hpp"

#include <glm/geometric.hpp>

namespace prolate::query {
namespace {

// Skins below this share of the first one are given up: nearly touching bodies gain nothing from them.
constexpr float kLeastSkin = 0x1p-6f;
// Of all lengths: planes that overlap by less are one.
constexpr double kInOnePlane = 0x1p-36;

} // namespace

CollideSearch::CollideSearch(const TreeView& tree_a, const TreeView& tree_b, const RelativePose& pose_b_to_a,
                             Scratch context, const QueryOptions& query_options) noexcept
    : a(tree_side(tree_a, query_options.max_level)), b(tree_side(tree_b, query_options.max_level)), b_to_a(pose_b_to_a),
      options(sound(query_options)), stack(context.entries()) {}

void CollideSearch::set_skin(float distance) noexcept {
    skin = distance;
    least_skin_ = kLeastSkin * distance;
}

// Are two leaves farther apart than the margin? If so, shrinks the skin until they are beyond it, too.
// `farther_than(d)`: are they certainly farther apart than d?
template <class FartherThan> bool CollideSearch::separated_by_margin(FartherThan&& farther_than) noexcept {
    while (skin > 0) {
        if (farther_than(options.margin + skin)) return true;
        skin = skin > least_skin_ ? skin / 4 : 0;
    }
    return farther_than(options.margin);
}

// Counts tests of triangles that were done. False if the budget does not hold so many: they are as if not done, so
// that a budget ends a query just where its count says.
bool CollideSearch::spend(uint64_t tests) noexcept {
    const uint64_t rest = left();
    out_of_tests = out_of_tests || tests > rest;
    stats.triangle_tests += std::min(tests, rest);
    return !out_of_tests;
}

bool CollideSearch::take(const MeetingPair& pair) noexcept {
    if (each != nullptr) each(each_user, pair);
    if (found < pairs.size()) pairs[static_cast<size_t>(found)] = pair;
    ++found;
    return !all;
}

double CollideSearch::reach_of_triangles() noexcept {
    if (triangle_reach_ < 0) triangle_reach_ = triangle_reach(a.tree) + triangle_reach(b.tree) + b_to_a.distance;
    return triangle_reach_;
}

Slabs CollideSearch::slabs_of(const NodeWithHull& node_a, const NodeWithHull& node_b, const glm::dvec3& n) noexcept {
    if (!may_tell(node_a, node_b, b_to_a, n)) return Slabs::say_nothing;
    const double reach = reach_of_triangles(), least = double{options.margin} + skin;
    const double gap = gap_of_slabs(node_a, node_b, b_to_a, reach);
    if (gap > least) return Slabs::separated;
    const bool in_one_plane = gap > least - kInOnePlane * reach && is_flat(node_a) && is_flat(node_b);
    return in_one_plane ? Slabs::in_one_plane : Slabs::say_nothing;
}

// Are the triangles farther apart than margin + skin along this direction?
bool CollideSearch::separated_along(const glm::dvec3& normal, TriangleRange in_a, TriangleRange in_b) noexcept {
    const glm::dvec3 n = normal / glm::length(normal);
    const double room = glm::dot(n, b_to_a.translation) - triangle_support(a.tree, in_a, n);
    return room - triangle_support(b.tree, in_b, -(n * b_to_a.rotation)) >
           double{options.margin} + skin + kSeparationMargin * reach_of_triangles();
}

bool CollideSearch::meet(uint32_t node_a, uint32_t node_b, const glm::dvec3& normal) noexcept {
    const TriangleRange in_a = a.tree.triangles(node_a), in_b = b.tree.triangles(node_b);
    const auto single = [&](uint32_t triangle_a, uint32_t triangle_b) { // true to stop
        const MeetingPair pair{node_a, node_b, triangle_a, triangle_b};
        return (meets(pair) && take(pair)) || out_of_tests;
    };
    if (in_a.count == 0 && in_b.count == 0) return single(kNoTriangle, kNoTriangle);
    if (in_a.count == 0) {
        for (uint32_t t = in_b.first; t < in_b.first + in_b.count; ++t)
            if (single(kNoTriangle, t)) return true;
        return false;
    }
    if (in_b.count == 0) {
        for (uint32_t t = in_a.first; t < in_a.first + in_a.count; ++t)
            if (single(t, kNoTriangle)) return true;
        return false;
    }
    if (normal != glm::dvec3(0) && separated_along(normal, in_a, in_b)) return !spend(1);
    const uint32_t pair_count = in_a.count * in_b.count;
    if (all && !(skin > 0) && std::max(in_a.count, in_b.count) <= kFew && pair_count <= left()) {
        stats.triangle_tests += pair_count;
        uint32_t meeting = meetings_of_leaves(a.tree, in_a, b.tree, in_b, b_to_a, options.margin);
        for (; meeting != 0; meeting &= meeting - 1) {
            const auto i = static_cast<uint32_t>(std::countr_zero(meeting));
            take({node_a, node_b, in_a.first + i % in_a.count, in_b.first + i / in_a.count});
        }
        return false;
    }
    LeafResult first;
    const auto test = [&](TriangleRange some_a, TriangleRange some_b, float distance) {
        first = test_leaves(a.tree, some_a, b.tree, some_b, b_to_a, distance);
        return spend(first.pair_tests) && !first.meet;
    };
    if (separated_by_margin([&](float distance) { return test(in_a, in_b, distance); })) return false;
    if (out_of_tests) return true;
    if (!all) return take({node_a, node_b, first.triangle_a, first.triangle_b});
    for (uint32_t t = in_b.first; t < in_b.first + in_b.count; ++t)
        for (TriangleRange rest = in_a; rest.count > 0;) {
            if (test(rest, {t, 1}, options.margin)) break;
            if (out_of_tests) return true;
            take({node_a, node_b, first.triangle_a, t});
            rest = {first.triangle_a + 1, in_a.first + in_a.count - (first.triangle_a + 1)};
        }
    return false;
}

bool CollideSearch::meets(const MeetingPair& pair) noexcept {
    const bool in_a = pair.triangle_a != kNoTriangle, in_b = pair.triangle_b != kNoTriangle;
    if ((in_a || in_b) && !spend(1)) return false;
    return !separated_by_margin([&](float distance) {
        if (in_a && in_b)
            return separated(place(a.tree, pair.triangle_a), place(b.tree, pair.triangle_b, b_to_a), distance);
        const auto triangle_separated = [distance](const PlacedTriangle& x, const PlacedEllipsoid& y) {
            return distance == 0 ? separated(x, y) : query::distance(x, y).lower > distance;
        };
        if (in_a)
            return triangle_separated(place(a.tree, pair.triangle_a),
                                      place(b.tree.ellipsoid(pair.node_b), b.tree.scale(), b_to_a));
        if (in_b)
            return triangle_separated(place(b.tree, pair.triangle_b, b_to_a),
                                      place(a.tree.ellipsoid(pair.node_a), a.tree.scale()));
        const auto x = place(a.tree.ellipsoid(pair.node_a), a.tree.scale()),
                   y = place(b.tree.ellipsoid(pair.node_b), b.tree.scale(), b_to_a);
        return separated(x, y, distance);
    });
}

} // namespace prolate::query
