// collide() and collide_all(): the query around the traversal (search.cpp). Bodies are taken in their canonical order,
// a bounding-sphere test of the roots answers for most pairs of a scene, and a PairCache for bodies that have moved
// little.
#include "query/collide/search.hpp"
#include "query/inside/enclosure.hpp"
#include "query/node/scratch.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace prolate {

namespace {

// A lower bound on the distance of the bodies, by the slabs of their roots, where both have any.
double gap_of_flat_roots(const TreeView& a, const TreeView& b, const query::RelativePose& b_to_a, double margin) {
    return a.raw().has_slabs() && b.raw().has_slabs() ? query::gap_of_roots(a, b, b_to_a, margin) : -HUGE_VAL;
}

// What holds a tree's root, metres, as queries see it.
struct ScaledRoot {
    glm::dvec3 center, half; // of a box
    double radius, reach;    // of a ball about the same center; how far it reaches from the origin
};
ScaledRoot scaled_root(const TreeView& tree) {
    const detail::RootVolume& root = tree.raw().root();
    const auto& [center, radius, half, reach] = root;
    const double scale = tree.scale();
    return {glm::dvec3(center[0], center[1], center[2]) * scale, glm::dvec3(half[0], half[1], half[2]) * scale,
            radius * scale, reach * scale};
}

// A lower bound on the distance of the bodies, metres, by balls about their origins: whatever way they are turned, so
// that it comes before the relative pose, at a fifth of its cost. Not above 0, or NaN, if a pose is bad.
double gap_of_reaches(const TreeView& a, const Pose& pose_a, const TreeView& b, const Pose& pose_b) {
    const auto square = [](const Quat& q) {
        const double x = q.x, y = q.y, z = q.z, w = q.w;
        return x * x + y * y + z * z + w * w;
    };
    const double square_a = square(pose_a.rotation), square_b = square(pose_b.rotation);
    if (!(square_a > 0 && square_b > 0 && std::isfinite(square_a + square_b))) return 0;
    const double reach = a.raw().root().reach * a.scale() + b.raw().root().reach * b.scale();
    const double distance = glm::distance(query::to_double(pose_a.translation), query::to_double(pose_b.translation));
    return distance - reach - query::kSeparationMargin * (distance + reach);
}

// ---- coherence ----

// Near contact a skin costs more than the queries that it spares, unless the motion is small beside the gap. So there
// is one, somewhat thicker than the last motion, that a steady one be spared every other query, where that was small or
// the last skin nearly sufficed for it (bench_moving). Lengths are shares of the smaller root's.
constexpr double kFirstSkin = 0x1p-8, kThinnestSkin = 0x1p-12, kSmallMotion = 0x1p-11, kLargestMotion = 0x1p-5;
constexpr double kBeyondMotion = 1.1, kNearlySufficed = 0.6;
constexpr double kRoundDown = 1 - 0x1p-20;                          // more than the rounding of a float
constexpr double kLargestFloat = std::numeric_limits<float>::max(); // nothing moves out of an infinite distance

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
    // Both placements are rounded, by less than kSeparationMargin of all lengths (query/ellipsoid/separation.hpp).
    return std::sqrt(turned) * reach_b + glm::length(now.translation - before.translation) +
           query::kSeparationMargin * (2 * reach_b + before.distance + now.distance);
}

// Of a pair that was separated: how thick the next skin is, metres. `spared`: the motion that the last one allowed.
double next_skin(double moved, double spared, double smaller) {
    const bool worth_it =
        moved <= kSmallMotion * smaller || (moved <= kLargestMotion * smaller && spared >= kNearlySufficed * moved);
    return worth_it ? std::max(kBeyondMotion * moved, kThinnestSkin * smaller) : 0;
}

// Only whole searches are remembered: a level limit asks another question.
bool usable(const PairCache* cache, const TreeView& a, const TreeView& b, const QueryOptions& options) {
    return cache && options.max_level + 1 >= std::max(a.level_count(), b.level_count());
}

} // namespace

bool query::names_leaves(const MeetingPair& pair, const TreeView& a, const TreeView& b) noexcept {
    const auto good = [](const TreeView& tree, uint32_t node, uint32_t triangle) {
        if (node >= tree.slot_count() || !tree.is_node(node) || !tree.is_leaf(node)) return false;
        const TriangleRange range = tree.triangles(node);
        return range.count == 0 ? triangle == kNoTriangle : triangle - range.first < range.count;
    };
    return good(a, pair.node_a, pair.triangle_a) && good(b, pair.node_b, pair.triangle_b);
}

double query::gap_of_spheres(const TreeView& a, const TreeView& b, const RelativePose& b_to_a) noexcept {
    const ScaledRoot root_a = scaled_root(a), root_b = scaled_root(b);
    const glm::dvec3 center_b = b_to_a.rotation * root_b.center + b_to_a.translation;
    return glm::distance(root_a.center, center_b) - root_a.radius - root_b.radius -
           kSeparationMargin * (root_a.reach + root_b.reach + b_to_a.distance);
}

namespace {

// Boxes that overlap by less than this share of the smaller ball, along all sides, may still be apart along an axis
// across two of them. Nine axes cost as much as the rest: not worth it for bodies that are round.
constexpr double kEdgesMayTell = 0.2;

// What the axes across a side of either box tell; `slack` pays for all rounding of what lies along an axis of at most
// length 1, and the share of a length of 2^-10 or more is right to 2^-40 of itself.
double gap_across_sides(const ScaledRoot& a, const ScaledRoot& b, const glm::dmat3& to_a, const glm::dvec3& between,
                        double slack) {
    double gap = -HUGE_VAL;
    const auto look = [&](glm::length_t i, glm::length_t k) {
        const glm::length_t i1 = (i + 1) % 3, i2 = (i + 2) % 3, k1 = (k + 1) % 3, k2 = (k + 2) % 3;
        const double x = to_a[k][i1], y = to_a[k][i2]; // the axis is (0, -y, x), in the order i, i1, i2
        const double halves = (a.half[i1] * std::abs(y) + a.half[i2] * std::abs(x)) +
                              (b.half[k1] * std::abs(to_a[k2][i]) + b.half[k2] * std::abs(to_a[k1][i]));
        const double along = std::abs(between[i2] * x - between[i1] * y) - (halves + slack), square = x * x + y * y;
        if (along > 0 && square > 0x1p-20) gap = std::max(gap, along / (std::sqrt(square) * (1 + 0x1p-36)));
    };
    look(0, 0), look(0, 1), look(0, 2); // not in loops, which compilers keep
    look(1, 0), look(1, 1), look(1, 2);
    look(2, 0), look(2, 1), look(2, 2);
    return gap;
}

} // namespace

// The axes of S. Gottschalk, M. C. Lin, D. Manocha, "OBBTree: a hierarchical structure for rapid interference
// detection", SIGGRAPH 1996.
double query::gap_of_boxes(const TreeView& a, const TreeView& b, const RelativePose& b_to_a) noexcept {
    const ScaledRoot root_a = scaled_root(a), root_b = scaled_root(b);
    const glm::dmat3& to_a = b_to_a.rotation;
    const glm::dvec3 between = to_a * root_b.center + b_to_a.translation - root_a.center, seen_by_b = between * to_a;
    double gap = -HUGE_VAL, reach = b_to_a.distance;
    for (glm::length_t i = 0; i < 3; ++i) {
        double half_b = root_a.half[i], half_a = root_b.half[i]; // what both boxes take along the side of either
        for (glm::length_t k = 0; k < 3; ++k) {
            half_b += std::abs(to_a[k][i]) * root_b.half[k];
            half_a += std::abs(to_a[i][k]) * root_a.half[k];
        }
        gap = std::max(gap, std::max(std::abs(between[i]) - half_b, std::abs(seen_by_b[i]) - half_a));
        reach += std::abs(root_a.center[i]) + root_a.half[i] + std::abs(root_b.center[i]) + root_b.half[i];
    }
    const double slack = kSeparationMargin * reach;
    if (gap > 0 || gap < -kEdgesMayTell * std::min(root_a.radius, root_b.radius)) return gap - slack;
    return std::max(gap - slack, gap_across_sides(root_a, root_b, to_a, between, slack));
}

namespace {

// What the roots alone tell: a lower bound of the gap, metres, or of no use. Spheres settle most pairs of a scene, at a
// fifth of the cost. Of covers, boxes tell too little.
double gap_at_once(const TreeView& a, const TreeView& b, const query::RelativePose& b_to_a, double margin) {
    double gap = query::gap_of_spheres(a, b, b_to_a);
    if (!(gap > margin) && a.has_triangles() && b.has_triangles()) gap = query::gap_of_boxes(a, b, b_to_a);
    return gap > margin ? gap : gap_of_flat_roots(a, b, b_to_a, margin);
}

} // namespace

Verdict query::decide(CollideSearch& search) noexcept {
    if (search.all && search.options.max_pair_tests > 0 && // collide() has looked before
        gap_of_flat_roots(search.a.tree, search.b.tree, search.b_to_a, search.options.margin) > search.options.margin) {
        search.stats.pair_tests = 1;
        return Verdict::separated;
    }
    Verdict verdict = traverse(search);
    if (search.found > 0) verdict = Verdict::overlapping;
    search.stats.deepest_level = std::max(search.a.deepest_level(), search.b.deepest_level());
    if (verdict != Verdict::separated || !search.roots_meet) return verdict;
    return look_inside(search.a.tree, search.b.tree, search.b_to_a, search.stats, search.options.max_pair_tests);
}

CollideAllResult collide_all(const TreeView& a, const Pose& pose_a, const TreeView& b, const Pose& pose_b,
                             std::span<MeetingPair> pairs, Scratch context, const QueryOptions& options) noexcept {
    if (!query::suffices(context, a, b)) return {};
    const auto bodies = query::in_canonical_order(a, pose_a, b, pose_b);
    QueryOptions of_cores = options;
    of_cores.margin = query::with_radius(query::sound(options).margin, double{a.radius()} + b.radius());
    query::CollideSearch search(bodies, context, of_cores);
    search.all = true;
    search.pairs = pairs;
    const Verdict verdict = query::decide(search);
    if (bodies.exchanged)
        for (MeetingPair& pair : pairs.first(static_cast<size_t>(std::min<uint64_t>(search.found, pairs.size()))))
            pair = query::exchanged(pair);
    return {.verdict = verdict,
            .enclosed = verdict == Verdict::overlapping && search.found == 0,
            .found = search.found,
            .stats = search.stats};
}

CollideResult collide(const TreeView& a, const Pose& pose_a, const TreeView& b, const Pose& pose_b, Scratch context,
                      const QueryOptions& query_options, PairCache* cache) noexcept {
    if (!query::suffices(context, a, b)) return {};
    QueryOptions options = query::sound(query_options);
    options.margin = query::with_radius(options.margin, double{a.radius()} + b.radius());
    if (!usable(cache, a, b, options)) cache = nullptr;
    const auto remember = [&](Verdict verdict, const MeetingPair& pair, double distance) {
        *cache = {.verdict = verdict,
                  .pair = pair,
                  .distance = static_cast<float>(std::min(distance * kRoundDown, kLargestFloat)),
                  .pose_a = pose_a,
                  .pose_b = pose_b};
    };
    double moved = 0, smaller = 0;
    if (cache && cache->verdict != Verdict::overlapping) {
        const ScaledRoot root_a = scaled_root(a), root_b = scaled_root(b);
        smaller = std::min(root_a.radius, root_b.radius);
        if (cache->verdict == Verdict::separated) moved = motion(*cache, pose_a, pose_b, root_b.reach);
        if (cache->verdict == Verdict::separated && moved + options.margin < cache->distance)
            return {.verdict = Verdict::separated, .pair = {}, .stats = {}};
    }

    // A cache wants more than a lower bound of use.
    if (!cache && options.max_pair_tests > 0 && gap_of_reaches(a, pose_a, b, pose_b) > options.margin)
        return {.verdict = Verdict::separated, .pair = {}, .stats = {.pair_tests = 1}};
    const auto bodies = query::in_canonical_order(a, pose_a, b, pose_b);
    const query::RelativePose b_to_a = query::relative_pose(bodies.place_a, bodies.place_b);
    const double gap = gap_at_once(bodies.a, bodies.b, b_to_a, options.margin);
    if (gap > options.margin && options.max_pair_tests > 0) {
        if (cache) remember(Verdict::separated, {}, gap);
        return {.verdict = Verdict::separated, .pair = {}, .stats = {.pair_tests = 1}};
    }
    query::CollideSearch search(bodies.a, bodies.b, b_to_a, context, options);
    MeetingPair pair;
    search.pairs = {&pair, 1};
    const auto answer = [&](Verdict verdict) {
        if (bodies.exchanged) pair = query::exchanged(pair);
        return CollideResult{.verdict = verdict,
                             .enclosed = verdict == Verdict::overlapping && search.found == 0,
                             .pair = pair,
                             .stats = search.stats};
    };
    if (!cache) return answer(query::decide(search));

    if (cache->verdict == Verdict::overlapping && query::names_leaves(cache->pair, a, b)) {
        const MeetingPair last = bodies.exchanged ? query::exchanged(cache->pair) : cache->pair;
        if (search.meets(last)) {
            search.take(last);
            cache->pose_a = pose_a, cache->pose_b = pose_b;
            return answer(Verdict::overlapping);
        }
    }
    // Bodies that met a moment ago most often meet elsewhere, where a skin would be in the way.
    double skin = cache->verdict == Verdict::undecided ? kFirstSkin * smaller : 0;
    if (cache->verdict == Verdict::separated)
        skin = next_skin(moved, double{cache->distance} - double{options.margin}, smaller);
    search.set_skin(static_cast<float>(skin));
    const CollideResult result = answer(query::decide(search));
    remember(result.verdict, result.pair, double{options.margin} + search.skin);
    return result;
}

} // namespace prolate
