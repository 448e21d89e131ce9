// collide_solids() and distance_solids(): collide() and distance() of outer and of inner covers.
//
// What is certain of the inner covers: collide() calls leaves overlapping that rounding cannot tell apart, so the pair
// that it names is asked again. test_pair() says `overlapping` only where a common point is certain
// (query/ellipsoid/separation.hpp), and the upper bounds of distance_of(), depth_of() (query/ellipsoid/gap.hpp) and of
// the distance of a triangle and an ellipsoid are certified. An ellipsoid that no triangle meets is within the solid by
// more than the winding number of its center could be wrong by.
#include <prolate/solids.hpp>

#include "query/ellipsoid/gap.hpp"
#include "query/node/limits.hpp"
#include "query/node/scratch.hpp"
#include "query/triangle/ellipsoid_distance.hpp"

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <cmath>
#include <optional>

namespace prolate {
namespace {

// What holds a solid: an exact tree is the solid, of another all levels cover it.
TreeView outer_cover(const TreeView& tree, uint32_t level) {
    return tree.has_triangles() ? tree : tree.coarser(level);
}
// What lies in it.
std::optional<TreeView> inner_cover(const TreeView& tree, uint32_t level) {
    if (const auto inner = tree.inner()) return inner->coarser(level);
    return tree.has_triangles() ? std::optional(tree) : std::nullopt;
}
bool is_solid(const TreeView& tree) {
    return tree.has_triangles() || !tree.is_exact(); // not a prefix of an exact tree
}

// Do two leaves certainly come within `within` of each other? If it is negative: do they meet, even if one of them is
// displaced by that much?
bool come_within(const query::PlacedEllipsoid& a, const query::PlacedEllipsoid& b, double within) {
    if (within == 0) return query::test_pair(a, b).verdict == query::PairVerdict::overlapping;
    return (within > 0 ? query::distance_of(a, b, 0) : query::depth_of(a, b, 0)).upper <= within;
}
// Here, some point x = c + L u + e of the triangle must lie in the ellipsoid, for which |u| + |e| / w <= 1 suffices, w
// the smallest semi-axis. That also holds for the rounding of x itself.
bool come_within(const query::PlacedTriangle& a, const query::PlacedEllipsoid& b, double within) {
    const query::TriangleDistance d = query::distance(a, b);
    if (within > 0 && d.upper <= within) return true;
    const glm::dvec3 x = d.on_a - b.center, u = glm::inverse(b.factor) * x;
    const double off = glm::length(x - b.factor * u) + query::kSeparationMargin * (a.reach + b.reach);
    return glm::length(u) + (off - std::min(within, 0.0)) / query::least_width(b.factor, b.size) <= 1 - 0x1p-40;
}

// Both bodies, and what of the budget is spent.
struct Solids {
    const TreeView &a, &b;
    const Pose &pose_a, &pose_b;
    const Scratch scratch;
    const uint32_t level;
    const uint64_t budget;
    const query::RelativePose b_to_a = query::relative_pose(pose_a, pose_b);
    QueryStats stats = {};
    std::optional<TreeView> inner_a = {}, inner_b = {}; // once they are looked for

    bool may_be_asked() const {
        return is_solid(a) && is_solid(b) && query::suffices(scratch, a, b) && std::isfinite(b_to_a.distance);
    }
    bool are_triangles() const { return a.has_triangles() && b.has_triangles(); }
    bool find_inner() {
        inner_a = inner_cover(a, level);
        if (inner_a) inner_b = inner_cover(b, level);
        return inner_a && inner_b && query::suffices(scratch, *inner_a, *inner_b);
    }

    CollideResult collide(const TreeView& x, const TreeView& y, float margin) {
        const CollideResult out =
            prolate::collide(x, pose_a, y, pose_b, scratch,
                             {.max_pair_tests = query::tests_left(budget, stats.tests()), .margin = margin});
        query::add(out.stats, stats);
        return out;
    }
    Verdict outer_meet(float margin) { return collide(outer_cover(a, level), outer_cover(b, level), margin).verdict; }

    // Do the inner covers, or what takes their place, certainly come within the margin of each other, even if they are
    // displaced by `uncertainty`? Undecided if the budget ended first.
    Verdict inner_meet(float margin, float uncertainty) {
        margin = query::sound_length(margin), uncertainty = query::sound_length(uncertainty);
        // The pair that is named is as near as that, so that it is certain but for rounding.
        const CollideResult found = collide(*inner_a, *inner_b, std::max(0.0f, margin - uncertainty));
        if (found.verdict != Verdict::overlapping) return found.verdict;
        const double within = double{margin} + inner_a->radius() + inner_b->radius() - double{uncertainty};
        return come_within(found, within) ? Verdict::overlapping : Verdict::separated; // as far as can be told
    }
    bool come_within(const CollideResult& found, double within) const {
        if (found.enclosed) return within >= 0 || leaves_hold_ball(-within);
        const MeetingPair& pair = found.pair;
        const auto ellipsoid_a = [&] { return query::place(inner_a->ellipsoid(pair.node_a), inner_a->scale()); };
        const auto ellipsoid_b = [&] {
            return query::place(inner_b->ellipsoid(pair.node_b), inner_b->scale(), b_to_a);
        };
        if (pair.triangle_a != kNoTriangle)
            return prolate::come_within(query::place(*inner_a, pair.triangle_a), ellipsoid_b(), within);
        if (pair.triangle_b != kNoTriangle)
            return prolate::come_within(query::place(*inner_b, pair.triangle_b, b_to_a), ellipsoid_a(), within);
        return prolate::come_within(ellipsoid_a(), ellipsoid_b(), within);
    }

    // Of ellipsoids among triangles: as no triangle meets them, their centers are at least that far from these.
    bool leaves_hold_ball(double radius) const {
        const TreeView& covers = inner_a->has_triangles() ? *inner_b : *inner_a;
        bool all = true;
        covers.for_each_in_cut(covers.level_count() - 1, [&](uint32_t node) {
            const query::PlacedEllipsoid e = query::place(covers.ellipsoid(node), covers.scale());
            all = all && query::least_width(e.factor, e.size) >= radius;
        });
        return all;
    }

    DistanceResult distance(const TreeView& x, const TreeView& y, DistanceOptions options) {
        options.max_pair_tests = query::tests_left(budget, stats.tests());
        options.max_level = kMaxLevels;
        const DistanceResult out = prolate::distance(x, pose_a, y, pose_b, scratch, options);
        query::add(out.stats, stats);
        return out;
    }
};

} // namespace

SolidsResult collide_solids(const TreeView& a, const Pose& pose_a, const TreeView& b, const Pose& pose_b,
                            Scratch context, const SolidsOptions& options) noexcept {
    Solids solids{a, b, pose_a, pose_b, context, options.max_level, options.max_pair_tests};
    if (!solids.may_be_asked()) return {};
    const auto answer = [&](Verdict verdict, bool out_of_budget = false) {
        return SolidsResult{verdict, out_of_budget, solids.stats};
    };
    const Verdict outer = solids.outer_meet(
        query::with_radius(query::sound_length(options.margin), double{query::sound_length(options.uncertainty)}));
    if (outer != Verdict::overlapping || solids.are_triangles()) return answer(outer, outer == Verdict::undecided);
    if (!solids.find_inner()) return answer(Verdict::undecided);
    const Verdict inner = solids.inner_meet(options.margin, options.uncertainty);
    return inner == Verdict::overlapping ? answer(inner) : answer(Verdict::undecided, inner == Verdict::undecided);
}

SolidsDistance distance_solids(const TreeView& a, const Pose& pose_a, const TreeView& b, const Pose& pose_b,
                               Scratch context, const DistanceOptions& options) noexcept {
    Solids solids{a, b, pose_a, pose_b, context, options.max_level, options.max_pair_tests};
    if (!solids.may_be_asked()) return {};
    SolidsDistance out;
    const auto answer = [&] {
        out.stats = solids.stats;
        return out;
    };
    const DistanceResult outer =
        solids.distance(outer_cover(a, options.max_level), outer_cover(b, options.max_level), options);
    out.lower = outer.lower;
    if (outer.verdict == Verdict::separated) out.verdict = Verdict::separated;
    if (solids.are_triangles()) {
        out.verdict = outer.verdict, out.upper = outer.upper;
        return answer();
    }
    if (out.lower >= query::sound_length(options.max_distance) || !solids.find_inner()) return answer();
    if (out.lower == 0 && solids.inner_meet(0, 0) == Verdict::overlapping) {
        out.verdict = Verdict::overlapping, out.upper = 0;
        return answer();
    }
    out.upper = solids.distance(*solids.inner_a, *solids.inner_b, options).upper;
    return answer();
}

} // namespace prolate
