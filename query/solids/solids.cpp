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

// What holds a solid, and what lies in it; nothing of what is no solid.
struct Covers {
    std::optional<TreeView> outer, inner;
};

Covers covers_of(const TreeView& tree, uint32_t level) {
    if (tree.has_triangles()) return {tree, tree.inner() ? tree.inner()->coarser(level) : tree};
    if (tree.is_exact()) return {}; // a prefix
    Covers out{tree.coarser(level), tree.inner()};
    if (out.inner) out.inner = out.inner->coarser(level);
    return out;
}

// Both bodies, and what of the budget is spent.
struct Solids {
    const Covers a, b;
    const Pose &pose_a, &pose_b;
    const Scratch scratch;
    const uint64_t budget;
    QueryStats stats = {};

    bool are_solids() const { return a.outer && b.outer; }
    bool are_triangles() const { return a.outer->has_triangles() && b.outer->has_triangles(); }
    bool have_inner() const { return a.inner && b.inner; }
    bool scratch_suffices() const {
        return query::suffices(scratch, *a.outer, *b.outer) &&
               (!have_inner() || query::suffices(scratch, *a.inner, *b.inner));
    }

    Verdict collide(const TreeView& x, const TreeView& y, float margin, MeetingPair& pair) {
        const CollideResult out =
            prolate::collide(x, pose_a, y, pose_b, scratch,
                             {.max_pair_tests = query::tests_left(budget, stats.tests()), .margin = margin});
        query::add(out.stats, stats);
        pair = out.pair;
        return out.verdict;
    }

    // Do the inner covers, or what takes their place, certainly come within the margin of each other, even if they are
    // displaced by `uncertainty`? Undecided if the budget ended first.
    Verdict inner_meet(float margin, float uncertainty) {
        MeetingPair pair;
        const Verdict verdict = collide(*a.inner, *b.inner, margin, pair);
        if (verdict != Verdict::overlapping || a.inner->has_triangles() || b.inner->has_triangles()) return verdict;
        const query::PlacedEllipsoid x = query::place(a.inner->ellipsoid(pair.node_a), a.inner->scale()),
                                     y = query::place(b.inner->ellipsoid(pair.node_b), b.inner->scale(),
                                                      query::relative_pose(pose_a, pose_b));
        const double within = double{query::sound_length(margin)} + a.inner->radius() + b.inner->radius() -
                              double{query::sound_length(uncertainty)};
        const bool certain = within == 0  ? query::test_pair(x, y).verdict == query::PairVerdict::overlapping
                             : within > 0 ? query::distance_of(x, y, 0).upper <= within
                                          : query::depth_of(x, y, 0).upper <= within;
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
    Solids solids{covers_of(a, options.max_level), covers_of(b, options.max_level), pose_a, pose_b, context,
                  options.max_pair_tests};
    if (!solids.are_solids() || !solids.scratch_suffices()) return {};
    const auto answer = [&](Verdict verdict, bool out_of_budget = false) {
        return SolidsResult{verdict, out_of_budget, solids.stats};
    };
    // Triangles decide everything, so what is cheaper goes first.
    const bool inner_first = solids.are_triangles() && !solids.a.inner->has_triangles();
    if (inner_first && solids.inner_meet(options.margin, options.uncertainty) == Verdict::overlapping)
        return answer(Verdict::overlapping);
    MeetingPair pair;
    const float margin =
        query::with_radius(query::sound_length(options.margin), double{query::sound_length(options.uncertainty)});
    const Verdict outer = solids.collide(*solids.a.outer, *solids.b.outer, margin, pair);
    if (outer != Verdict::overlapping || solids.are_triangles()) return answer(outer, outer == Verdict::undecided);
    if (!solids.have_inner()) return answer(Verdict::undecided);
    const Verdict inner = solids.inner_meet(options.margin, options.uncertainty);
    return inner == Verdict::overlapping ? answer(inner) : answer(Verdict::undecided, inner == Verdict::undecided);
}

SolidsDistance distance_solids(const TreeView& a, const Pose& pose_a, const TreeView& b, const Pose& pose_b,
                               Scratch context, const DistanceOptions& options) noexcept {
    Solids solids{covers_of(a, options.max_level), covers_of(b, options.max_level), pose_a, pose_b, context,
                  options.max_pair_tests};
    if (!solids.are_solids() || !solids.scratch_suffices()) return {};
    SolidsDistance out;
    const auto answer = [&] {
        out.stats = solids.stats;
        return out;
    };
    const DistanceResult outer = solids.distance(*solids.a.outer, *solids.b.outer, options);
    out.lower = outer.lower;
    if (outer.verdict == Verdict::separated) out.verdict = Verdict::separated;
    if (solids.are_triangles()) {
        out.verdict = outer.verdict, out.upper = outer.upper;
        return answer();
    }
    if (!solids.have_inner() || out.lower >= query::sound_length(options.max_distance)) return answer();
    if (out.lower == 0 && solids.inner_meet(0, 0) == Verdict::overlapping) {
        out.verdict = Verdict::overlapping, out.upper = 0;
        return answer();
    }
    out.upper = solids.distance(*solids.a.inner, *solids.b.inner, options).upper;
    return answer();
}

} // namespace prolate
