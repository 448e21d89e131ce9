// When do moving bodies meet? Conservative advancement of pairs of nodes, each at its own pace, the earliest first.
//
// Sources: Mirtich, "Impulse-based dynamic simulation of rigid body systems" (1996), section 2: lower bounds on the
// time of impact in a heap, of which only the earliest is ever improved; there for pairs of bodies, here for pairs of
// nodes. Zhang et al. 2007 (sweep_lanes-inl.hpp) for how far a pair can be advanced; Tang, Kim and Manocha, "C2A:
// controlled conservative advancement for continuous collision detection of polygonal models" (2009), advance whole
// bodies by the least of all pairs instead, and start from the roots again at each step.
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
// Memory: as in distance.cpp. When the heap is full, pairs are searched depth first, up to the earliest meeting found,
// until there is room.
//
// Complexity: one block test for each pair of nodes that come near each other, and for each step of two leaves 2 to 6
// evaluations of their gap along a direction.
#include "query/simd/targets.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "query/sweep/sweep.cpp"
#include <hwy/foreach_target.h>

#include "query/inside/enclosure.hpp"
#include "query/node/heap.hpp"
#include "query/node/order.hpp"
#include "query/sweep/lanes-inl.hpp"
#include "query/sweep/search.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

HWY_BEFORE_NAMESPACE();
namespace prolate::query::HWY_NAMESPACE {
namespace {

// Low bits of the entry's time. kTouch: the pair has been looked at then, and has no gap.
constexpr uint32_t kOpenB = 1, kLeafA = 2, kLeafB = 4, kTouch = 8, kLeaves = kLeafA | kLeafB,
                   kFlags = kLeaves | kOpenB | kTouch;

// A pair is advanced rather than opened if its gap is more than this share of the node to be opened. Much more, and
// bodies that turn near each other are cut up; much less, and pairs creep.
constexpr double kWorthWaiting = 1.0 / 32;

// The time of an entry is a double, rounded down to make room for the flags: its upper half in place of the bound.
uint64_t time_bits(const QueryContext::Entry& e) {
    return uint64_t{std::bit_cast<uint32_t>(e.bound)} << 32 | (e.flags & ~kFlags);
}
double time_of(const QueryContext::Entry& e) {
    return std::bit_cast<double>(time_bits(e));
}
QueryContext::Entry entry(uint32_t node_a, uint32_t node_b, double time, uint32_t flags) {
    const auto bits = std::bit_cast<uint64_t>(time);
    const auto upper = static_cast<uint32_t>(bits >> 32), lower = static_cast<uint32_t>(bits);
    return {node_a, node_b, std::bit_cast<float>(upper), (lower & ~kFlags) | flags};
}
struct ByTime {
    static bool before(const QueryContext::Entry& x, const QueryContext::Entry& y) {
        return time_bits(x) < time_bits(y); // times are not negative
    }
};

class Search {
    using Entry = QueryContext::Entry;

public:
    explicit Search(SweepSearch& query) : q_(query), heap_(query.entries) {
        const auto children = [](const TreeView& tree) { return uint64_t{tree.degree()} * (tree.level_count() - 1); };
        room_ = static_cast<uint32_t>(QueryContext::kEntries - kMaxDegree - children(q_.a.tree) - children(q_.b.tree));
    }

    void run() {
        q_.open = 0;
        if (budget() < 1) return;
        Entry e = roots();
        if (q_.enclosure == Verdict::undecided) return;
        q_.open = 1;
        if (q_.enclosure == Verdict::overlapping) // only surfaces that meet now are of interest
            q_.horizon = std::numeric_limits<double>::min();
        for (;;) {
            if (!(time_of(e) < q_.horizon)) break; // and so are all others
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
        q_.complete = true;
    }

private:
    uint64_t budget() const { return q_.left(); }
    void stop_at(double time) { q_.open = std::min(q_.open, time); }

    bool too_deep(const Entry& e) const {
        return (e.flags & kOpenB) != 0 ? e.node_b >= q_.b.limit_from : e.node_a >= q_.a.limit_from;
    }

    // The pair of the roots.
    Entry roots() {
        const auto leaf = [](const TreeSide& body) { return body.tree.is_leaf(0) ? 1u : 0u; };
        const uint32_t leaves = leaf(q_.a) * kLeafA | leaf(q_.b) * kLeafB;
        Times times;
        q_.move_to(0);
        test<true>(0, 0, 0, 1, times);
        if (!(times.gap[0] > 0))
            q_.enclosure = look_inside(q_.a.tree, q_.b.tree, q_.now.b_to_a, q_.stats, q_.options.max_pair_tests);
        const bool open_b = leaf(q_.b) == 0 && (leaf(q_.a) != 0 || times.bounds.size[0] > times.one_size);
        return entry(0, 0, times.time[0], (open_b ? kOpenB : 0) | leaves);
    }

    // Replaces a pair by children_, all of them later; none if it meets, which is noted. False if the budget is too
    // small.
    bool look_at(const Entry& e) {
        count_ = 0;
        q_.move_to(time_of(e));
        if (budget() < 1) return false;
        const bool leaves = (e.flags & kLeaves) == kLeaves;
        double until = q_.time;
        if (leaves || too_deep(e)) {
            if (q_.triangle_tests(e.node_a, e.node_b, !leaves) >= budget()) return false;
            ++q_.stats.pair_tests;
            until = q_.advance(e.node_a, e.node_b, !leaves);
        } else {
            const bool open_b = (e.flags & kOpenB) != 0;
            if ((e.flags & kTouch) == 0) until = open_b ? later<true>(e) : later<false>(e);
            if (!(until - q_.time > kLeastStep * q_.time)) return open_b ? open<true>(e) : open<false>(e);
        }
        if (until < q_.horizon) push(entry(e.node_a, e.node_b, until, e.flags & kFlags), 0);
        return true;
    }
    // The time until which a pair keeps apart, seen from now; now, if its gap is too small to gain much.
    template <bool kB> double later(const Entry& e) {
        const uint32_t node = kB ? e.node_b : e.node_a, lane = node % kBlockLanes;
        Times times;
        test<kB>(node - lane, kB ? e.node_a : e.node_b, lane, lane + 1, times);
        return times.gap[lane] > kWorthWaiting * times.bounds.size[lane] ? times.time[lane] : q_.time;
    }

    struct Times {
        LaneBounds bounds;
        double gap[kBlockLanes]; // beyond the target, steps of the block's lattice
        double time[kBlockLanes];
        float one_size;
    };
    // Lanes from `begin` to `end` of the block whose first slot is `first`, of B if kB, against `node` of the other.
    template <bool kB> HWY_INLINE void test(uint32_t first, uint32_t node, uint32_t begin, uint32_t end, Times& out) {
        TreeSide& body = kB ? q_.b : q_.a;
        const TreeSide& other = kB ? q_.a : q_.b;
        const MotionFrame& frame = kB ? q_.frame_b : q_.frame_a;
        const std::byte* const block = body.block(first);
        const int32_t exponent = body.lattice.step_exponent;
        const Single one = place_here(other.block(node), node % kBlockLanes, frame.y_to_x);
        LaneSpeeds speeds;
        bound_lanes(block, exponent, one, out.bounds);
        speed_lanes(block, exponent, one, frame, out.bounds, speeds);
        out.one_size = one.size;
        q_.stats.pair_tests += end - begin, ++q_.stats.block_tests;
        body.deepest = std::max(body.deepest, first + end - 1);
        const double target = std::ldexp(q_.target, -exponent);
        for (uint32_t i = begin; i < end; ++i) {
            const double lengths = one.reach + one.size + double{kLargestCenter} + out.bounds.size[i];
            out.gap[i] = out.bounds.lower[i] - target - q_.now.slack * lengths;
            out.time[i] = q_.time;
            if (out.gap[i] > 0)
                out.time[i] +=
                    q_.overshoot * closing_time(out.gap[i], speeds.rate[i], speeds.curve[i], speeds.most_rate[i]);
        }
    }

    template <bool kB> bool open(const Entry& e) {
        const TreeSide& body = kB ? q_.b : q_.a;
        const ChildRange children = body.tree.children(kB ? e.node_b : e.node_a);
        if (children.count > budget()) return false;
        const uint32_t node = kB ? e.node_a : e.node_b;
        const bool other_leaf = (e.flags & (kB ? kLeafA : kLeafB)) != 0;
        for (uint32_t i = 0; i < children.count; i += kBlockLanes) {
            const uint32_t first = children.first + i, count = std::min(children.count - i, kBlockLanes);
            Times times;
            test<kB>(first, node, 0, count, times);
            const std::byte* const counts = body.block(first) + kBlockCount;
            for (uint32_t lane = 0; lane < count; ++lane) {
                if (times.time[lane] >= q_.horizon) continue;
                const auto stored = static_cast<uint8_t>(counts[lane]);
                const bool leaf = first >= body.leaves_from || stored == 0 || stored >= kTriangleLeaf;
                const bool open_this = !leaf && (other_leaf || times.bounds.size[lane] > times.one_size);
                const uint32_t flags = (open_this == kB ? kOpenB : 0) | (leaf ? (kB ? kLeafB : kLeafA) : 0) |
                                       (e.flags & (kB ? kLeafA : kLeafB)) | (times.time[lane] > q_.time ? 0 : kTouch);
                push(entry(kB ? node : first + lane, kB ? first + lane : node, times.time[lane], flags),
                     times.gap[lane]);
            }
        }
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
        Entry* const stack = q_.entries + heap_.size();
        uint32_t size = 0;
        const auto put = [&](uint32_t n) {
            if (n == 0) return;
            nearest_last(n);
            size = static_cast<uint32_t>(std::copy_n(children_, n, stack + size) - stack);
        };
        put(count);
        while (size > 0) {
            const Entry e = stack[--size];
            if (!(time_of(e) < q_.horizon)) continue;
            if (!look_at(e)) return false;
            put(count_);
        }
        return true;
    }

    SweepSearch& q_;
    PairHeap<ByTime> heap_;
    uint32_t room_; // of the heap: what depth_first() needs is kept free
    uint32_t count_ = 0;
    Entry children_[kMaxDegree];
    double gaps_[kMaxDegree];
};

void search_target(SweepSearch& query) {
    Search(query).run();
}

} // namespace
} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace prolate::query {
HWY_EXPORT(search_target);
void search(SweepSearch& query) noexcept {
    HWY_DYNAMIC_DISPATCH(search_target)(query);
}
} // namespace prolate::query

namespace prolate {
namespace {

// The whole query with the bodies in their fixed order.
SweepResult run(query::SweepSearch& q, const Motion& motion_a) {
    SweepResult out;
    if (!q.motion.finite()) return out;
    query::search(q);
    out.time_lower = q.complete ? q.horizon : std::min(q.open, q.horizon);
    if (q.complete) out.verdict = q.found ? Verdict::overlapping : Verdict::separated;
    if (q.enclosure == Verdict::overlapping)
        out.verdict = Verdict::overlapping, out.enclosed = !q.found, out.time_lower = 0;
    q.stats.deepest_level = std::max(q.a.deepest_level(), q.b.deepest_level());
    out.stats = q.stats;
    if (out.enclosed) {
        out.time_upper = 0;
    } else if (q.found) {
        out.time_upper = q.horizon, out.distance = q.distance, out.pair = q.witness;
        const query::MovingBody& a = q.motion.a();
        const glm::dmat3 rotation = a.rotation(q.horizon);
        const Vec3& t = motion_a.start.translation;
        const glm::dvec3 center = glm::dvec3(t.x, t.y, t.z) + a.center_at(q.horizon);
        const auto to_float = [](const glm::dvec3& v) {
            return Vec3{static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)};
        };
        out.point_a = to_float(rotation * (q.on_a - a.center()) + center);
        out.point_b = to_float(rotation * (q.on_b - a.center()) + center);
        out.normal = to_float(rotation * q.normal);
    }
    return out;
}

} // namespace

SweepResult sweep(const TreeView& a, const Motion& motion_a, const TreeView& b, const Motion& motion_b,
                  QueryContext& context, const SweepOptions& options) noexcept {
    const bool swap = query::must_swap(a, motion_a, b, motion_b);
    query::SweepSearch q = swap ? query::SweepSearch(b, motion_b, a, motion_a, context, options)
                                : query::SweepSearch(a, motion_a, b, motion_b, context, options);
    SweepResult out = run(q, swap ? motion_b : motion_a);
    if (swap) {
        out.pair = {out.pair.node_b, out.pair.node_a, out.pair.triangle_b, out.pair.triangle_a};
        std::swap(out.point_a, out.point_b);
        out.normal = {-out.normal.x, -out.normal.y, -out.normal.z};
    }
    return out;
}

} // namespace prolate
#endif // HWY_ONCE
