// collide() and distance() of solids: those of outer and of inner covers.
//
// What is certain of the inner covers: searches call leaves overlapping that rounding cannot tell apart, so the pair
// that they name is asked again. test_pair() says `overlapping` only where a common point is certain
// (query/ellipsoid/separation.hpp), and the upper bounds of distance_of(), depth_of() (query/ellipsoid/gap.hpp) and of
// the distance of a triangle and an ellipsoid are certified. An ellipsoid that no triangle meets is within the solid by
// more than the winding number of its center could be wrong by.
#include "query/solids/solids.hpp"

#include "query/ellipsoid/depth.hpp"
#include "query/ellipsoid/gap.hpp"
#include "query/node/scratch.hpp"
#include "query/triangle/ellipsoid_distance.hpp"

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <cmath>

namespace prolate {

Solid::Solid(const TreeView& tree, uint32_t max_level) noexcept
    : outer_(tree.has_triangles() ? tree : tree.coarser(max_level)), inner_(tree.inner()) {
    if (inner_) inner_ = inner_->coarser(max_level);
}

namespace query {
namespace {

// Do two leaves certainly come within `within` of each other? If it is negative: do they meet, even if one of them is
// displaced by that much?
bool certainly_within(const PlacedEllipsoid& a, const PlacedEllipsoid& b, double within) {
    if (within == 0) return test_pair(a, b).verdict == PairVerdict::overlapping;
    return (within > 0 ? distance_of(a, b, 0) : depth_of(a, b, 0)).upper <= within;
}
// Here, some point x = c + L u + e of the triangle must lie in the ellipsoid, for which |u| + |e| / w <= 1 suffices, w
// the smallest semi-axis. That also holds for the rounding of x itself.
bool certainly_within(const PlacedTriangle& a, const PlacedEllipsoid& b, double within) {
    const TriangleDistance d = distance(a, b);
    if (within > 0 && d.upper <= within) return true;
    const glm::dvec3 x = d.on_a - b.center, u = glm::inverse(b.factor) * x;
    const double off = glm::length(x - b.factor * u) + kSeparationMargin * (a.reach + b.reach);
    return glm::length(u) + (off - std::min(within, 0.0)) / least_width(b.factor, b.size) <= 1 - 0x1p-40;
}

// Is handed pairs of inner ellipsoids that meet. A loose bound of each costs little; the pair that is deepest along the
// direction that it gives is looked at again.
struct Deepest {
    const CollideSearch& search;
    double bound = -HUGE_VAL, estimate = 0; // of the cores
    MeetingPair deepest = {};

    PlacedEllipsoid a(const MeetingPair& pair) const {
        return place(search.a.tree.ellipsoid(pair.node_a), search.a.tree.scale());
    }
    PlacedEllipsoid b(const MeetingPair& pair) const {
        return place(search.b.tree.ellipsoid(pair.node_b), search.b.tree.scale(), search.b_to_a);
    }
    void look(const MeetingPair& pair) {
        const Gap gap = distance_of(a(pair), b(pair), 0);
        bound = std::max(bound, -gap.upper);
        if (-gap.lower > estimate) estimate = -gap.lower, deepest = pair;
    }
    double depth() const {
        return estimate > 0 ? std::max(bound, least_depth(a(deepest), b(deepest), std::max(0.0, bound))) : bound;
    }
};

} // namespace

bool SolidPair::may_be_asked() const noexcept {
    return first_.is_known() && second_.is_known() && suffices(context_, bodies_.a, bodies_.b) &&
           std::isfinite(b_to_a_.distance);
}

bool SolidPair::have_inner() const noexcept {
    return first_.inner() != nullptr && second_.inner() != nullptr && suffices(context_, inner_a(), inner_b());
}

Verdict SolidPair::outer_meet(float margin) noexcept {
    margin = with_radius(margin, double{bodies_.a.radius()} + bodies_.b.radius());
    if (left() > 0 && gap_of_spheres(bodies_.a, bodies_.b, b_to_a_) > margin) {
        ++stats.pair_tests;
        return Verdict::separated;
    }
    CollideSearch search(bodies_.a, bodies_.b, b_to_a_, context_, {.max_pair_tests = left(), .margin = margin});
    const Verdict verdict = decide(search);
    add(search.stats, stats);
    return verdict;
}

Verdict SolidPair::inner_meet(float margin, float uncertainty, DistanceCache* cache) noexcept {
    const double radii = double{inner_a().radius()} + inner_b().radius();
    // The pair that is named is as near as that, so that it is certain but for rounding.
    const float nearly = with_radius(std::max(0.0f, margin - uncertainty), radii);
    CollideSearch search(inner_a(), inner_b(), b_to_a_, context_, {.max_pair_tests = left(), .margin = nearly});
    MeetingPair pair;
    search.pairs = {&pair, 1};
    const Verdict verdict = decide(search);
    add(search.stats, stats);
    if (verdict != Verdict::overlapping) return verdict;
    const bool enclosed = search.found == 0;
    if (!come_within(pair, enclosed, within(margin, uncertainty))) return Verdict::separated; // as far as can be told
    if (cache != nullptr && !enclosed) *cache = {true, bodies_.exchanged ? exchanged(pair) : pair};
    return verdict;
}

bool SolidPair::still_meet(const DistanceCache& cache, float margin, float uncertainty) noexcept {
    if (!cache.valid || left() == 0 || are_triangles() || !have_inner()) return false;
    const MeetingPair pair = bodies_.exchanged ? exchanged(cache.pair) : cache.pair;
    if (!names_leaves(pair, inner_a(), inner_b())) return false;
    ++stats.pair_tests;
    return come_within(pair, false, within(margin, uncertainty));
}

SolidsResult SolidPair::answer(Verdict outer, float margin, float uncertainty, DistanceCache* cache) noexcept {
    if (outer != Verdict::overlapping || are_triangles()) return {outer, outer == Verdict::undecided, stats};
    if (!have_inner()) return {Verdict::undecided, false, stats};
    const Verdict inner = inner_meet(margin, uncertainty, cache);
    if (inner == Verdict::overlapping) return {inner, false, stats};
    return {Verdict::undecided, inner == Verdict::undecided, stats};
}

bool SolidPair::certainly_meet(MeetingPair pair, bool enclosed) const noexcept {
    if (bodies_.exchanged) pair = exchanged(pair);
    return come_within(pair, enclosed, double{inner_a().radius()} + inner_b().radius());
}

bool SolidPair::come_within(const MeetingPair& pair, bool enclosed, double within) const {
    if (enclosed) return within >= 0 || leaves_hold_ball(-within);
    const auto ellipsoid_a = [&] { return place(inner_a().ellipsoid(pair.node_a), inner_a().scale()); };
    const auto ellipsoid_b = [&] { return place(inner_b().ellipsoid(pair.node_b), inner_b().scale(), b_to_a_); };
    if (pair.triangle_a != kNoTriangle)
        return certainly_within(place(inner_a(), pair.triangle_a), ellipsoid_b(), within);
    if (pair.triangle_b != kNoTriangle)
        return certainly_within(place(inner_b(), pair.triangle_b, b_to_a_), ellipsoid_a(), within);
    return certainly_within(ellipsoid_a(), ellipsoid_b(), within);
}

// Of ellipsoids among triangles: as no triangle meets them, their centers are at least that far from these.
bool SolidPair::leaves_hold_ball(double radius) const {
    const TreeView& covers = inner_a().has_triangles() ? inner_b() : inner_a();
    bool all = true;
    covers.for_each_in_cut(covers.level_count() - 1, [&](uint32_t node) {
        const PlacedEllipsoid e = place(covers.ellipsoid(node), covers.scale());
        all = all && least_width(e.factor, e.size) >= radius;
    });
    return all;
}

double SolidPair::depth() noexcept {
    if (!have_inner() || inner_a().has_triangles() || inner_b().has_triangles()) return 0;
    const double radii = double{inner_a().radius()} + inner_b().radius();
    CollideSearch search(inner_a(), inner_b(), b_to_a_, context_,
                         {.max_pair_tests = left(), .margin = with_radius(0, radii)});
    Deepest deepest{search};
    search.all = true;
    search.each = [](void* user, const MeetingPair& pair) { static_cast<Deepest*>(user)->look(pair); };
    search.each_user = &deepest;
    traverse(search);
    add(search.stats, stats);
    return std::max(0.0, (deepest.depth() + radii) * (1 - 0x1p-50));
}

} // namespace query

SolidsResult collide(const Solid& a, const Pose& pose_a, const Solid& b, const Pose& pose_b, Scratch context,
                     const SolidsOptions& options, SolidsCache* cache) noexcept {
    query::SolidPair pair(a, pose_a, b, pose_b, context, options.max_pair_tests);
    if (!pair.may_be_asked()) return {};
    const float margin = query::sound_length(options.margin), uncertainty = query::sound_length(options.uncertainty);
    const float at_most = query::with_radius(margin, double{uncertainty});
    if (cache == nullptr && !pair.are_triangles()) return pair.answer(pair.outer_meet(at_most), margin, uncertainty);
    if (cache != nullptr && pair.still_meet(cache->inner, margin, uncertainty))
        return {Verdict::overlapping, false, pair.stats};
    const CollideResult outer =
        collide(a.outer(), pose_a, b.outer(), pose_b, context, {.max_pair_tests = pair.left(), .margin = at_most},
                cache != nullptr ? &cache->outer : nullptr);
    query::add(outer.stats, pair.stats);
    return pair.answer(outer.verdict, margin, uncertainty, cache != nullptr ? &cache->inner : nullptr);
}

SolidsDistance distance(const Solid& a, const Pose& pose_a, const Solid& b, const Pose& pose_b, Scratch context,
                        const DistanceOptions& options) noexcept {
    query::SolidPair pair(a, pose_a, b, pose_b, context, options.max_pair_tests);
    if (!pair.may_be_asked()) return {};
    SolidsDistance out;
    const auto ask = [&](const TreeView& x, const TreeView& y, uint64_t budget) {
        DistanceOptions limits = options;
        limits.max_level = kMaxLevels, limits.max_pair_tests = budget;
        const DistanceResult found = distance(x, pose_a, y, pose_b, context, limits);
        query::add(found.stats, pair.stats);
        out.stats = pair.stats;
        return found;
    };
    const auto take_upper = [&](const DistanceResult& found) {
        out.upper = found.upper, out.point_a = found.point_a, out.point_b = found.point_b;
    };
    // Half of the budget for either bound, at least: a small one gives both.
    const bool both = !pair.are_triangles() && pair.have_inner();
    const DistanceResult outer = ask(a.outer(), b.outer(), both ? pair.left() / 2 : pair.left());
    out.lower = outer.lower;
    if (pair.are_triangles()) {
        out.verdict = outer.verdict;
        take_upper(outer);
        return out;
    }
    if (outer.verdict == Verdict::separated) out.verdict = Verdict::separated;
    if (out.lower >= query::sound_length(options.max_distance) || !both) return out;
    const DistanceResult inner = ask(*a.inner(), *b.inner(), pair.left());
    take_upper(inner);
    if (out.lower == 0 && inner.verdict == Verdict::overlapping && pair.certainly_meet(inner.pair, inner.enclosed))
        out.verdict = Verdict::overlapping, out.upper = 0;
    return out;
}

} // namespace prolate
