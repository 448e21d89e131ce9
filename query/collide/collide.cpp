// collide(): the query around the descent (descent.cpp). Bodies are taken in a fixed order, most pairs of a scene are
// told apart by spheres around their roots, and a PairCache answers for bodies that have moved little.
#include "query/collide/search.hpp"
#include "query/inside/enclosure.hpp"
#include "query/node/limits.hpp"
#include "query/node/order.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace prolate {
namespace {

// The whole query with the bodies in their fixed order.
Verdict run(query::Descent& d) {
    Verdict verdict = query::descend(d);
    if (d.found > 0) verdict = Verdict::overlapping;
    d.stats.deepest_level = std::max(d.a.deepest_level(), d.b.deepest_level());
    if (verdict != Verdict::separated || !d.roots_meet) return verdict;
    return query::look_inside(d.a.tree, d.b.tree, d.b_to_a, d.stats, d.options.max_pair_tests);
}

MeetingPair exchanged(const MeetingPair& pair) {
    return {pair.node_b, pair.node_a, pair.triangle_b, pair.triangle_a};
}

// ---- coherence ----

// Of the smaller root: the first skin, the thinnest and the thickest; and how many times as thick as the last motion.
constexpr double kFirstSkin = 0x1p-8, kThinnestSkin = 0x1p-12, kThickestSkin = 0x1p-5, kSkinSteps = 4;
constexpr double kRoundDown = 1 - 0x1p-20; // more than the rounding of a float

// No point of body B has moved farther than this, as body A sees it, metres; NaN if a pose is not finite.
// `reach_b`: no point of B is farther from its origin.
double motion(const PairCache& cache, const Pose& pose_a, const Pose& pose_b, double reach_b) {
    const query::RelativePose before = query::relative_pose(cache.pose_a, cache.pose_b);
    const query::RelativePose now = query::relative_pose(pose_a, pose_b);
    double turned = 0;
    for (glm::length_t c = 0; c < 3; ++c) {
        const glm::dvec3 column = now.rotation[c] - before.rotation[c];
        turned += glm::dot(column, column);
    }
    // Both placements are rounded, by less than kSeparationMargin of all lengths (separation.hpp).
    return std::sqrt(turned) * reach_b + glm::length(now.translation - before.translation) +
           query::kSeparationMargin * (2 * reach_b + before.distance + now.distance);
}

// The bodies are certainly so far apart, by spheres around their roots; NaN if the pose is not finite.
double gap_of_spheres(const TreeView& a, const TreeView& b, const query::RelativePose& b_to_a) {
    const query::PlacedEllipsoid root_a = query::place(a.bound(0)), root_b = query::place(b.bound(0));
    const glm::dvec3 center_b = b_to_a.rotation * root_b.center + b_to_a.translation;
    return glm::distance(root_a.center, center_b) - root_a.size - root_b.size -
           query::kSeparationMargin * (root_a.reach + root_b.reach + b_to_a.distance);
}

// Does the pair that the cache names exist?
bool names_leaves(const MeetingPair& pair, const TreeView& a, const TreeView& b) {
    const auto good = [](const TreeView& tree, uint32_t node, uint32_t triangle) {
        if (node >= tree.slot_count() || !tree.is_node(node) || !tree.is_leaf(node)) return false;
        const TriangleRange range = tree.triangles(node);
        return range.count == 0 ? triangle == kNoTriangle : triangle - range.first < range.count;
    };
    return good(a, pair.node_a, pair.triangle_a) && good(b, pair.node_b, pair.triangle_b);
}

// Only whole searches are remembered: a level limit asks another question.
bool usable(const PairCache* cache, const TreeView& a, const TreeView& b, const QueryOptions& options) {
    return cache && options.max_level + 1 >= std::max(a.level_count(), b.level_count());
}

} // namespace

CollideAllResult collide_all(const TreeView& a, const Pose& pose_a, const TreeView& b, const Pose& pose_b,
                             std::span<MeetingPair> pairs, QueryContext& context,
                             const QueryOptions& options) noexcept {
    const bool swap = query::must_swap(a, pose_a, b, pose_b);
    query::Descent descent = swap ? query::Descent(b, pose_b, a, pose_a, context, options)
                                  : query::Descent(a, pose_a, b, pose_b, context, options);
    descent.all = true;
    descent.pairs = pairs;
    const Verdict verdict = run(descent);
    if (swap)
        for (MeetingPair& pair : pairs.first(static_cast<size_t>(std::min<uint64_t>(descent.found, pairs.size()))))
            pair = exchanged(pair);
    return {verdict, verdict == Verdict::overlapping && descent.found == 0, descent.found, descent.stats};
}

CollideResult collide(const TreeView& a, const Pose& pose_a, const TreeView& b, const Pose& pose_b,
                      QueryContext& context, const QueryOptions& query_options, PairCache* cache) noexcept {
    const QueryOptions options = query::sound(query_options);
    if (!usable(cache, a, b, options)) cache = nullptr;
    double moved = 0, smaller = 0;
    if (cache) {
        const query::PlacedEllipsoid root_a = query::place(a.bound(0)), root_b = query::place(b.bound(0));
        smaller = std::min(root_a.size, root_b.size);
        if (cache->verdict != Verdict::undecided) moved = motion(*cache, pose_a, pose_b, root_b.reach);
        if (cache->verdict == Verdict::separated && moved + options.margin < cache->distance)
            return {Verdict::separated, false, {}, {}};
    }

    const bool swap = query::must_swap(a, pose_a, b, pose_b);
    const TreeView &first = swap ? b : a, &second = swap ? a : b;
    const query::RelativePose to_first =
        swap ? query::relative_pose(pose_b, pose_a) : query::relative_pose(pose_a, pose_b);
    const double gap = gap_of_spheres(first, second, to_first); // most pairs of a scene, at a fifth of the cost
    if (gap > options.margin && options.max_pair_tests > 0) {
        if (cache) *cache = {Verdict::separated, {}, static_cast<float>(gap * kRoundDown), pose_a, pose_b};
        return {Verdict::separated, false, {}, {.pair_tests = 1}};
    }
    query::Descent descent(first, second, to_first, context, options);
    MeetingPair pair;
    descent.pairs = {&pair, 1};
    const auto answer = [&](Verdict verdict) {
        if (swap) pair = exchanged(pair);
        return CollideResult{verdict, verdict == Verdict::overlapping && descent.found == 0, pair, descent.stats};
    };
    if (!cache) return answer(run(descent));

    if (cache->verdict == Verdict::overlapping && names_leaves(cache->pair, a, b)) {
        const MeetingPair last = swap ? exchanged(cache->pair) : cache->pair;
        if (descent.meets(last)) {
            descent.take(last);
            cache->pose_a = pose_a, cache->pose_b = pose_b;
            return answer(Verdict::overlapping);
        }
    }
    const double skin = cache->verdict == Verdict::undecided
                            ? kFirstSkin * smaller
                            : std::clamp(kSkinSteps * moved, kThinnestSkin * smaller, kThickestSkin * smaller);
    descent.set_skin(static_cast<float>(skin));
    const CollideResult result = answer(run(descent));
    const double distance = double{options.margin} + descent.skin;
    *cache = {result.verdict, result.pair, static_cast<float>(distance * kRoundDown), pose_a, pose_b};
    return result;
}

} // namespace prolate
