// How far apart: best-first branch and bound over pairs of nodes, a block of eight children at a time.
//
// Source: Johnson and Cohen, "A framework for efficient minimum distance computations" (1998). A pair of nodes has a
// certified lower bound on the distance of what lies below them: that of their ellipsoids (distance_lanes-inl.hpp), or
// of the pair it comes from, if that is greater. The pair of the least bound is opened first (its larger node; which
// depends on the pair alone), so that none is opened whose bound is above the distance, and the search ends when the
// least bound is as good as the nearest leaves found. First of all one descent to the nearest child each time finds
// two leaves, and an upper bound.
//
// The bounds of a pair do not depend on what the search has found so far, and children inherit them. So whatever limit
// ends the search, a higher limit gives bounds as tight or tighter.
//
// Bounds are kept as floats, less the bound of the roots, rounded down: bodies far apart lose no digits.
//
// Memory: the pairs in the heap fill the caller's scratch at most. When it is full, pairs are searched depth first,
// which takes some more tests, until there is room.
//
// Complexity: pairs of nodes whose bound is below the distance; for two fine meshes, 100 to 250 block tests.
#include "query/targets.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "query/distance.cpp"
#include <hwy/foreach_target.h>

#include "query/convert.hpp"
#include "query/distance_lanes-inl.hpp"
#include "query/distance_search.hpp"
#include "query/enclosure.hpp"
#include "query/heap.hpp"
#include "query/order.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

HWY_BEFORE_NAMESPACE();
namespace prolate::query::HWY_NAMESPACE {
namespace {

// QueryContext::Entry::flags; bound is the pair's, less that of the roots.
constexpr uint32_t kOpenB = 1, kLeafA = 2, kLeafB = 4, kLeaves = kLeafA | kLeafB;

class Search {
    using Entry = QueryContext::Entry;

public:
    explicit Search(DistanceSearch& query)
        : q_(query), heap_(query.entries), step_a_(power_of_two(query.a.lattice.step_exponent)),
          step_b_(power_of_two(query.b.lattice.step_exponent)) {
        const auto children = [](const TreeView& tree) { return uint64_t{tree.degree()} * (tree.level_count() - 1); };
        room_ = static_cast<uint32_t>(QueryContext::kEntries - kMaxDegree - children(q_.a.tree) - children(q_.b.tree));
    }

    void run() {
        q_.open = 0;
        if (budget() < 1) return;
        q_.open = DistanceSearch::kInfinity;
        Entry e;
        if (!roots(e)) return done(true);
        for (bool descending = true;;) {
            if ((e.flags & kLeaves) == kLeaves) {
                q_.decide(e.node_a, e.node_b);
                if (q_.overlapping) return;
                descending = false;
            } else if (too_deep(e) && !descending) {
                q_.open = std::min(q_.open, bound_of(e));
            } else {
                if (!open(e)) return stop_at(e);
                if (count_ > 0) {
                    std::swap(*std::min_element(children_, children_ + count_, nearer), children_[count_ - 1]);
                    const Entry nearest = children_[count_ - 1]; // a copy: depth_first() needs the room
                    const bool go_on = descending || heap_.empty() || nearest.bound <= heap_.top().bound;
                    const uint32_t others = count_ - (go_on ? 1 : 0);
                    if (heap_.size() + others <= room_) {
                        for (uint32_t i = 0; i < others; ++i) heap_.push(children_[i]);
                    } else if (!depth_first(others)) {
                        return go_on ? stop_at(nearest) : done(false);
                    }
                    if (q_.overlapping) return;
                    if (go_on) {
                        e = nearest;
                        continue;
                    }
                }
            }
            if (heap_.empty()) return done(true);
            e = heap_.pop();
            if (skips(bound_of(e))) return done(true);
        }
    }

private:
    static bool nearer(const Entry& x, const Entry& y) { return x.bound < y.bound; }
    uint64_t budget() const { return q_.options.max_pair_tests - q_.stats.pair_tests; }
    double bound_of(const Entry& e) const { return base_ + double{e.bound}; }
    bool too_deep(const Entry& e) const {
        return (e.flags & kOpenB) != 0 ? e.node_b >= q_.b.limit_from : e.node_a >= q_.a.limit_from;
    }
    // Notes a pair that need not be looked at.
    bool skips(double bound) {
        if (!(bound >= q_.enough())) return false;
        q_.skipped = std::min(q_.skipped, bound);
        return true;
    }
    // The search ends here: what is in the heap is open, or if `complete` only not better than what was skipped.
    void done(bool complete) {
        q_.complete = complete;
        if (!complete && !heap_.empty()) q_.open = std::min(q_.open, bound_of(heap_.top()));
    }
    void stop_at(const Entry& e) {
        q_.open = std::min(q_.open, bound_of(e));
        done(false);
    }

    // The pair of the roots; false if they are far enough apart.
    bool roots(Entry& e) {
        const auto leaf = [](const Body& body) { return body.tree.is_leaf(0) ? 1u : 0u; };
        LaneBounds bounds;
        const Single one = place(q_.a.tree.block(0), 0, q_.lattice_a_to_b);
        bound_lanes(q_.b.tree.block(0), q_.b.lattice.step_exponent, one, bounds);
        ++q_.stats.pair_tests, ++q_.stats.block_tests;
        const double bound = bounds.lower[0] * step_b_;
        base_ = std::isfinite(bound) ? std::max(bound, 0.0) : root_bound(q_);
        q_.roots_meet = !(base_ > 0);
        const bool open_b = leaf(q_.b) == 0 && (leaf(q_.a) != 0 || bounds.size[0] > one.size);
        e = {0, 0, 0, (open_b ? kOpenB : 0) | leaf(q_.a) * kLeafA | leaf(q_.b) * kLeafB};
        return !skips(base_);
    }

    // Puts the children of a pair that are not skipped into children_; false if the budget is too small.
    bool open(const Entry& e) {
        count_ = 0;
        return (e.flags & kOpenB) != 0 ? open_one<true>(e, q_.b, q_.a, q_.lattice_a_to_b, step_b_)
                                       : open_one<false>(e, q_.a, q_.b, q_.lattice_b_to_a, step_a_);
    }
    template <bool kB>
    bool open_one(const Entry& e, Body& body, const Body& other, const LatticePose& pose, double step) {
        const ChildRange children = body.tree.children(kB ? e.node_b : e.node_a);
        if (children.count > budget()) return false;
        const uint32_t node = kB ? e.node_a : e.node_b;
        const Single one = place(other.tree.block(node / kBlockLanes), node % kBlockLanes, pose);
        const bool other_leaf = (e.flags & (kB ? kLeafA : kLeafB)) != 0;
        q_.stats.pair_tests += children.count;
        body.deepest = std::max(body.deepest, children.first + children.count - 1);
        for (uint32_t i = 0; i < children.count; i += kBlockLanes) {
            const uint32_t first = children.first + i, count = std::min(children.count - i, kBlockLanes);
            const std::byte* const block = body.tree.block(first / kBlockLanes);
            LaneBounds bounds;
            bound_lanes(block, body.lattice.step_exponent, one, bounds);
            ++q_.stats.block_tests;
            const double enough = q_.enough();
            for (uint32_t lane = 0; lane < count; ++lane) {
                const double bound = bounds.lower[lane] * step;
                if (bound >= enough) {
                    q_.skipped = std::min(q_.skipped, bound);
                    continue;
                }
                const auto stored = static_cast<uint8_t>(block[kBlockCount + lane]);
                const bool leaf = first >= body.leaves_from || stored == 0 || stored >= kTriangleLeaf;
                const bool open_this = !leaf && (other_leaf || bounds.size[lane] > one.size);
                const uint32_t flags = (open_this == kB ? kOpenB : 0) | (leaf ? (kB ? kLeafB : kLeafA) : 0) |
                                       (e.flags & (kB ? kLeafA : kLeafB));
                children_[count_++] = {kB ? node : first + lane, kB ? first + lane : node, inherit(e.bound, bound),
                                       flags};
            }
        }
        return true;
    }
    // The greater of a pair's own bound, as it is kept, and its parent's.
    float inherit(float parent, double bound) const {
        const float own = static_cast<float>(bound - base_);
        const float below = own - (std::abs(own) * 0x1p-22f + 0x1p-120f);
        return below > parent ? below : parent;
    }

    // Searches children_[0 ... count - 1] and all below them, nearest first, on the scratch above the heap. False if
    // the budget runs out.
    bool depth_first(uint32_t count) {
        Entry* const stack = q_.entries + heap_.size();
        uint32_t size = 0;
        const auto push = [&](uint32_t n) {
            if (n == 0) return;
            std::swap(*std::min_element(children_, children_ + n, nearer), children_[n - 1]);
            size = static_cast<uint32_t>(std::copy_n(children_, n, stack + size) - stack);
        };
        push(count);
        bool within = true;
        while (size > 0 && !q_.overlapping) {
            const Entry e = stack[--size];
            if (skips(bound_of(e))) continue;
            if ((e.flags & kLeaves) == kLeaves) {
                q_.decide(e.node_a, e.node_b);
            } else if (too_deep(e) || !(within = within && open(e))) {
                q_.open = std::min(q_.open, bound_of(e));
            } else {
                push(count_);
            }
        }
        return within;
    }

    DistanceSearch& q_;
    PairHeap<> heap_;
    const double step_a_, step_b_; // metres
    double base_ = 0;              // bound of the roots, metres
    uint32_t room_;                // of the heap: what depth_first() needs is kept free
    uint32_t count_ = 0;
    Entry children_[kMaxDegree];
};

void search_target(DistanceSearch& query) {
    Search(query).run();
}

} // namespace
} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace prolate::query {
HWY_EXPORT(search_target);
void search(DistanceSearch& query) noexcept {
    HWY_DYNAMIC_DISPATCH(search_target)(query);
}
} // namespace prolate::query

namespace prolate {
namespace {

using query::to_float;

MeetingPair swapped(const MeetingPair& pair) {
    return {pair.node_b, pair.node_a, pair.triangle_b, pair.triangle_a};
}

// The whole query with the bodies in their fixed order.
DistanceResult run(query::DistanceSearch& q, const Pose& pose_a, const MeetingPair* first) {
    DistanceResult out;
    if (!std::isfinite(q.b_to_a.distance)) return out;
    if (first != nullptr) q.try_first(*first);
    if (!q.overlapping) query::search(q);
    out.pair = q.witness;
    out.lower = q.overlapping ? 0 : q.lower();
    out.upper = q.upper;
    if (q.overlapping) {
        out.verdict = Verdict::overlapping;
    } else if (out.lower > 0 || q.complete) {
        out.verdict = out.lower > 0 ? Verdict::separated : Verdict::undecided;
    }
    if (out.verdict == Verdict::separated && q.roots_meet) {
        out.verdict = query::look_inside(q.a.tree, q.b.tree, q.b_to_a, q.stats, q.options.max_pair_tests);
        if (out.verdict != Verdict::separated) out.lower = 0;
        if (out.verdict == Verdict::overlapping) out.enclosed = true, out.upper = 0, out.pair = {};
    }
    q.stats.deepest_level = std::max(q.a.deepest_level(), q.b.deepest_level());
    out.stats = q.stats;
    const query::RelativePose to_world = query::relative_pose(Pose{}, pose_a);
    out.point_a = to_float(to_world.rotation * q.on_a + to_world.translation);
    out.point_b = to_float(to_world.rotation * q.on_b + to_world.translation);
    out.normal = to_float(to_world.rotation * q.normal);
    return out;
}

} // namespace

DistanceResult distance(const TreeView& a, const Pose& pose_a, const TreeView& b, const Pose& pose_b,
                        QueryContext& context, const DistanceOptions& options, DistanceCache* cache) noexcept {
    const bool swap = query::must_swap(a, pose_a, b, pose_b);
    MeetingPair first;
    if (cache != nullptr && cache->valid) first = swap ? swapped(cache->pair) : cache->pair;
    query::DistanceSearch q = swap ? query::DistanceSearch(b, pose_b, a, pose_a, context, options)
                                   : query::DistanceSearch(a, pose_a, b, pose_b, context, options);
    DistanceResult out = run(q, swap ? pose_b : pose_a, cache != nullptr && cache->valid ? &first : nullptr);
    if (swap) {
        out.pair = swapped(out.pair);
        std::swap(out.point_a, out.point_b);
        out.normal = {-out.normal.x, -out.normal.y, -out.normal.z};
    }
    if (cache != nullptr && out.upper < query::DistanceSearch::kInfinity && !out.enclosed)
        *cache = {.valid = true, .pair = out.pair};
    return out;
}

} // namespace prolate
#endif // HWY_ONCE
