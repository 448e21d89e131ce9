// overlap(): the queries around the traversal (search.cpp).
#include "query/inside/inside.hpp"
#include "query/node/scratch.hpp"
#include "query/shapes/search.hpp"

namespace prolate::query {
namespace {

// Does the solid hold the shape, which no triangle meets? A closed surface that is separated from the shape holds it
// wholly or not at all: its center tells.
Verdict holds(BoxSearch& search) {
    const TreeView& tree = search.side.tree;
    if (!search.root_met || !tree.has_triangles() || tree.surface_mode()) return Verdict::separated;
    const auto winding = winding_number(tree, {search.shape.center, search.shape.reach}, search.result.stats,
                                        search.options.max_pair_tests);
    if (!winding) return Verdict::undecided;
    search.result.enclosed = *winding != 0;
    return *winding != 0 ? Verdict::overlapping : Verdict::separated;
}

template <class Search> OverlapResult finish(Search& search, Verdict verdict) {
    search.result.verdict = verdict;
    search.result.stats.deepest_level = search.side.deepest_level();
    return search.result;
}

OverlapResult overlap_with(const TreeView& tree, const RoundedBox& shape, Scratch context,
                           const QueryOptions& options) {
    BoxSearch search{.side = tree_side(tree, options.max_level),
                     .shape = shape,
                     .lanes = lane_rounded_box(shape, tree.raw().lattice()),
                     .options = options,
                     .stack = context.entries(),
                     .result = {}};
    Verdict verdict = traverse(search);
    if (verdict == Verdict::separated) verdict = holds(search);
    return finish(search, verdict);
}

OverlapResult overlap_with(const TreeView& tree, const PlacedHalfSpace& shape, Scratch context,
                           const QueryOptions& options) {
    HalfSpaceSearch search{.side = tree_side(tree, options.max_level),
                           .shape = shape,
                           .lanes = lane_half_space(shape, tree.raw().lattice()),
                           .options = options,
                           .stack = context.entries(),
                           .result = {}};
    return finish(search, traverse(search));
}

// Shapes of the world: they are placed in the frame of the tree, blown up by the margin.
template <class Shape>
OverlapResult overlap_placed(const TreeView& tree, const Pose& pose, const Shape& shape, Scratch context,
                             const QueryOptions& query_options) {
    if (!suffices(context, tree)) return {};
    QueryOptions options = sound(query_options);
    options.margin = with_radius(options.margin, tree.radius());
    return overlap_with(tree, place(shape, pose, options.margin), context, options);
}

} // namespace
} // namespace prolate::query

namespace prolate {

OverlapResult overlap(const TreeView& tree, const Pose& pose, const Sphere& sphere, Scratch context,
                      const QueryOptions& options) noexcept {
    return query::overlap_placed(tree, pose, sphere, context, options);
}
OverlapResult overlap(const TreeView& tree, const Pose& pose, const Capsule& capsule, Scratch context,
                      const QueryOptions& options) noexcept {
    return query::overlap_placed(tree, pose, capsule, context, options);
}
OverlapResult overlap(const TreeView& tree, const Pose& pose, const Box& box, Scratch context,
                      const QueryOptions& options) noexcept {
    return query::overlap_placed(tree, pose, box, context, options);
}
OverlapResult overlap(const TreeView& tree, const Pose& pose, const HalfSpace& half_space, Scratch context,
                      const QueryOptions& options) noexcept {
    return query::overlap_placed(tree, pose, half_space, context, options);
}

} // namespace prolate
