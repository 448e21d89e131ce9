// A simple shape against a tree: eight children at a time.
//
// Children that the culling tests (lanes-inl.hpp) do not separate from the shape wait on a stack, the deepest overlap
// on top; leaves are decided in double precision (rounded_box.hpp).
//
// Sound because a node's bounding volume holds all leaves below it: if the shape is separated from the node, it is from
// these.
//
// Complexity: one block test for each node that is opened.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "query/shapes/search.cpp"
#include "query/simd/targets.hpp" // before foreach_target.h

#include <hwy/foreach_target.h>

#include "query/shapes/lanes-inl.hpp"
#include "query/shapes/search.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

HWY_BEFORE_NAMESPACE();
namespace prolate::query::HWY_NAMESPACE {
namespace {

template <class Search> class ShapeTraversal {
public:
    explicit ShapeTraversal(Search& search) : s_(search), stack_(search.stack) {}

    Verdict run() {
        if (!test(0, 1)) return Verdict::undecided;
        s_.root_met = size_ > 0;
        while (size_ > 0) {
            const uint32_t node = stack_[--size_].node_a;
            const ChildRange children = s_.side.tree.children(node);
            if (children.count == 0) {
                if (s_.side.tree.triangles(node).count > s_.left()) return Verdict::undecided;
                if (s_.meets(node)) return Verdict::overlapping;
                continue;
            }
            if (node >= s_.side.limit_from) { // max_level ends the traversal
                s_.take(node, kNoTriangle);
                return Verdict::overlapping;
            }
            if (!for_each_block(children, [&](uint32_t first, uint32_t count) { return test(first, count); }))
                return Verdict::undecided;
        }
        return Verdict::separated;
    }

private:
    // One block: puts the lanes that may meet the shape on the stack, the deepest last. False if the tests run out.
    bool test(uint32_t first, uint32_t count) {
        QueryStats& stats = s_.result.stats;
        if (count > s_.left()) return false;
        stats.pair_tests += count, ++stats.block_tests;
        s_.side.deepest = std::max(s_.side.deepest, first + count - 1);
        const std::byte* const block = s_.side.block(first);
        uint32_t meet = boxes_meet_shape(block, s_.lanes) & ((1u << count) - 1);
        if (meet == 0) return true;
        alignas(32) float keys[kBlockLanes];
        uint32_t separated = 0;
        for (size_t i = 0; i < kBlockLanes; i += kFloatLanes) {
            const LaneGaps gaps = shape_gaps(load_nodes(block, i, s_.side.lattice.step_exponent), s_.lanes);
            separated |= bits(gaps.gap > 0) << i;
            store(gaps.key, keys + i);
        }
        meet &= ~separated;
        uint32_t deepest = size_;
        float least = HUGE_VALF;
        for (; meet != 0; meet &= meet - 1) {
            const auto lane = static_cast<uint32_t>(std::countr_zero(meet));
            if (keys[lane] < least) least = keys[lane], deepest = size_;
            stack_[size_++] = {first + lane, 0, keys[lane], 0};
        }
        if (deepest < size_) std::swap(stack_[deepest], stack_[size_ - 1]);
        return true;
    }

    Search& s_;
    Scratch::Entry* const stack_;
    uint32_t size_ = 0;
};

Verdict traverse_box(BoxSearch& search) {
    return ShapeTraversal(search).run();
}
Verdict traverse_half_space(HalfSpaceSearch& search) {
    return ShapeTraversal(search).run();
}

} // namespace
} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace prolate::query {
HWY_EXPORT(traverse_box);
HWY_EXPORT(traverse_half_space);
Verdict traverse(BoxSearch& search) noexcept {
    return HWY_DYNAMIC_DISPATCH(traverse_box)(search);
}
Verdict traverse(HalfSpaceSearch& search) noexcept {
    return HWY_DYNAMIC_DISPATCH(traverse_half_space)(search);
}
} // namespace prolate::query
#endif // HWY_ONCE
