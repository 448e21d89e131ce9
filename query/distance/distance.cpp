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
#include "query/simd/targets.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "query/distance/distance.cpp"
#include <hwy/foreach_target.h>

#include "query/distance/search.hpp"
#include "query/ellipsoid/convert.hpp"
#include "query/inside/enclosure.hpp"
#include "query/node/distance_lanes-inl.hpp"
#include "query/node/heap.hpp"
#include "query/node/order.hpp"
#include "src/layout.hpp"

#include <hwy/cache_control.h>

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
        : q_(query), heap_(query.entries), sides_{{query.a, query.lattice_b_to_a}, {query.b, query.lattice_a_to_b}} {
        const auto children = [](const TreeView& tree) { return uint64_t{tree.degree()} * (tree.level_count() - 1); };
        room_ = static_cast<uint32_t>(QueryContext::kEntries - kMaxDegree - children(q_.a.tree) - children(q_.b.tree));
    }

    void run() {
        search();
        for (const Side& side : sides_)
            for (const double bound : side.skipped) q_.skipped = std::min(q_.skipped, bound * side.step);
        q_.a.deepest = sides_[0].deepest, q_.b.deepest = sides_[1].deepest;
    }

private:
    // Nodes that were placed before: every third or so is tested against another block soon.
    static constexpr uint32_t kPlaced = 8;
    struct Placed {
        uint32_t node = UINT32_MAX;
        Single single;
        PlacedBox box;
    };
    // One of the bodies, as that whose children are tested.
    struct Side {
        Side(const TreeSide& body, const LatticePose& other_to_here)
            : blocks(body.tree.block(0)), bounding_blocks(body.tree.bounding_block(0)),
              step_exponent(body.lattice.step_exponent), leaves_from(body.leaves_from), limit_from(body.limit_from),
              pose(other_to_here), step(power_of_two(step_exponent)), per_step(power_of_two(-step_exponent)) {
            if (body.tree.has_triangles()) triangles = body.tree.triangle_bytes(), hulls = body.tree.hull(0);
            triangle_bytes = static_cast<uint32_t>(3 * index_bytes(body.tree.vertex_count()));
            std::fill(skipped, skipped + kBlockLanes, DistanceSearch::kInfinity);
        }
        // As queries take it: bounding blocks above the last level.
        const std::byte* block(uint32_t slot) const {
            return (slot < leaves_from ? bounding_blocks : blocks) + size_t{slot / kBlockLanes} * kBlockBytes;
        }

        const std::byte *blocks, *bounding_blocks;
        int32_t step_exponent;
        uint32_t leaves_from, limit_from, deepest = 0;
        const std::byte* triangles = nullptr;
        const std::byte* hulls = nullptr;
        uint32_t triangle_bytes;
        const LatticePose& pose;
        double step, per_step;
        alignas(64) double skipped[kBlockLanes]; // least bound of the nodes that were skipped in each lane, steps
        Placed placed[kPlaced];                  // of the other body's nodes
    };

    void search() {
        q_.open = 0;
        if (budget() < 1) return;
        q_.open = DistanceSearch::kInfinity;
        Entry e;
        const bool near = roots(e);
        if (!(base_ > 0)) { // they may meet
            q_.enclosure = look_inside(q_.a.tree, q_.b.tree, q_.b_to_a, q_.stats, q_.options.max_pair_tests);
            if (q_.enclosure == Verdict::undecided) return stop_at(e);
            if (q_.enclosure == Verdict::overlapping) q_.upper = 0; // only surfaces that meet are of interest now
        }
        if (!near) return done(true);
        for (bool descending = true;;) {
            if ((e.flags & kLeaves) == kLeaves) {
                if (!q_.decide(e.node_a, e.node_b, bound_of(e))) return stop_at(e);
                if (q_.overlapping) return;
                descending = false;
            } else if (too_deep(e) && !descending) {
                q_.open = std::min(q_.open, bound_of(e));
            } else {
                if (!open(e)) return stop_at(e);
                if (count_ > 0) {
                    const Entry nearest = children_[--count_];
                    const bool go_on = descending || heap_.empty() || nearest.bound <= heap_.top().bound;
                    if (!go_on) ++count_;
                    if (heap_.size() + count_ <= room_) {
                        for (uint32_t i = 0; i < count_; ++i) heap_.push(children_[i]);
                    } else if (!depth_first()) {
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

    uint64_t budget() const { return q_.left(); }
    double bound_of(const Entry& e) const { return base_ + double{e.bound}; }
    bool too_deep(const Entry& e) const {
        return (e.flags & kOpenB) != 0 ? e.node_b >= sides_[1].limit_from : e.node_a >= sides_[0].limit_from;
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
        const auto leaf = [](const TreeSide& body) { return body.tree.is_leaf(0) ? 1u : 0u; };
        const Placed& one = place_other(sides_[1], sides_[0], 0);
        LaneBounds bounds;
        bound_lanes(sides_[1].block(0), sides_[1].step_exponent, one.single, &one.box, DistanceSearch::kInfinity,
                    bounds);
        ++q_.stats.pair_tests, ++q_.stats.block_tests;
        const double bound = bounds.lower[0] * sides_[1].step;
        base_ = std::isfinite(bound) ? std::max(bound, 0.0) : root_bound(q_);
        const bool open_b = leaf(q_.b) == 0 && (leaf(q_.a) != 0 || bounds.size[0] > one.single.size);
        e = {0, 0, 0, (open_b ? kOpenB : 0) | leaf(q_.a) * kLeafA | leaf(q_.b) * kLeafB};
        return !skips(base_);
    }

    // Node `node` of the body `from` in the frame of `here`.
    static HWY_INLINE const Placed& place_other(Side& here, const Side& from, uint32_t node) {
        Placed& placed = here.placed[node % kPlaced];
        if (placed.node != node) {
            placed.single = place_here(from.block(node), node % kBlockLanes, here.pose, &placed.box);
            placed.node = node;
        }
        return placed;
    }

    // Puts the children of a pair that are not skipped into children_, the nearest last; false if the budget is too
    // small.
    bool open(const Entry& e) {
        count_ = 0;
        const uint32_t side = e.flags & kOpenB;
        const uint32_t node = side != 0 ? e.node_b : e.node_a, other = side != 0 ? e.node_a : e.node_b;
        const std::byte* const block = sides_[side].block(node);
        const uint32_t lane = node % kBlockLanes, count = load_le<uint8_t>(block + kBlockCount + lane);
        const auto first = load_le<uint32_t>(block + kBlockFirst + size_t{4} * lane);
        if (count > budget()) return false;
        for (uint32_t i = 0; i < count; i += kBlockLanes)
            test(e, side, other, first + i, std::min(count - i, kBlockLanes));
        if (count_ == 0) return true;
        std::swap(children_[nearest_], children_[count_ - 1]);
        return true;
    }

    // What opening a node, or looking at a leaf's triangles, will need: they are seldom in the cache.
    static HWY_INLINE void prefetch(const Side& side, const std::byte* block, uint32_t lane, bool leaf) {
        const auto first = load_le<uint32_t>(block + kBlockFirst + size_t{4} * lane);
        if (leaf) {
            if (side.triangles != nullptr) hwy::Prefetch(side.triangles + size_t{first} * side.triangle_bytes);
        } else {
            const std::byte* const children = side.block(first);
            for (size_t i = 0; i < kBlockBytes; i += kBlockAlignment) hwy::Prefetch(children + i);
        }
    }

    // One block against a node of the other tree.
    HWY_INLINE void test(const Entry& e, uint32_t open, uint32_t other, uint32_t first, uint32_t count) {
        Side& side = sides_[open];
        const std::byte* const block = side.block(first);
        q_.stats.pair_tests += count, ++q_.stats.block_tests;
        side.deepest = std::max(side.deepest, first + count - 1);
        const Placed& one = place_other(side, sides_[open ^ kOpenB], other);
        const uint32_t other_leaf = e.flags & (open != 0 ? kLeafA : kLeafB);
        const uint32_t this_leaf = open != 0 ? kLeafB : kLeafA;
        LaneBounds bounds;
        bound_lanes(block, side.step_exponent, one.single, &one.box, q_.enough() * side.per_step, bounds);
        const Side& there = sides_[open ^ kOpenB];
        const std::byte* const hull_one =
            other_leaf != 0 ? nullptr : hull_of(there.hulls, there.block(other), other % kBlockLanes);
        const uint32_t nodes = (1u << count) - 1;
        note_skipped(bounds, nodes & ~bounds.near, side);
        for (uint32_t near = bounds.near & nodes; near != 0; near &= near - 1) {
            const auto lane = static_cast<uint32_t>(std::countr_zero(near));
            const auto stored = static_cast<uint8_t>(block[kBlockCount + lane]);
            const bool leaf = first >= side.leaves_from || stored == 0 || stored >= kTriangleLeaf;
            double lower = bounds.lower[lane] * side.step; // less than 0: the deeper, the nearer
            if (have_hulls_) {
                lower += side.step * hulls_add(bounds, lane, one.single.size, hull_one,
                                               leaf ? nullptr : hull_of(side.hulls, block, lane));
                if (skips(lower)) continue;
            }
            const bool open_this = !leaf && (other_leaf != 0 || bounds.size[lane] > one.single.size);
            if (open_this || (leaf && other_leaf != 0)) prefetch(side, block, lane, leaf);
            const uint32_t flags = (open_this ? open : open ^ kOpenB) | (leaf ? this_leaf : 0) | other_leaf;
            if (count_ == 0 || lower < least_) nearest_ = count_, least_ = lower;
            const float bound = inherit(e.bound, lower);
            const uint32_t node = first + lane;
            children_[count_++] = {open != 0 ? other : node, open != 0 ? node : other, bound, flags};
        }
    }
    static HWY_INLINE void note_skipped(const LaneBounds& bounds, uint32_t lanes, Side& side) {
        if (lanes == 0) return;
        alignas(8) uint8_t bits[8] = {static_cast<uint8_t>(lanes)};
        for (size_t i = 0; i < kBlockLanes; i += kDoubleLanes) {
            bits[0] = static_cast<uint8_t>(lanes >> i);
            const Double bound = choose(hn::LoadMaskBits(DoubleTag(), bits), load<Double>(bounds.lower + i),
                                        broadcast<Double>(DistanceSearch::kInfinity));
            store(min(load<Double>(side.skipped + i), bound), side.skipped + i);
        }
    }
    // The greater of a pair's own bound, as it is kept, and its parent's.
    float inherit(float parent, double bound) const {
        const float own = static_cast<float>(bound - base_);
        const float below = own - (std::abs(own) * 0x1p-22f + 0x1p-120f);
        return below > parent ? below : parent;
    }

    // Searches all children_ and all below them, nearest first, on the scratch above the heap. False if the budget
    // runs out.
    bool depth_first() {
        Entry* const stack = q_.entries + heap_.size();
        uint32_t size = 0;
        const auto push = [&] { size = static_cast<uint32_t>(std::copy_n(children_, count_, stack + size) - stack); };
        push();
        bool within = true;
        while (size > 0 && !q_.overlapping) {
            const Entry e = stack[--size];
            if (skips(bound_of(e))) continue;
            const bool leaves = (e.flags & kLeaves) == kLeaves;
            if (leaves || !too_deep(e))
                within = within && (leaves ? q_.decide(e.node_a, e.node_b, bound_of(e)) : open(e));
            if (!within || (!leaves && too_deep(e)))
                q_.open = std::min(q_.open, bound_of(e));
            else if (!leaves)
                push();
        }
        return within;
    }

    DistanceSearch& q_;
    PairHeap<> heap_;
    Side sides_[2];
    const bool have_hulls_ = q_.a.tree.has_triangles() || q_.b.tree.has_triangles();
    double base_ = 0;      // bound of the roots, metres
    uint32_t room_;        // of the heap: what depth_first() needs is kept free
    uint32_t count_ = 0;   // of children_
    uint32_t nearest_ = 0; // of them, while they are tested, and its own bound
    double least_ = 0;
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
    // If the budget does not hold even what an earlier query found, it is spent: another way to go on would end
    // elsewhere.
    if (first != nullptr && !q.try_first(*first)) return out;
    if (!q.overlapping) query::search(q);
    out.pair = q.witness, out.upper = q.upper;
    if (q.overlapping || q.enclosure == Verdict::overlapping) {
        out.verdict = Verdict::overlapping, out.enclosed = !q.overlapping;
    } else if (q.enclosure == Verdict::separated) {
        out.lower = q.lower();
        if (out.lower > 0) out.verdict = Verdict::separated;
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
