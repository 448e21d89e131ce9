// A half-space against a tree: eight children at a time, the lowest first.
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
#include <cmath>

HWY_BEFORE_NAMESPACE();
namespace prolate::query::HWY_NAMESPACE {
namespace {

class HeightTraversal {
    using Entry = Scratch::Entry;

public:
    explicit HeightTraversal(HeightSearch& search)
        : s_(search), stack_(search.stack), step_(step_of(search.side.lattice)) {}

    void run() {
        if (!test(0, 1)) return stop(-HUGE_VAL);
        while (size_ > 0) {
            const Entry e = stack_[--size_];
            const double bound = metres(e.bound);
            if (bound > s_.limit || (s_.wanted != nullptr && !s_.wanted(s_.user, e.node_a, bound))) continue;
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
    double metres(float steps) const { return double{steps} * step_; }

    void stop(double here) {
        s_.open = here;
        for (uint32_t i = 0; i < size_; ++i) s_.open = std::min(s_.open, metres(stack_[i].bound));
    }

    // Lower bounds of heights, steps; NaN, which claims nothing, becomes the lowest.
    HWY_INLINE void heights(const std::byte* block, float (&out)[kBlockLanes]) const {
        const BlockBoxes boxes(block);
        const LaneHalfSpace& h = s_.lanes;
        for (size_t first = 0; first < kBlockLanes; first += kFloatLanes) {
            const LaneNodes e = load_nodes(block, first, s_.side.lattice.step_exponent);
            const Float3 n = set(h.normal);
            const Float size = sqrt(trace(shape_of(e.factor)));
            const Float ellipsoid = dot(n, e.center) - h.offset - width(e, n) - (h.slack + kLaneMargin * size);
            Float box = set(0), moduli = set(0);
            for (size_t i = 0; i < 3; ++i) {
                const Float side = box_sides(block, h.normal[i] < 0 ? kBlockBoxHigh : kBlockBoxLow, i, first);
                const Float at = (side * boxes.step(i) + static_cast<float>(boxes.origin(i))) * h.normal[i];
                box = box + at, moduli = moduli + abs(at);
            }
            box = box - h.offset - (h.slack + kLaneMargin * moduli);
            const Float bound = greater(ellipsoid, box);
            store(choose(bound == bound, bound, set(-HUGE_VALF)), out + first);
        }
    }

    bool test(uint32_t first, uint32_t count) {
        if (count > s_.left()) return false;
        s_.stats.pair_tests += count, ++s_.stats.block_tests;
        s_.side.deepest = std::max(s_.side.deepest, first + count - 1);
        alignas(32) float bounds[kBlockLanes];
        heights(s_.side.block(first), bounds);
        const uint32_t base = size_;
        for (uint32_t lane = 0; lane < count; ++lane) {
            const float bound = bounds[lane];
            if (metres(bound) > s_.limit) continue;
            uint32_t at = size_++;
            for (; at > base && stack_[at - 1].bound < bound; --at) stack_[at] = stack_[at - 1];
            stack_[at] = {first + lane, 0, bound, 0};
        }
        return true;
    }

    HeightSearch& s_;
    Entry* const stack_;
    const double step_;
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
