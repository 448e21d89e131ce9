// How far apart: best-first branch and bound over pairs of nodes, a block of eight children at a time.
//
// Source: Johnson and Cohen, "A framework for efficient minimum distance computations" (1998). A pair of nodes has a
// certified lower bound on the distance of what lies below them: that of their ellipsoids
// (query/node/distance_lanes-inl.hpp), or
// of the pair it comes from, if that is greater. The pair of the least bound is opened first (its larger node; which
// depends on the pair alone), so that none is opened whose bound is above the distance, and the search ends when the
// least bound is as good as the nearest leaves found. First of all one descent to the nearest child each time finds
// two leaves, and an upper bound.
//
// Two nodes with few triangles below them, all in leaves, are not opened, but all these are tested against each other
// (patch-inl.hpp).
//
// Once there is a nearest pair, others are also looked at along its normal (reach-inl.hpp): they may be far enough from
// each other along it. That takes no part in the budget, of which it is a fraction.
//
// The bounds of a pair do not depend on what the search has found so far, and children inherit them. So whatever limit
// ends the search, a higher limit gives bounds as tight or tighter.
//
// Bounds are kept as floats, less the bound of the roots, rounded down: bodies far apart lose no digits.
//
// Memory: the pairs in the heap fill the caller's scratch at most. When it is full, pairs are searched depth first,
// which takes some more tests, until there is room.
//
// Complexity: pairs of nodes whose bound is below the distance; for two fine meshes, 25 to 50 block tests.
#include "query/simd/targets.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "query/distance/search.cpp"
#include <hwy/foreach_target.h>

#include "query/distance/patch-inl.hpp"
#include "query/distance/reach-inl.hpp"
#include "query/distance/state.hpp"
#include "query/inside/enclosure.hpp"
#include "query/node/best_first.hpp"
#include "query/node/distance_lanes-inl.hpp"
#include "query/node/heap.hpp"
#include "query/node/side-inl.hpp"
#include "src/layout.hpp"
#include "src/slab.hpp"

#include <hwy/cache_control.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <type_traits>
#include <utility>

HWY_BEFORE_NAMESPACE();
namespace prolate::query::HWY_NAMESPACE {
namespace {

// One of the two trees, as that whose children are tested.
struct DistanceSide : Side<PlacedNodeWithBox> {
    DistanceSide(const TreeSide& side, const LatticePose& other_to_here)
        : Side(side, other_to_here), step(step_of(lattice)), per_step(steps_per_metre(lattice)),
          triangles(tree.raw().triangles()),
          triangle_bytes(static_cast<uint32_t>(3 * index_bytes(tree.vertex_count()))) {
        std::fill(skipped, skipped + kBlockLanes, DistanceSearch::kInfinity);
    }

    const double step, per_step;      // metres, and lattice steps a metre
    const std::byte* const triangles; // null without any
    const uint32_t triangle_bytes;
    alignas(64) double skipped[kBlockLanes]; // least bound of the nodes that were skipped in each lane, steps
};

// The least bound first; of equal ones, which flat faces have by the thousand, what lies opposite each other.
struct ByBoundAndCenters {
    using Entry = Scratch::Entry;
    static constexpr uint32_t kFlags = kOpenB | kLeaves;
    static bool before(const Entry& x, const Entry& y) {
        return x.bound < y.bound || (x.bound == y.bound && (x.flags & ~kFlags) < (y.flags & ~kFlags));
    }
    // Bits of an entry's flags, for the distance of its centers: a float's, as integers in the same order.
    static uint32_t flags(float between) { return std::bit_cast<uint32_t>(between) & ~kFlags; }
};

// A pair of inner nodes is looked at along the normal of the nearest pair if its bound is this share of enough: then
// the normal is about its own direction.
constexpr double kNearlyEnough = 0.8;

// Scratch::Entry::bound is the pair's, less that of the roots. kFlat: the roots end with faces that are parallel.
template <bool kFlat> class DistanceTraversal {
    using Entry = Scratch::Entry;

public:
    DistanceTraversal(DistanceSearch& search, double by_slabs) // a bound on the distance of the roots
        : s_(search),
          heap_(search.entries), sides_{{search.a, search.lattice_b_to_a}, {search.b, search.lattice_a_to_b}},
          by_slabs_(by_slabs), room_(search.room) {}

    void run() {
        search();
        for (const DistanceSide& side : sides_)
            for (const double bound : side.skipped) s_.skipped = std::min(s_.skipped, bound * side.step);
        s_.a.deepest = sides_[0].deepest, s_.b.deepest = sides_[1].deepest;
    }

private:
    void search() {
        s_.open = 0;
        if (budget() < 1) return;
        s_.open = DistanceSearch::kInfinity;
        Entry e;
        const bool near = roots(e);
        if (!(base_ > 0)) { // they may meet
            s_.enclosure = look_inside(s_.a.tree, s_.b.tree, s_.b_to_a, s_.stats, s_.options.max_pair_tests);
            if (s_.enclosure == Verdict::undecided) return stop_at(e);
            if (s_.enclosure == Verdict::overlapping) s_.upper = 0; // only surfaces that meet are of interest now
        }
        if (!near) return done(true);
        for (bool descending = true;;) {
            const TwoPatches patches = patches_at(e);
            if (beyond_normal(e, patches.some())) {
                descending = false;
            } else if (are_leaves(e.flags) || patches.some()) {
                if (!decide(e, patches)) return stop_at(e);
                if (s_.overlapping) return;
                descending = false;
            } else if (too_deep(e) && !descending) {
                s_.open = std::min(s_.open, bound_of(e));
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
                    if (s_.overlapping) return;
                    if (go_on) {
                        e = nearest;
                        continue;
                    }
                }
            }
            if (heap_.empty()) return done(true);
            e = heap_.pop();
            if (s_.skips(bound_of(e))) return done(true);
        }
    }

    // Of a pair of nodes, if all that is below them is to be decided at once; else empty.
    struct TwoPatches {
        TriangleRange a{0, 0}, b{0, 0};
        bool some() const { return a.count > 0 && b.count > 0; }
    };
    HWY_INLINE TwoPatches patches_at(const Entry& e) const {
        if (!all_triangles_ || !no_limit_) return {};
        const TriangleRange a = patch_at(sides_[0], e.node_a);
        return {a, a.count > 0 ? patch_at(sides_[1], e.node_b) : TriangleRange{0, 0}};
    }
    bool decide(const Entry& e, const TwoPatches& patches) {
        return patches.some() ? patches_.decide(e, patches.a, patches.b, bound_of(e))
                              : s_.decide(e.node_a, e.node_b, bound_of(e));
    }
    uint64_t budget() const { return s_.left(); }
    double bound_of(const Entry& e) const { return base_ + double{e.bound}; }
    bool too_deep(const Entry& e) const { return query::too_deep(e, sides_[0], sides_[1]); }
    // Is a pair that comes up far enough apart along the normal of the nearest one? Where a level ends the search, only
    // leaves are asked, for the reason given at no_limit_. Ellipsoids reach so far beyond their neighbours that it does
    // not pay.
    HWY_INLINE bool beyond_normal(const Entry& e, bool patches) {
        if (!all_triangles_) return false;
        const double bound = bound_of(e);
        if (are_leaves(e.flags)) return normal_.separates(e.node_a, e.node_b, bound);
        return no_limit_ && (patches || bound >= kNearlyEnough * s_.enough()) &&
               normal_.separates_closely(e, bound, s_.entries + heap_.size());
    }
    // The search ends here: what is in the heap is open, or if `complete` only not better than what was skipped.
    void done(bool complete) {
        s_.complete = complete;
        if (!complete && !heap_.empty()) s_.open = std::min(s_.open, bound_of(heap_.top()));
    }
    void stop_at(const Entry& e) {
        s_.open = std::min(s_.open, bound_of(e));
        done(false);
    }

    // The pair of the roots; false if it need not be looked at.
    bool roots(Entry& e) {
        const PlacedNodeWithBox& one = sides_[1].place(sides_[0], 0);
        LaneBounds bounds;
        bound_lanes(sides_[1].block(0), sides_[1].lattice.step_exponent, one.single, &one.box,
                    DistanceSearch::kInfinity, bounds);
        ++s_.stats.pair_tests, ++s_.stats.block_tests;
        const double bound = bounds.lower[0] * sides_[1].step;
        base_ = std::isfinite(bound) ? std::max(bound, 0.0) : root_bound(s_);
        base_ = std::max(base_, by_slabs_);
        e = {0, 0, 0, root_flags(s_.a.tree, s_.b.tree, bounds.size[0] > one.single.size)};
        return !s_.skips(base_);
    }

    // Puts the children of a pair that are not skipped into children_, the nearest last; false if the budget is too
    // small.
    bool open(const Entry& e) {
        count_ = 0;
        const uint32_t side = e.flags & kOpenB;
        const uint32_t node = side != 0 ? e.node_b : e.node_a, other = side != 0 ? e.node_a : e.node_b;
        const ChildRange children = children_in(sides_[side].block(node), node % kBlockLanes);
        if (children.count > budget()) return false;
        for_each_block(children, [&](uint32_t first, uint32_t count) {
            test(e, side, other, first, count);
            return true;
        });
        if (count_ == 0) return true;
        std::swap(children_[nearest_], children_[count_ - 1]);
        return true;
    }

    // What opening a node, or looking at a leaf's triangles, will need: they are seldom in the cache.
    static HWY_INLINE void prefetch(const DistanceSide& side, const std::byte* block, uint32_t lane, bool leaf) {
        if (leaf) {
            if (side.triangles != nullptr)
                hwy::Prefetch(side.triangles + size_t{first_triangle(block, lane)} * side.triangle_bytes);
        } else {
            const std::byte* const children = side.block(first_child(block, lane));
            for (size_t i = 0; i < kBlockBytes; i += kBlockAlignment) hwy::Prefetch(children + i);
        }
    }

    // One block against a node of the other tree.
    HWY_INLINE void test(const Entry& e, uint32_t open, uint32_t other, uint32_t first, uint32_t count) {
        DistanceSide& side = sides_[open];
        const std::byte* const block = side.block(first);
        s_.stats.pair_tests += count, ++s_.stats.block_tests;
        side.deepest = std::max(side.deepest, first + count - 1);
        const PlacedNodeWithBox& one = side.place(sides_[open ^ kOpenB], other);
        const uint32_t other_leaf = e.flags & (open != 0 ? kLeafA : kLeafB);
        const uint32_t this_leaf = open != 0 ? kLeafB : kLeafA;
        LaneBounds bounds;
        bound_lanes(block, side.lattice.step_exponent, one.single, &one.box, s_.enough() * side.per_step, bounds);
        const DistanceSide& there = sides_[open ^ kOpenB];
        const std::byte* const hull_one =
            other_leaf != 0 ? nullptr : hull_of(there.hulls, there.block(other), other % kBlockLanes);
        const uint32_t nodes = (1u << count) - 1, leaves = side.leaf_lanes(first, block);
        note_skipped(bounds, nodes & ~bounds.near, side);
        for (uint32_t near = bounds.near & nodes; near != 0; near &= near - 1) {
            const auto lane = static_cast<uint32_t>(std::countr_zero(near));
            const bool leaf = (leaves >> lane & 1) != 0;
            double lower = bounds.lower[lane] * side.step; // less than 0: the deeper, the nearer
            if (have_hulls_) {
                const std::byte* const hull = leaf ? nullptr : hull_of(side.hulls, block, lane);
                lower += side.step * hulls_add(bounds, lane, one.single.size, hull_one, hull);
                if (s_.skips(lower)) continue;
                if (slabs_pay() && (may_have_slab(hull_one) || may_have_slab(hull))) {
                    lower = slabs_add(lower, bounds, lane, open, other, hull_one, first + lane, hull);
                    if (s_.skips(lower)) continue;
                }
            }
            const uint32_t node = first + lane;
            if (leaf && other_leaf != 0 && all_triangles_ &&
                normal_.separates(open != 0 ? other : node, open != 0 ? node : other, lower))
                continue;
            const bool open_this = !leaf && (other_leaf != 0 || bounds.size[lane] > one.single.size);
            if (open_this || (leaf && other_leaf != 0)) prefetch(side, block, lane, leaf);
            uint32_t flags = (open_this ? open : open ^ kOpenB) | (leaf ? this_leaf : 0) | other_leaf;
            bool nearest = count_ == 0 || lower < least_;
            if constexpr (kFlat) {
                const auto between = static_cast<float>(side.step * bounds.between[lane]); // metres
                flags |= ByBoundAndCenters::flags(between);
                const bool equal = std::abs(lower - least_) <= double{kept_less_};
                nearest = count_ == 0 || (equal ? between < least_between_ : lower < least_);
                if (nearest) least_between_ = between;
            }
            if (nearest) nearest_ = count_, least_ = lower;
            const float bound = inherit(e.bound, lower);
            children_[count_++] = {open != 0 ? other : node, open != 0 ? node : other, bound, flags};
        }
    }
    // Once there are more pairs than usual: much is equally near.
    bool slabs_pay() const { return have_slabs_ && s_.stats.block_tests > kPatience; }
    static HWY_INLINE bool may_have_slab(const std::byte* hull) { return hull != nullptr && has_slab(hull); }
    // What a lane's bound becomes by slabs, of which one at least of the two nodes has any.
    HWY_NOINLINE double slabs_add(double lower, const LaneBounds& bounds, uint32_t lane, uint32_t open, uint32_t other,
                                  const std::byte* hull_other, uint32_t node, const std::byte* hull) const {
        const glm::dvec3 along(bounds.n[0][lane], bounds.n[1][lane], bounds.n[2][lane]);
        const NodeWithHull here{sides_[open].tree, node, hull}, there{sides_[open ^ kOpenB].tree, other, hull_other};
        const NodeWithHull &a = open != 0 ? there : here, &b = open != 0 ? here : there;
        const bool useful = may_tell(a, b, s_.b_to_a, open != 0 ? s_.b_to_a.rotation * along : along);
        return useful ? std::max(lower, s_.slabs_apart(a, b)) : lower;
    }
    static HWY_INLINE void note_skipped(const LaneBounds& bounds, uint32_t lanes, DistanceSide& side) {
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
        const float below = own - (std::abs(own) * 0x1p-22f + kept_less_);
        return below > parent ? below : parent;
    }

    // Searches all children_ and all below them, nearest first, on the scratch above the heap. False if the budget
    // runs out.
    bool depth_first() {
        Entry* const stack = s_.entries + heap_.size();
        uint32_t size = 0;
        const auto push = [&] { size = static_cast<uint32_t>(std::copy_n(children_, count_, stack + size) - stack); };
        push();
        bool within = true;
        while (size > 0 && !s_.overlapping) {
            const Entry e = stack[--size];
            if (s_.skips(bound_of(e)) || (all_triangles_ && normal_.separates(e.node_a, e.node_b, bound_of(e))))
                continue;
            const TwoPatches patches = patches_at(e);
            const bool leaves = are_leaves(e.flags) || patches.some();
            if (leaves || !too_deep(e)) within = within && (leaves ? decide(e, patches) : open(e));
            if (!within || (!leaves && too_deep(e)))
                s_.open = std::min(s_.open, bound_of(e));
            else if (!leaves)
                push();
        }
        return within;
    }

    DistanceSearch& s_;
    PairHeap<std::conditional_t<kFlat, ByBoundAndCenters, ByBound>> heap_;
    DistanceSide sides_[2];
    const bool have_hulls_ = s_.a.tree.has_triangles() || s_.b.tree.has_triangles();
    // Where a level ends the search, the bounds of a pair must not depend on when it comes up, or a deeper search might
    // find less.
    const bool no_limit_ = s_.a.limit_from == UINT32_MAX && s_.b.limit_from == UINT32_MAX;
    const bool have_slabs_ = (s_.a.has_slabs || s_.b.has_slabs) && no_limit_;
    const bool all_triangles_ = s_.a.tree.has_triangles() && s_.b.tree.has_triangles();
    Patches patches_{s_};
    AlongNormal normal_{s_};
    const double by_slabs_; // a bound of the roots
    double base_ = 0;       // bound of the roots, metres
    uint32_t room_;         // of the heap: what depth_first() needs is kept free
    // Kept bounds are less by this: of slabs by their rounding, so that equal ones are equal.
    const float kept_less_ = kFlat ? static_cast<float>(0x1p-43 * s_.reach_of_triangles()) : 0x1p-120f;
    uint32_t count_ = 0;   // of children_
    uint32_t nearest_ = 0; // of them, while they are tested, and its own bound
    double least_ = 0;
    float least_between_ = 0; // of its centers
    Entry children_[kMaxDegree];
};

// A bound on the distance of the roots if both have slabs, which are parallel; else 0.
double roots_by_slabs(const DistanceSearch& search) {
    const NodeWithHull a = with_hull(search.a.tree, 0), b = with_hull(search.b.tree, 0);
    if (!is_flat(a) || !is_flat(b) || !may_tell(a, b, search.b_to_a, glm::dvec3(0))) return 0;
    return search.slabs_apart(a, b);
}

void traverse_target(DistanceSearch& search) {
    const double by_slabs = search.a.has_slabs && search.b.has_slabs ? roots_by_slabs(search) : 0;
    if (by_slabs > 0)
        DistanceTraversal<true>(search, by_slabs).run();
    else
        DistanceTraversal<false>(search, 0).run();
}

} // namespace
} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace prolate::query {
HWY_EXPORT(traverse_target);
void traverse(DistanceSearch& search) noexcept {
    HWY_DYNAMIC_DISPATCH(traverse_target)(search);
}
} // namespace prolate::query
#endif // HWY_ONCE
