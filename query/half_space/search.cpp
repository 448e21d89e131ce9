// A half-space against a tree: eight children at a time, the lowest first; for contacts, those that may lie farthest
// beyond what is known.
//
// With n the half-space's normal, a node is no lower than its ellipsoid, n.c - |L^T n|, and no lower than its box: the
// greater of both bounds counts.
//
// Rounding: of ellipsoids as in query/shapes/lanes-inl.hpp. A box's sides are exact; the sum of three products of them
// with the rounded normal is wrong by less than 5 u of the sum of their moduli, u = 2^-24, of which kLaneMargin, 32 u,
// is taken off, and by what the offset is.
//
// Complexity: a block test for each node that is opened.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "query/half_space/search.cpp"
#include "query/simd/targets.hpp" // before foreach_target.h

#include <hwy/foreach_target.h>

#include "query/half_space/search.hpp"
#include "query/node/block_box-inl.hpp"
#include "query/node/lanes-inl.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

HWY_BEFORE_NAMESPACE();
namespace prolate::query::HWY_NAMESPACE {
namespace {

class HeightTraversal {
    using Entry = Scratch::Entry;

public:
    explicit HeightTraversal(HeightSearch& search)
        : s_(search), stack_(search.stack), step_(step_of(search.side.lattice)),
          per_step_(steps_per_metre(search.side.lattice)) {}

    void run() {
        if (!test(0, 1)) return stop(-HUGE_VAL);
        while (size_ > 0) {
            const Entry e = stack_[--size_];
            const double bound = height(e);
            if (bound > s_.limit) continue;
            if (s_.wanted != nullptr && e.flags != version() && !s_.wanted(s_.user, e.node_a, bound)) {
                s_.passed_over = true;
                continue;
            }
            const std::byte* const block = s_.side.block(e.node_a);
            const uint32_t lane = e.node_a % kBlockLanes;
            if ((s_.side.leaf_lanes(e.node_a - lane, block) >> lane & 1) != 0 || e.node_a >= s_.side.limit_from) {
                if (!s_.leaf(s_.user, e.node_a)) return stop(bound);
                continue;
            }
            const ChildRange children = children_in(block, lane);
            if (!for_each_block(children, [&](uint32_t first, uint32_t count) { return test(first, count); }))
                return stop(bound);
        }
    }

private:
    // An entry has the bound of a node's height in node_b, what it is sorted by in `bound`, and the version of the
    // outline that this is from in `flags`.
    double metres(float steps) const { return double{steps} * step_; }
    double height(const Entry& e) const { return metres(std::bit_cast<float>(e.node_b)); }
    uint32_t version() const { return s_.outline != nullptr ? s_.outline->version : 0; }

    void stop(double here) {
        s_.open = here;
        for (uint32_t i = 0; i < size_; ++i) s_.open = std::min(s_.open, height(stack_[i]));
    }

    // Lower bounds of heights, steps; NaN, which claims nothing, becomes the lowest. And how far the lanes may be
    // beyond the outline, if there is one. Lanes, as bits, that are not above `most` steps; and of these, those that
    // are not beyond.
    struct Kept {
        uint32_t low = 0, within = 0;
    };
    template <bool kOutline>
    HWY_INLINE Kept bounds(const std::byte* block, float most, float (&heights)[kBlockLanes],
                           float (&gains)[kBlockLanes]) const {
        const BlockBoxes boxes(block);
        const LaneHalfSpace& h = s_.lanes;
        Kept out;
        for (size_t first = 0; first < kBlockLanes; first += kFloatLanes) {
            const LaneNodes e = load_nodes(block, first, s_.side.lattice.step_exponent);
            const Float3 n = set(h.normal);
            const Float size = sqrt(trace(shape_of(e.factor)));
            const Float ellipsoid = dot(n, e.center) - h.offset - width(e, n) - (h.slack + kLaneMargin * size);
            Float box = set(0), moduli = set(0);
            const auto side = [&](size_t array, size_t i) {
                return box_sides(block, array, i, first) * boxes.step(i) + static_cast<float>(boxes.origin(i));
            };
            for (size_t i = 0; i < 3; ++i) {
                const Float at = side(h.normal[i] < 0 ? kBlockBoxHigh : kBlockBoxLow, i) * h.normal[i];
                box = box + at, moduli = moduli + abs(at);
            }
            box = box - h.offset - (h.slack + kLaneMargin * moduli);
            const Float bound = greater(ellipsoid, box), sound = choose(bound == bound, bound, set(-HUGE_VALF));
            store(sound, heights + first);
            out.low |= bits(sound <= set(most)) << first;
            if constexpr (kOutline) {
                const Float beyond = gain(e, side, bound);
                store(beyond, gains + first);
                out.within |= bits(beyond <= set(0)) << first;
            }
        }
        out.within &= out.low;
        return out;
    }
    // The ellipsoid and the box each bound how far out a lane reaches.
    template <class Side> HWY_INLINE Float gain(const LaneNodes& e, Side&& side, Float bound) const {
        const HeightOutline& known = *s_.outline;
        const Float3 low{side(kBlockBoxLow, 0), side(kBlockBoxLow, 1), side(kBlockBoxLow, 2)},
            high{side(kBlockBoxHigh, 0), side(kBlockBoxHigh, 1), side(kBlockBoxHigh, 2)};
        Float most = -bound - known.below;
        for (size_t k = 0; k < 2; ++k) {
            const float(&d)[3] = known.directions[k];
            const Float middle = dot(set(d), e.center), half = width(e, set(d));
            const Float3 from{low.x * d[0], low.y * d[1], low.z * d[2]},
                to{high.x * d[0], high.y * d[1], high.z * d[2]};
            const Float farthest = max(from.x, to.x) + max(from.y, to.y) + max(from.z, to.z),
                        nearest = min(from.x, to.x) + min(from.y, to.y) + min(from.z, to.z);
            most = max(most, max(min(farthest, middle + half) - known.beyond[k],
                                 min(-nearest, half - middle) - known.beyond[2 + k]) -
                                 bound * known.lean);
        }
        return most;
    }

    bool test(uint32_t first, uint32_t count) {
        if (count > s_.left()) return false;
        s_.stats.pair_tests += count, ++s_.stats.block_tests;
        s_.side.deepest = std::max(s_.side.deepest, first + count - 1);
        alignas(32) float heights[kBlockLanes], gains[kBlockLanes];
        const uint32_t of = version();
        const std::byte* const block = s_.side.block(first);
        const float most = highest();
        const Kept kept =
            of != 0 ? bounds<true>(block, most, heights, gains) : bounds<false>(block, most, heights, gains);
        const uint32_t siblings = (1u << count) - 1, base = size_;
        s_.passed_over = s_.passed_over || (kept.within & siblings) != 0;
        for (uint32_t left = kept.low & ~kept.within & siblings; left != 0; left &= left - 1) {
            const auto lane = static_cast<uint32_t>(std::countr_zero(left));
            const float key = of != 0 ? -gains[lane] : heights[lane];
            uint32_t at = size_++;
            for (; at > base && stack_[at - 1].bound < key; --at) stack_[at] = stack_[at - 1];
            stack_[at] = {first + lane, std::bit_cast<uint32_t>(heights[lane]), key, of};
        }
        return true;
    }
    // The limit in steps, rounded up.
    float highest() const {
        const auto steps = static_cast<float>(s_.limit * per_step_);
        return steps + 0x1p-22f * std::abs(steps) + std::numeric_limits<float>::min();
    }

    HeightSearch& s_;
    Entry* const stack_;
    const double step_, per_step_;
    uint32_t size_ = 0;
};

void traverse_heights(HeightSearch& search) {
    HeightTraversal(search).run();
}

} // namespace
} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace prolate::query {
HWY_EXPORT(traverse_heights);
void traverse(HeightSearch& search) noexcept {
    HWY_DYNAMIC_DISPATCH(traverse_heights)(search);
}
} // namespace prolate::query
#endif // HWY_ONCE
