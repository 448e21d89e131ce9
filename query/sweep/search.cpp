// When do moving bodies meet? Conservative advancement of pairs of nodes, each at its own pace, the earliest first.
//
// Sources: Mirtich, "Impulse-based dynamic simulation of rigid body systems" (1996), section 2: lower bounds on the
// time of impact in a heap, of which only the earliest is ever improved; there for pairs of bodies, here for pairs of
// nodes. Zhang et al. 2007 (lanes-inl.hpp) for how far a pair can be advanced; Tang, Kim and Manocha, "C2A:
// controlled conservative advancement for continuous collision detection of polygonal models" (2009), advance whole
// bodies by the least of all pairs instead, and start from the roots again at each step.
//
// The gap of two nodes of exact trees is that of their boxes and hulls along the direction that their ellipsoids have;
// how fast it closes is said by the ellipsoids, which hold all of what moves.
//
// A pair of nodes has a certified time until which what lies below them keeps apart: that at which it was looked at,
// and what its gap, along a direction found then, takes to close. The earliest pair is looked at again, at its own
// time: opened (its larger node, as collide() does), so that its children have times of their own; or, of two leaves,
// advanced further, until they are as near as the tolerance. That is the time of impact, because no other pair meets
// before. Pairs whose time lies beyond the end of the motion are dropped. So bodies that pass each other at a distance
// cost a few tests at the root, and time is cut fine only where and when they are near each other.
//
// A leaf is advanced until half of the tolerance is left, so that each step gains at least the other half: the search
// ends. It ends earlier with a smaller budget, but does the same until then, and the earliest time of all pairs never
// falls.
//
// Whether a closed solid holds a part of the other at the start is settled first; later, surfaces must meet before.
//
// Memory: as in query/distance/search.cpp. When the heap is full, pairs are searched depth first, up to the earliest
// meeting found, until there is room.
//
// Complexity: one block test for each pair of nodes that come near each other, and for each step of two leaves 2 to 6
// evaluations of their gap along a direction.
#include "query/simd/targets.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "query/sweep/search.cpp"
#include <hwy/foreach_target.h>

#include "query/inside/enclosure.hpp"
#include "query/node/best_first.hpp"
#include "query/node/heap.hpp"
#include "query/node/place-inl.hpp"
#include "query/sweep/lanes-inl.hpp"
#include "query/sweep/search.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

HWY_BEFORE_NAMESPACE();
namespace prolate::query::HWY_NAMESPACE {
namespace {

// Flags are the low bits of the entry's time. kTouch: the pair has been looked at then, and has no gap.
constexpr uint32_t kTouch = 8, kFlags = kOpenB | kLeaves | kTouch;

// A pair is advanced rather than opened if its gap is more than this share of the node to be opened. Much more, and
// bodies that turn near each other are cut up; much less, and pairs creep.
constexpr double kWorthWaiting = 1.0 / 32;

// The time of an entry is a double, rounded down to make room for the flags: its upper half in place of the bound.
uint64_t time_bits(const Scratch::Entry& e) {
    return uint64_t{std::bit_cast<uint32_t>(e.bound)} << 32 | (e.flags & ~kFlags);
}
double time_of(const Scratch::Entry& e) {
    return std::bit_cast<double>(time_bits(e));
}
Scratch::Entry entry(uint32_t node_a, uint32_t node_b, double time, uint32_t flags) {
    const auto bits = std::bit_cast<uint64_t>(time);
    const auto upper = static_cast<uint32_t>(bits >> 32), lower = static_cast<uint32_t>(bits);
    return {node_a, node_b, std::bit_cast<float>(upper), (lower & ~kFlags) | flags};
}
struct ByTime {
    static bool before(const Scratch::Entry& x, const Scratch::Entry& y) {
        return time_bits(x) < time_bits(y); // times are not negative
    }
};

// kHulls: of exact trees, one at least. Boxes and hulls are worth their price there.
template <bool kHulls> class SweepTraversal {
    using Entry = Scratch::Entry;

public:
    explicit SweepTraversal(SweepSearch& search) : s_(search), heap_(search.entries), room_(search.room) {}

    void run() {
        s_.open = 0;
        if (budget() < 1) return;
        Entry e = roots();
        if (s_.enclosure == Verdict::undecided) return;
        s_.open = 1;
        if (s_.enclosure == Verdict::overlapping) // only surfaces that meet now are of interest
            s_.horizon = std::numeric_limits<double>::min();
        for (;;) {
            if (!(time_of(e) < s_.horizon)) break; // and so are all others
            if (!look_at(e)) return stop_at(time_of(e));
            bool go_on = false;
            if (count_ > 0) {
                nearest_last(count_);
                const Entry nearest = children_[count_ - 1];
                go_on = heap_.empty() || !ByTime::before(heap_.top(), nearest);
                const uint32_t others = count_ - (go_on ? 1 : 0);
                if (heap_.size() + others <= room_) {
                    for (uint32_t i = 0; i < others; ++i) heap_.push(children_[i]);
                } else if (!depth_first(others)) {
                    return stop_at(time_of(e));
                }
                e = nearest;
            }
            if (go_on) continue;
            if (heap_.empty()) break;
            e = heap_.pop();
        }
        s_.complete = true;
    }

private:
    uint64_t budget() const { return s_.left(); }
    void stop_at(double time) { s_.open = std::min(s_.open, time); }

    // The pair of the roots.
    Entry roots() {
        Times times;
        s_.move_to(0);
        test<true>(0, 0, 0, 1, times);
        if (!(times.gap[0] > 0))
            s_.enclosure = look_inside(s_.a.tree, s_.b.tree, s_.now.b_to_a, s_.stats, s_.options.max_pair_tests);
        return entry(0, 0, times.time[0], root_flags(s_.a.tree, s_.b.tree, times.bounds.size[0] > times.one_size));
    }

    // Replaces a pair by children_, all of them later; none if it meets, which is noted. False if the budget is too
    // small.
    bool look_at(const Entry& e) {
        count_ = 0;
        s_.move_to(time_of(e));
        if (budget() < 1) return false;
        const bool leaves = are_leaves(e.flags);
        double until = s_.time;
        if (leaves || too_deep(e, s_.a, s_.b)) {
            if (s_.triangle_tests(e.node_a, e.node_b, !leaves) >= budget()) return false;
            ++s_.stats.pair_tests;
            until = s_.advance(e.node_a, e.node_b, !leaves);
        } else {
            const bool open_b = (e.flags & kOpenB) != 0;
            if ((e.flags & kTouch) == 0) until = open_b ? later<true>(e) : later<false>(e);
            if (!(until - s_.time > kLeastStep * s_.time)) return open_b ? open<true>(e) : open<false>(e);
        }
        if (until < s_.horizon) push(entry(e.node_a, e.node_b, until, e.flags & kFlags), 0);
        return true;
    }
    // The time until which a pair keeps apart, seen from now; now, if its gap is too small to gain much.
    template <bool kB> double later(const Entry& e) {
        const uint32_t node = kB ? e.node_b : e.node_a, lane = node % kBlockLanes;
        Times times;
        test<kB>(node - lane, kB ? e.node_a : e.node_b, lane, lane + 1, times);
        return times.gap[lane] > kWorthWaiting * times.bounds.size[lane] ? times.time[lane] : s_.time;
    }

    struct Times {
        LaneBounds bounds;
        double gap[kBlockLanes]; // beyond the target, steps of the block's lattice
        double time[kBlockLanes];
        float one_size;
    };
    // Lanes from `begin` to `end` of the block whose first slot is `first`, of B if kB, against `node` of the other.
    template <bool kB> HWY_INLINE void test(uint32_t first, uint32_t node, uint32_t begin, uint32_t end, Times& out) {
        TreeSide& side = kB ? s_.b : s_.a;
        const TreeSide& other = kB ? s_.a : s_.b;
        const MotionFrame& frame = kB ? s_.frame_b : s_.frame_a;
        const std::byte* const block = side.block(first);
        const int32_t exponent = side.lattice.step_exponent;
        PlacedBox box;
        PlacedBox* const used = kHulls ? &box : nullptr;
        const Single one = place_here(other.block(node), node % kBlockLanes, frame.y_to_x, used);
        LaneSpeeds speeds;
        bound_lanes(block, exponent, one, used, std::numeric_limits<double>::infinity(), out.bounds);
        speed_lanes(block, exponent, one, frame, out.bounds, speeds);
        out.one_size = one.size;
        s_.stats.pair_tests += end - begin, ++s_.stats.block_tests;
        side.deepest = std::max(side.deepest, first + end - 1);
        const double target = s_.target * steps_per_metre(side.lattice);
        const std::byte* const hull_one = kHulls ? inner_hull(other, node) : nullptr;
        for (uint32_t i = begin; i < end; ++i) {
            const double lengths = one.reach + one.size + double{kLargestCenter} + out.bounds.size[i];
            const auto note = [&](double lower) {
                out.gap[i] = lower - target - s_.now.slack * lengths;
                out.time[i] = s_.time;
                if (out.gap[i] > 0)
                    out.time[i] +=
                        s_.overshoot * closing_time(out.gap[i], speeds.rate[i], speeds.curve[i], speeds.most_rate[i]);
            };
            note(out.bounds.lower[i]);
            if (kHulls && out.time[i] < s_.horizon)
                note(out.bounds.lower[i] + hulls_add(out.bounds, i, one.size, hull_one, inner_hull(side, first + i)));
        }
    }
    // The hull of an inner node of an exact tree; null of others.
    static const std::byte* inner_hull(const TreeSide& side, uint32_t node) {
        const uint32_t lane = node % kBlockLanes;
        const std::byte* const block = side.block(node);
        const bool leaf = (side.leaf_lanes(node - lane, block) >> lane & 1) != 0;
        return leaf ? nullptr : hull_of(side.hulls, block, lane);
    }

    template <bool kB> bool open(const Entry& e) {
        constexpr uint32_t kThisLeaf = kB ? kLeafB : kLeafA, kOtherLeaf = kB ? kLeafA : kLeafB;
        const TreeSide& side = kB ? s_.b : s_.a;
        const ChildRange children = side.tree.children(kB ? e.node_b : e.node_a);
        if (children.count > budget()) return false;
        const uint32_t node = kB ? e.node_a : e.node_b, other_leaf = e.flags & kOtherLeaf;
        for_each_block(children, [&](uint32_t first, uint32_t count) {
            Times times;
            test<kB>(first, node, 0, count, times);
            const uint32_t leaves = side.leaf_lanes(first, side.block(first));
            for (uint32_t lane = 0; lane < count; ++lane) {
                if (times.time[lane] >= s_.horizon) continue;
                const bool leaf = (leaves >> lane & 1) != 0;
                const bool open_this = !leaf && (other_leaf != 0 || times.bounds.size[lane] > times.one_size);
                const uint32_t flags = (open_this == kB ? kOpenB : 0) | (leaf ? kThisLeaf : 0) | other_leaf |
                                       (times.time[lane] > s_.time ? 0 : kTouch);
                push(entry(kB ? node : first + lane, kB ? first + lane : node, times.time[lane], flags),
                     times.gap[lane]);
            }
            return true;
        });
        return true;
    }
    void push(const Entry& e, double gap) {
        gaps_[count_] = gap;
        children_[count_++] = e;
    }
    // Moves the earliest of the first `count` children to the end; of several that are, the deepest in the other.
    void nearest_last(uint32_t count) {
        uint32_t nearest = 0;
        for (uint32_t i = 1; i < count; ++i) {
            const uint64_t x = time_bits(children_[i]), y = time_bits(children_[nearest]);
            if (x < y || (x == y && gaps_[i] < gaps_[nearest])) nearest = i;
        }
        std::swap(children_[nearest], children_[count - 1]), std::swap(gaps_[nearest], gaps_[count - 1]);
    }

    // Searches children_[0 ... count - 1] and all below them, earliest first, on the scratch above the heap. False if
    // the budget runs out.
    bool depth_first(uint32_t count) {
        Entry* const stack = s_.entries + heap_.size();
        uint32_t size = 0;
        const auto put = [&](uint32_t n) {
            if (n == 0) return;
            nearest_last(n);
            size = static_cast<uint32_t>(std::copy_n(children_, n, stack + size) - stack);
        };
        put(count);
        while (size > 0) {
            const Entry e = stack[--size];
            if (!(time_of(e) < s_.horizon)) continue;
            if (!look_at(e)) return false;
            put(count_);
        }
        return true;
    }

    SweepSearch& s_;
    PairHeap<ByTime> heap_;
    uint32_t room_; // of the heap: what depth_first() needs is kept free
    uint32_t count_ = 0;
    Entry children_[kMaxDegree];
    double gaps_[kMaxDegree];
};

void traverse_target(SweepSearch& search) {
    if (search.a.hulls != nullptr || search.b.hulls != nullptr)
        SweepTraversal<true>(search).run();
    else
        SweepTraversal<false>(search).run();
}

} // namespace
} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace prolate::query {
HWY_EXPORT(traverse_target);
void traverse(SweepSearch& search) noexcept {
    HWY_DYNAMIC_DISPATCH(traverse_target)(search);
}
} // namespace prolate::query
#endif // HWY_ONCE
