// collide_solids() and distance_solids(): collide() and distance() of outer and of inner covers.
//
// What is certain of the inner covers: collide() calls leaves overlapping that rounding cannot tell apart, so the pair
// that it names is asked again. test_pair() says `overlapping` only where a common point is certain
// (query/ellipsoid/separation.hpp), and the upper bounds of distance_of() and depth_of() are certified
// (query/ellipsoid/gap.hpp).
#include <prolate/solids.hpp>

#include "query/ellipsoid/gap.hpp"
#include "query/node/limits.hpp"
#include "query/node/scratch.hpp"

#include <algorithm>
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

// Both bodies, and what of the budget is spent.
struct Solids {
    const TreeView &a, &b;
    const Pose &pose_a, &pose_b;
    const Scratch scratch;
    const uint32_t level;
    const uint64_t budget;
    QueryStats stats = {};
    std::optional<TreeView> inner_a = {}, inner_b = {}; // once they are looked for

    bool may_be_asked() const { return is_solid(a) && is_solid(b) && query::suffices(scratch, a, b); }
    bool are_triangles() const { return a.has_triangles() && b.has_triangles(); }
    bool find_inner() {
        inner_a = inner_cover(a, level);
        if (inner_a) inner_b = inner_cover(b, level);
        return inner_a && inner_b && query::suffices(scratch, *inner_a, *inner_b);
    }

    Verdict collide(const TreeView& x, const TreeView& y, float margin, MeetingPair& pair) {
        const CollideResult out =
            prolate::collide(x, pose_a, y, pose_b, scratch,
                             {.max_pair_tests = query::tests_left(budget, stats.tests()), .margin = margin});
        query::add(out.stats, stats);
        pair = out.pair;
        return out.verdict;
    }
    Verdict outer_meet(float margin) {
        MeetingPair pair;
        return collide(outer_cover(a, level), outer_cover(b, level), margin, pair);
    }

    // Do the inner covers, or what takes their place, certainly come within the margin of each other, even if they are
    // displaced by `uncertainty`? Undecided if the budget ended first.
    Verdict inner_meet(float margin, float uncertainty) {
        const TreeView &x = *inner_a, &y = *inner_b;
        MeetingPair pair;
        const Verdict verdict = collide(x, y, margin, pair);
        if (verdict != Verdict::overlapping || x.has_triangles() || y.has_triangles()) return verdict;
        const query::PlacedEllipsoid p = query::place(x.ellipsoid(pair.node_a), x.scale()),
                                     q = query::place(y.ellipsoid(pair.node_b), y.scale(),
                                                      query::relative_pose(pose_a, pose_b));
        const double within =
            double{query::sound_length(margin)} + x.radius() + y.radius() - double{query::sound_length(uncertainty)};
        const bool certain = within == 0  ? query::test_pair(p, q).verdict == query::PairVerdict::overlapping
                             : within > 0 ? query::distance_of(p, q, 0).upper <= within
                                          : query::depth_of(p, q, 0).upper <= within;
        return certain ? Verdict::overlapping : Verdict::separated; // as far as can be told
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
