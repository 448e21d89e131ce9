// A point against a tree: branch and bound, eight children at a time.
//
// Boxes bound distances: for a point near a surface they are as good as ellipsoids and hulls, at a tenth of the price.
// Children that may be near enough wait on a stack, the nearest on top (N. Roussopoulos, S. Kelley, F. Vincent,
// "Nearest Neighbor Queries", ACM SIGMOD International Conference on Management of Data, 1995).
//
// Rounding, u = 2^-24. Along an axis the point has the box coordinate q, computed in double and rounded once to a
// float; the sides s are whole numbers of at most 255, so that s - q is wrong by less than (2 |q| + 255) u, and by the
// point's own error. `slack` is more than twice that, and taken off. Squares and their sum lose 4 u, and a product
// with 1 - 2^-20 makes up for it. Overflow gives an infinite bound where the true one is beyond all floats, and a NaN
// claims nothing.
//
// Complexity: about two block tests a level of the tree, and a few leaves.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "query/points/search.cpp"
#include "query/simd/targets.hpp" // before foreach_target.h

#include <hwy/foreach_target.h>

#include "query/node/block_box-inl.hpp"
#include "query/points/search.hpp"
#include "query/points/triangle_lanes-inl.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <type_traits>

HWY_BEFORE_NAMESPACE();
namespace prolate::query::HWY_NAMESPACE {
namespace {

// Lower bounds of the squared distances of the point from the boxes of a block, steps.
HWY_INLINE void box_squares(const std::byte* block, const LatticeProbe& probe, float (&squares)[kBlockLanes]) {
    const BlockBoxes boxes(block);
    float q[3], slack[3];
    for (size_t i = 0; i < 3; ++i) {
        const double per_step = boxes.per_step(i);
        q[i] = static_cast<float>((probe.position[i] - boxes.origin(i)) * per_step);
        slack[i] = (std::abs(q[i]) + 256) * 0x1p-21f + static_cast<float>(probe.slack * per_step);
    }
    for (size_t first = 0; first < kBlockLanes; first += kFloatLanes) {
        Float sum = set(0);
        for (size_t i = 0; i < 3; ++i) {
            const Float low = box_sides(block, kBlockBoxLow, i, first),
                        high = box_sides(block, kBlockBoxHigh, i, first);
            const Float outside = greater(low - q[i], set(q[i]) - high) - slack[i];
            const Float steps = choose_or_zero(outside > 0, outside) * boxes.step(i);
            sum = sum + steps * steps;
        }
        store(sum * (1 - 0x1p-20f), squares + first);
    }
}

template <class Search> class PointTraversal {
    using Entry = Scratch::Entry;

public:
    explicit PointTraversal(Search& search) : s_(search), stack_(search.stack) {}

    void run() {
        if (!test(0, 1)) return stop(0);
        s_.in_root_box = size_ > 0 && stack_[0].bound == 0;
        while (size_ > 0) {
            const Entry e = stack_[--size_];
            if (!(e.bound <= s_.limit)) continue;
            const std::byte* const block = s_.side.block(e.node_a);
            const uint32_t lane = e.node_a % kBlockLanes;
            const bool is_leaf = (s_.side.leaf_lanes(e.node_a - lane, block) >> lane & 1) != 0;
            if (is_leaf) {
                if (!leaf(e, block)) return stop(e.bound);
                continue;
            }
            const ChildRange children = children_in(block, lane);
            if (!for_each_block(children, [&](uint32_t first, uint32_t count) { return test(first, count); }))
                return stop(e.bound);
        }
    }

private:
    // False if the tests run out.
    bool leaf(const Entry& e, const std::byte* block) {
        if constexpr (std::is_same_v<Search, NearestSearch>) {
            const uint32_t lane = e.node_a % kBlockLanes, count = load_le<uint8_t>(block + kBlockCount + lane);
            if (s_.side.hulls != nullptr && count >= kTriangleLeaf)
                return triangles(e, {first_triangle(block, lane), count - kTriangleLeaf});
        }
        return s_.leaf(e.node_a, s_.metres(e.bound));
    }
    // A leaf's triangles, four at a time; those that may be near enough are decided, the nearest first.
    bool triangles(const Entry& e, const TriangleRange& range) {
        if (range.count > s_.left()) return false;
        s_.stats.triangle_tests += range.count;
        const double bound = s_.metres(e.bound);
        for (uint32_t first = range.first, end = range.first + range.count; first < end; first += kFour) {
            alignas(16) float lower[kFour];
            const uint32_t count = std::min<uint32_t>(end - first, kFour);
            bound_four(s_.side.tree, first, count, s_.point.position, lower);
            for (uint32_t left = (1u << count) - 1; left != 0;) {
                auto lane = static_cast<uint32_t>(std::countr_zero(left));
                for (uint32_t rest = left & (left - 1); rest != 0; rest &= rest - 1)
                    if (const auto other = static_cast<uint32_t>(std::countr_zero(rest)); lower[other] < lower[lane])
                        lane = other;
                left &= ~(1u << lane);
                if (double{lower[lane]} > s_.farthest) break;
                s_.try_triangle(e.node_a, first + lane, std::max(bound, double{lower[lane]}));
            }
        }
        return true;
    }

    // One block: puts the lanes that are near enough on the stack, the nearest last. False if the tests run out.
    bool test(uint32_t first, uint32_t count) {
        if (count > s_.left()) return false;
        s_.stats.pair_tests += count, ++s_.stats.block_tests;
        s_.side.deepest = std::max(s_.side.deepest, first + count - 1);
        alignas(32) float squares[kBlockLanes];
        box_squares(s_.side.block(first), s_.probe, squares);
        const uint32_t base = size_;
        for (uint32_t lane = 0; lane < count; ++lane) {
            const float square = squares[lane];
            if (square > s_.limit) continue;
            uint32_t at = size_++;
            for (; at > base && stack_[at - 1].bound < square; --at) stack_[at] = stack_[at - 1];
            stack_[at] = {first + lane, 0, square, 0};
        }
        return true;
    }
    // The budget ran out: what waits, and what lies below a square of `here`, is open.
    void stop(float here) {
        s_.open = here;
        for (uint32_t i = 0; i < size_; ++i) s_.open = std::min(s_.open, stack_[i].bound);
    }

    Search& s_;
    Entry* const stack_;
    uint32_t size_ = 0;
};

void nearest_target(NearestSearch& search) {
    PointTraversal(search).run();
}
void depth_target(DepthSearch& search) {
    PointTraversal(search).run();
}

} // namespace
} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace prolate::query {
HWY_EXPORT(nearest_target);
HWY_EXPORT(depth_target);
void traverse(NearestSearch& search) noexcept {
    HWY_DYNAMIC_DISPATCH(nearest_target)(search);
}
void traverse(DepthSearch& search) noexcept {
    HWY_DYNAMIC_DISPATCH(depth_target)(search);
}
} // namespace prolate::query
#endif // HWY_ONCE
