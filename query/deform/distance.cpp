// distance() of deformed bodies: best-first branch and bound over pairs of nodes, as query/distance/search.cpp goes,
// but node by node in double precision. A pair's bound is the gap of its ellipsoids where they have moved, or the bound
// of the pair that it comes from, if that is greater: it does not depend on what the search has found so far, so that a
// higher limit gives bounds as tight or tighter.
//
// A node holds what it stands for, but not all of the ellipsoids below it. So where it is apart, these may still meet;
// leaves count as no nearer than the pairs above them then. Along the way to leaves that count as meeting no pair is
// apart, so collide(), which opens the same nodes, says so, too.
//
// Bounds of ellipsoids and triangles are wrong by what body.hpp adds to the terms of query/ellipsoid/gap.hpp and
// query/triangle/distance.hpp: 100 + 67 and 110 + 67 + 20 u S, within the 256 u S that these demand. Radii come off
// last.
#include "query/deform/enclosure.hpp"
#include "query/deform/pair.hpp"
#include "query/ellipsoid/gap.hpp"
#include "query/node/heap.hpp"
#include "query/node/limits.hpp"
#include "query/node/scratch.hpp"
#include "query/triangle/ellipsoid_distance.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace prolate {
namespace {

using glm::dvec3;
using query::Bound, query::Deformed, query::DeformedPair, query::PlacedTriangle, query::TriangleDistance;

constexpr double kNoLeaves = std::numeric_limits<double>::infinity();
constexpr double kJustApart = std::numeric_limits<double>::min(); // a bound of what is certainly apart
// Bounds of inner pairs are this share of their sizes below the gap at most; of leaves, of the tolerance.
constexpr double kOfSizes = 1.0 / 64, kOfDeformedTolerance = 0.25;
constexpr double kLeastDeformedTolerance = 1e-12, kMostDeformedTolerance = 1;

// Lengths of cores less `radii`, rounded down or up.
double less_radii(double length, double radii) {
    return length - radii - (std::abs(length) + radii) * 0x1p-51;
}
double less_radii_up(double length, double radii) {
    return std::max(0.0, length - radii + (std::abs(length) + radii) * 0x1p-51);
}
float entry_bound(double bound) {
    const auto out = static_cast<float>(bound);
    return double{out} > bound ? std::nextafter(out, 0.0f) : out;
}

class DeformedDistance {
    using Entry = Scratch::Entry; // bound: of the pair, metres, rounded down; flags: is it apart, by however little?

public:
    DeformedDistance(const DeformedPair& pair, const DistanceOptions& options, const Scratch& scratch)
        : pair_(pair), radius_a_(pair.a.tree().radius()), radius_b_(pair.b.tree().radius()), options_(options),
          scratch_(scratch), room_(query::heap_room(scratch, pair.a.tree(), pair.b.tree())), heap_(scratch.entries()) {
        options_.tolerance_absolute = query::sound_tolerance(options.tolerance_absolute);
        options_.tolerance_relative = std::clamp(query::sound_tolerance(options.tolerance_relative),
                                                 kLeastDeformedTolerance, kMostDeformedTolerance);
        options_.max_distance = query::sound_length(options.max_distance);
    }

    void run() {
        if (left() < 1) return stop(0);
        ++stats.pair_tests;
        const double bound = gap(pair_.bound_a(0), pair_.bound_b(0));
        if (!(bound > 0)) inside = query::look_inside_both(pair_, scratch_.entries(), options_.max_pair_tests, stats);
        if (inside == query::Enclosure::out_of_tests) return stop(0);
        if (!skips(bound)) search({0, 0, entry_bound(bound), bound > 0});
    }

    double lower() const {
        const double out = std::min({decided_, skipped_, open_, upper});
        return overlapping || inside != query::Enclosure::none ? 0 : std::max(out, 0.0);
    }

    QueryStats stats = {};
    query::Enclosure inside = query::Enclosure::none;
    bool overlapping = false; // the nearest leaves, or triangles, meet
    double upper = kNoLeaves; // of the nearest leaves found,
    MeetingPair nearest = {}; // these, and points of them
    dvec3 on_a{0, 0, 0}, on_b{0, 0, 0};

private:
    uint64_t left() const { return query::tests_left(options_.max_pair_tests, stats.tests()); }
    double tolerance(double distance) const {
        return std::max(options_.tolerance_absolute, options_.tolerance_relative * distance);
    }
    // Pairs whose bound is at least this, > 0, need not be looked at.
    double enough() const {
        const double improving = upper < kNoLeaves ? upper - tolerance(upper) : kNoLeaves;
        return std::max(std::min(options_.max_distance, improving), kJustApart);
    }
    bool skips(double bound) {
        if (!(bound >= enough())) return false;
        skipped_ = std::min(skipped_, bound);
        return true;
    }
    // A pair of this bound, and what is in the heap, stays open.
    void stop(double bound) {
        open_ = std::min(open_, bound);
        if (!heap_.empty()) open_ = std::min(open_, double{heap_.top().bound});
    }

    // A lower bound on the distance of what two nodes hold; 0 if they are not apart. No better one than is wanted.
    double gap(const Bound& x, const Bound& y) const {
        const double radii = x.radius + y.radius + radius_a_ + radius_b_;
        const double slack = query::kSeparationMargin * (x.core.reach + y.core.reach);
        const double spheres =
            less_radii(glm::length(y.core.center - x.core.center) - x.core.size - y.core.size - slack, radii);
        if (spheres >= enough()) return spheres;
        const double wanted = kOfSizes * (x.core.size + y.core.size);
        const double out = less_radii(query::distance_of(x.core, y.core, wanted).lower, radii);
        if (out > 0) return out;
        return query::apart(x, y, margin()) ? kJustApart : 0;
    }
    double margin() const { return query::with_radius(0.0f, radius_a_ + radius_b_); } // as collide() has it

    void search(Entry e) {
        for (bool descending = true;;) { // first of all to the nearest child each time
            if (pair_.are_leaves(e.node_a, e.node_b)) {
                if (!decide(e)) return stop(double{e.bound});
                descending = false;
            } else if (!open(e, descending)) {
                return stop(double{e.bound});
            } else if (count_ > 0) {
                const Entry next = children_[--count_];
                const bool go_on = descending || heap_.empty() || next.bound <= heap_.top().bound;
                if (!go_on) ++count_;
                if (heap_.size() + count_ <= room_)
                    for (uint32_t i = 0; i < count_; ++i) heap_.push(children_[i]);
                else if (!depth_first())
                    return stop(go_on ? double{next.bound} : kNoLeaves);
                if (go_on && !overlapping) {
                    e = next;
                    continue;
                }
            }
            if (overlapping || heap_.empty()) return;
            e = heap_.pop();
            if (skips(double{e.bound})) return;
        }
    }

    // All children_ and all below them, on the scratch above the heap. False if the budget runs out.
    bool depth_first() {
        Entry* const stack = scratch_.entries() + heap_.size();
        uint32_t size = 0;
        const auto push = [&] { size = static_cast<uint32_t>(std::copy_n(children_, count_, stack + size) - stack); };
        bool within = true;
        for (push(); size > 0 && !overlapping;) {
            const Entry e = stack[--size];
            if (skips(double{e.bound})) continue;
            const bool leaves = pair_.are_leaves(e.node_a, e.node_b);
            count_ = 0;
            within = within && (leaves ? decide(e) : open(e, false));
            if (!within) open_ = std::min(open_, double{e.bound});
            push();
        }
        return within;
    }

    // Puts the children of a pair that are not skipped into children_, the nearest last; a pair that is too deep stays
    // open. False if the budget is too small.
    bool open(const Entry& e, bool however_deep) {
        count_ = 0;
        const Bound of_a = pair_.bound_a(e.node_a), of_b = pair_.bound_b(e.node_b);
        const bool open_a = pair_.opens_a(e.node_a, of_a, e.node_b, of_b);
        const Deformed& side = open_a ? pair_.a : pair_.b;
        const uint32_t opened = open_a ? e.node_a : e.node_b;
        if (side.too_deep(opened)) {
            open_ = std::min(open_, double{e.bound});
            if (!however_deep) return true;
        }
        const ChildRange children = side.tree().children(opened);
        if (children.count > left()) return false;
        stats.pair_tests += children.count;
        stats.deepest_level = std::max(stats.deepest_level, side.tree().level_of(children.first));
        double least = kNoLeaves;
        for (uint32_t c = children.first; c < children.first + children.count; ++c) {
            const double own = open_a ? gap(pair_.bound_a(c), of_b) : gap(of_a, pair_.bound_b(c));
            const double bound = std::max(own, double{e.bound});
            if (skips(bound)) continue;
            children_[count_++] = {open_a ? c : e.node_a, open_a ? e.node_b : c, entry_bound(bound),
                                   e.flags | uint32_t{own > 0}};
            if (bound < least)
                least = bound;
            else
                std::swap(children_[count_ - 2], children_[count_ - 1]);
        }
        return true;
    }

    // Two leaves. False, and nothing done, if the budget may not suffice.
    bool decide(const Entry& e) {
        const TriangleRange of_a = pair_.a.triangles(e.node_a), of_b = pair_.b.triangles(e.node_b);
        if (of_a.count == 0 && of_b.count == 0) return decide_ellipsoids(e), true;
        if (uint64_t{std::max(of_a.count, 1u)} * std::max(of_b.count, 1u) > left()) return false;
        if (of_a.count > 0 && of_b.count > 0)
            decide_triangles(e, of_a, of_b);
        else
            decide_mixed(e, of_a, of_b);
        return true;
    }

    void decide_ellipsoids(const Entry& e) {
        const Bound x = pair_.bound_a(e.node_a), y = pair_.bound_b(e.node_b);
        const double wanted = upper < kNoLeaves ? kOfDeformedTolerance * tolerance(upper) : 0;
        query::Gap found = query::distance_of(x.core, y.core, wanted);
        // If these are the nearest, what is wanted is a share of their own distance.
        const double radii = x.radius + y.radius + radius_a_ + radius_b_;
        const double least = kOfDeformedTolerance * tolerance(std::max(0.0, less_radii(found.lower, radii)));
        if (less_radii(found.upper, radii) < upper && least < wanted)
            found = query::distance_of(x.core, y.core, least, found.normal);
        take({found.lower, found.upper, found.point_a, found.point_b}, {e.node_a, e.node_b}, e, x.radius, y.radius,
             [&] { return query::apart(x, y, margin()); });
    }
    void decide_triangles(const Entry& e, TriangleRange of_a, TriangleRange of_b) {
        PlacedTriangle in_a[kMaxLeafTriangles];
        for (uint32_t i = 0; i < of_a.count; ++i) in_a[i] = pair_.triangle_a(of_a.first + i);
        for (uint32_t t = of_b.first; t < of_b.first + of_b.count; ++t) {
            const PlacedTriangle in_b = pair_.triangle_b(t);
            for (uint32_t i = 0; i < of_a.count; ++i) {
                ++stats.triangle_tests;
                // Most are far enough from each other along the direction of the nearest ones.
                const double along = less_radii(query::gap_along(in_a[i], in_b, normal_), radius_a_ + radius_b_);
                if (skips(std::max(along, double{e.bound}))) continue;
                take(query::distance(in_a[i], in_b), {e.node_a, e.node_b, of_a.first + i, t}, e, 0, 0,
                     [&] { return query::separated(in_a[i], in_b, margin()); });
                if (overlapping) return;
            }
        }
    }
    void decide_mixed(const Entry& e, TriangleRange of_a, TriangleRange of_b) {
        const bool in_a = of_a.count > 0;
        const TriangleRange range = in_a ? of_a : of_b;
        const Bound other = in_a ? pair_.bound_b(e.node_b) : pair_.bound_a(e.node_a);
        for (uint32_t t = range.first; t < range.first + range.count && !overlapping; ++t) {
            ++stats.triangle_tests;
            const PlacedTriangle triangle = in_a ? pair_.triangle_a(t) : pair_.triangle_b(t);
            TriangleDistance found = query::distance(triangle, other.core);
            if (!in_a) std::swap(found.on_a, found.on_b);
            take(found, {e.node_a, e.node_b, in_a ? t : kNoTriangle, in_a ? kNoTriangle : t}, e,
                 in_a ? 0 : other.radius, in_a ? other.radius : 0,
                 [&] { return query::apart(triangle, other, margin()); });
        }
    }

    // Of two leaves: what is found of their cores, how far beyond them they reach, and whether collide() finds them
    // apart.
    template <class Apart>
    void take(const TriangleDistance& found, const MeetingPair& pair, const Entry& e, double beyond_a, double beyond_b,
              Apart&& are_apart) {
        const double reach_a = radius_a_ + beyond_a, reach_b = radius_b_ + beyond_b, bound = double{e.bound};
        const double nearer = less_radii(found.lower, reach_a + reach_b);
        const bool meet = e.flags == 0 && !(nearer > 0) && !are_apart();
        const double least = meet ? 0.0 : std::max({nearer, bound, kJustApart}); // leaves of pairs apart may meet
        decided_ = std::min(decided_, least);
        const double farthest = std::max(less_radii_up(found.upper, reach_a + reach_b), least);
        if (!(farthest < upper) && !meet) return;
        upper = std::min(upper, farthest), nearest = pair, overlapping = meet;
        const dvec3 between = found.on_b - found.on_a;
        const double length = glm::length(between);
        normal_ = length > 0 ? between / length : dvec3(0, 0, 0);
        on_a = found.on_a + reach_a * normal_, on_b = found.on_b - reach_b * normal_;
    }

    const DeformedPair& pair_;
    const double radius_a_, radius_b_;
    DistanceOptions options_; // sound
    const Scratch scratch_;
    const uint32_t room_; // of the heap: what depth_first() needs is kept free
    query::PairHeap<> heap_;
    // Of all pairs of leaves: those decided are not nearer than `decided_`, those ruled out than `skipped_`, and those
    // that a limit left open than `open_`.
    double decided_ = kNoLeaves, skipped_ = kNoLeaves, open_ = kNoLeaves;
    dvec3 normal_{0, 0, 0}; // between the cores of the nearest leaves; 0 if they meet, or there are none
    uint32_t count_ = 0;    // of children_
    Entry children_[kMaxDegree];
};

} // namespace

DeformedDistanceResult distance(const DeformedBody& a, const DeformedBody& b, Scratch context,
                                const DistanceOptions& options) noexcept {
    const Deformed deformed_a(a, options.max_level), deformed_b(b, options.max_level);
    DeformedDistanceResult out;
    if (!deformed_a.in_range() || !deformed_b.in_range()) {
        out.reason = Undecided::coordinates;
        return out;
    }
    const DeformedPair pair{deformed_a, deformed_b, query::relative_pose(a.pose, b.pose)};
    if (!std::isfinite(pair.b_to_a.distance) || !query::suffices(context, a.tree, b.tree)) return out;
    DeformedDistance search(pair, options, context);
    search.run();
    out.stats = search.stats, out.pair = search.nearest, out.lower = search.lower(), out.upper = search.upper;
    const bool may_enclose = search.inside == query::Enclosure::perhaps;
    if (search.overlapping || may_enclose)
        out.verdict = Verdict::overlapping, out.enclosed = !search.overlapping;
    else if (out.lower > 0)
        out.verdict = Verdict::separated;
    out.reason = out.verdict == Verdict::undecided ? Undecided::budget : Undecided::no;
    const query::RelativePose to_world = query::world_pose(a.pose);
    const dvec3 between = to_world.rotation * (search.on_b - search.on_a);
    const double length = glm::length(between);
    if (length > 0) out.normal = query::to_float(between / length);
    out.point_a = query::to_float(to_world.rotation * search.on_a + to_world.translation);
    out.point_b = query::to_float(to_world.rotation * search.on_b + to_world.translation);
    return out;
}

} // namespace prolate
