// A simple shape against a tree: eight children at a time.
//
// Children that the culling tests (shape_lanes-inl.hpp) do not part from the shape wait on a stack, the deepest overlap
// on top; leaves are decided in double precision (rounded_box.hpp). A closed exact tree whose triangles all are apart
// from the shape holds it wholly or not at all: its center tells.
//
// Sound because a node's bounding volume holds all leaves below it: if the shape is apart from the node, it is from
// these.
//
// Complexity: one block test for each node that is opened.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "query/shapes/shapes.cpp"
#include "query/simd/targets.hpp" // before foreach_target.h

#include <hwy/foreach_target.h>

#include "query/inside/inside.hpp"
#include "query/node/limits.hpp"
#include "query/node/tree_side.hpp"
#include "query/shapes/lanes-inl.hpp"
#include "query/shapes/rounded_box.hpp"

#include <prolate/shapes.hpp>

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#ifndef PROLATE_QUERY_SHAPES_ONCE // what the targets share
#define PROLATE_QUERY_SHAPES_ONCE
namespace prolate::query {

// One overlap() query of a RoundedBox or a PlacedHalfSpace, as its lanes see it.
template <class Shape, class LaneShape> struct ShapeQuery {
    TreeSide body;
    const Shape shape;
    const LaneShape lanes;
    const QueryOptions& options;
    QueryContext::Entry* const stack;
    OverlapResult result;
    bool root_met = false;

    // Decides on a leaf.
    bool meets(uint32_t leaf) noexcept {
        const TriangleRange triangles = body.tree.triangles(leaf);
        for (uint32_t t = triangles.first; t < triangles.first + triangles.count; ++t) {
            ++result.stats.triangle_tests;
            if (!apart(place(body.tree, t), shape)) return take(leaf, t);
        }
        return triangles.count == 0 && !apart(place(body.tree.ellipsoid(leaf)), shape) && take(leaf, kNoTriangle);
    }
    bool take(uint32_t node, uint32_t triangle) noexcept {
        result.node = node, result.triangle = triangle;
        return true;
    }
};
using BoxQuery = ShapeQuery<RoundedBox, LaneRoundedBox>;
using HalfSpaceQuery = ShapeQuery<PlacedHalfSpace, LaneHalfSpace>;

} // namespace prolate::query
#endif // PROLATE_QUERY_SHAPES_ONCE

HWY_BEFORE_NAMESPACE();
namespace prolate::query::HWY_NAMESPACE {
namespace {

template <class Query> class ShapeSearch {
public:
    explicit ShapeSearch(Query& query) : q_(query), stack_(query.stack) {}

    Verdict run() {
        if (!test(0, 1)) return Verdict::undecided;
        q_.root_met = size_ > 0;
        while (size_ > 0) {
            const uint32_t node = stack_[--size_].node_a;
            const ChildRange children = q_.body.tree.children(node);
            if (children.count == 0) {
                if (q_.body.tree.triangles(node).count > left()) return Verdict::undecided;
                if (q_.meets(node)) return Verdict::overlapping;
                continue;
            }
            if (node >= q_.body.limit_from) { // max_level ends the descent
                q_.take(node, kNoTriangle);
                return Verdict::overlapping;
            }
            for (uint32_t i = 0; i < children.count; i += kBlockLanes)
                if (!test(children.first + i, std::min(children.count - i, kBlockLanes))) return Verdict::undecided;
        }
        return Verdict::separated;
    }

private:
    uint64_t left() const { // of the budget
        return q_.options.max_pair_tests - std::min(q_.options.max_pair_tests, q_.result.stats.tests());
    }

    // One block: puts the lanes that may meet the shape on the stack, the deepest last. False if the tests run out.
    bool test(uint32_t first, uint32_t count) {
        QueryStats& stats = q_.result.stats;
        if (count > left()) return false;
        stats.pair_tests += count, ++stats.block_tests;
        q_.body.deepest = std::max(q_.body.deepest, first + count - 1);
        const std::byte* const block = q_.body.block(first);
        uint32_t meet = boxes_meet_shape(block, q_.lanes) & ((1u << count) - 1);
        if (meet == 0) return true;
        alignas(32) float keys[kBlockLanes];
        uint32_t parted = 0;
        for (size_t i = 0; i < kBlockLanes; i += kFloatLanes) {
            const LaneGaps gaps = shape_gaps(load_nodes(block, i, q_.body.lattice.step_exponent), q_.lanes);
            parted |= bits(gaps.gap > 0) << i;
            store(gaps.key, keys + i);
        }
        meet &= ~parted;
        uint32_t deepest = size_;
        float least = HUGE_VALF;
        for (; meet != 0; meet &= meet - 1) {
            const auto lane = static_cast<uint32_t>(std::countr_zero(meet));
            if (keys[lane] < least) least = keys[lane], deepest = size_;
            stack_[size_++] = {first + lane, 0, keys[lane], 0};
        }
        if (deepest < size_) std::swap(stack_[deepest], stack_[size_ - 1]);
        return true;
    }

    Query& q_;
    QueryContext::Entry* const stack_;
    uint32_t size_ = 0;
};

Verdict search_box(BoxQuery& query) {
    return ShapeSearch(query).run();
}
Verdict search_half_space(HalfSpaceQuery& query) {
    return ShapeSearch(query).run();
}

} // namespace
} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace prolate::query {
namespace {

HWY_EXPORT(search_box);
HWY_EXPORT(search_half_space);

// Does the solid hold the shape, which no triangle meets?
Verdict holds(BoxQuery& query) {
    const TreeView& tree = query.body.tree;
    if (!query.root_met || !tree.has_triangles() || tree.surface_mode()) return Verdict::separated;
    const auto winding =
        winding_number(tree, {query.shape.center, query.shape.reach}, query.result.stats, query.options.max_pair_tests);
    if (!winding) return Verdict::undecided;
    query.result.enclosed = *winding != 0;
    return *winding != 0 ? Verdict::overlapping : Verdict::separated;
}

template <class Query> OverlapResult finish(Query& query, Verdict verdict) {
    query.result.verdict = verdict;
    query.result.stats.deepest_level = query.body.deepest_level();
    return query.result;
}

OverlapResult overlap_with(const TreeView& tree, const RoundedBox& shape, QueryContext& context,
                           const QueryOptions& options) {
    BoxQuery query{.body = tree_side(tree, options.max_level),
                   .shape = shape,
                   .lanes = lane_rounded_box(shape, tree.lattice()),
                   .options = options,
                   .stack = context.entries,
                   .result = {}};
    Verdict verdict = HWY_DYNAMIC_DISPATCH(search_box)(query);
    if (verdict == Verdict::separated) verdict = holds(query);
    return finish(query, verdict);
}

OverlapResult overlap_with(const TreeView& tree, const PlacedHalfSpace& shape, QueryContext& context,
                           const QueryOptions& options) {
    HalfSpaceQuery query{.body = tree_side(tree, options.max_level),
                         .shape = shape,
                         .lanes = lane_half_space(shape, tree.lattice()),
                         .options = options,
                         .stack = context.entries,
                         .result = {}};
    return finish(query, HWY_DYNAMIC_DISPATCH(search_half_space)(query));
}

} // namespace
} // namespace prolate::query

namespace prolate {

OverlapResult overlap(const TreeView& tree, const Pose& pose, const Sphere& sphere, QueryContext& context,
                      const QueryOptions& query_options) noexcept {
    const QueryOptions options = query::sound(query_options);
    return query::overlap_with(tree, query::place(sphere, pose, options.margin), context, options);
}
OverlapResult overlap(const TreeView& tree, const Pose& pose, const Capsule& capsule, QueryContext& context,
                      const QueryOptions& query_options) noexcept {
    const QueryOptions options = query::sound(query_options);
    return query::overlap_with(tree, query::place(capsule, pose, options.margin), context, options);
}
OverlapResult overlap(const TreeView& tree, const Pose& pose, const Box& box, QueryContext& context,
                      const QueryOptions& query_options) noexcept {
    const QueryOptions options = query::sound(query_options);
    return query::overlap_with(tree, query::place(box, pose, options.margin), context, options);
}
OverlapResult overlap(const TreeView& tree, const Pose& pose, const HalfSpace& half_space, QueryContext& context,
                      const QueryOptions& query_options) noexcept {
    const QueryOptions options = query::sound(query_options);
    return query::overlap_with(tree, query::place(half_space, pose, options.margin), context, options);
}

} // namespace prolate
#endif // HWY_ONCE
