// Ray against tree: eight children at a time, nearest first.
//
// The kernel (lanes-inl.hpp) gives a lower bound of the parameter at which the ray enters each child: its box, and its
// ellipsoid, too, unless the tree is exact and the ray thin. (Boxes alone take 20 % less time on the horse, the bunny
// and machine parts, and 2 to 6 % on coarse meshes.) Children wait on a stack, the nearest on top, and are skipped when
// the best hit so far lies before their bound. Leaves are decided in double precision (ray.hpp).
//
// Sound because a node's bounding volume holds all leaves below it: where the ray misses the node, it misses these. To
// meet the ellipsoids of a cut, also of an exact tree (raycast_cut), the nodes' own are grown until they hold all below
// them; their boxes are not, and are passed over.
//
// Complexity: one block test for each node that is opened.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "query/raycast/search.cpp"
#include "query/simd/targets.hpp" // before foreach_target.h

#include <hwy/foreach_target.h>

#include "query/raycast/lanes-inl.hpp"
#include "query/raycast/search.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

HWY_BEFORE_NAMESPACE();
namespace prolate::query::HWY_NAMESPACE {
namespace {

template <bool kThick, bool kGrown> class RaycastTraversal {
public:
    explicit RaycastTraversal(RaycastSearch& search) : s_(search) {}

    // False if the tests ran out.
    bool run() {
        if (!test(0, 1)) return !leave_aside(0);
        while (size_ > 0) {
            const Scratch::Entry e = s_.stack[--size_];
            if (e.bound > limit_) continue;
            const ChildRange children = s_.side.tree.children(e.node_a);
            if (children.count == 0 || e.node_a >= s_.side.limit_from) {
                if (s_.side.tree.triangles(e.node_a).count > s_.left()) return !leave_aside(e.bound);
                if (!s_.meet(e.node_a)) continue;
                if (s_.any) return leave_aside(std::numeric_limits<float>::infinity());
                const double limit = s_.best.t / s_.ray.length;
                // Rounded up; below the kernel's margin anyway, as is the division's rounding.
                if (limit < 1) limit_ = std::nextafter(static_cast<float>(limit), 1.0f);
                continue;
            }
            base_ = size_;
            if (!for_each_block(children, [&](uint32_t first, uint32_t count) { return test(first, count); }))
                return !leave_aside(e.bound);
        }
        return true;
    }

private:
    // One block: puts the lanes that may be met on the stack, the nearest of the family on top.
    bool test(uint32_t first, uint32_t count) {
        if (count > s_.left()) return false;
        s_.stats.pair_tests += count, ++s_.stats.block_tests;
        s_.side.deepest = std::max(s_.side.deepest, first + count - 1);
        alignas(32) float entries[kBlockLanes];
        const std::byte* const block = kGrown ? s_.side.tree.raw().block(first / kBlockLanes) : s_.side.block(first);
        const int32_t step_exponent = s_.side.lattice.step_exponent;
        const Float limit = set(limit_);
        if constexpr (kGrown) {
            for (size_t i = 0; i < kBlockLanes; i += kFloatLanes) {
                const LaneNodes nodes =
                    grown(load_nodes(block, i, step_exponent), load_unaligned(s_.growth + first + i));
                store(entry_lanes<kThick>(nodes, s_.lattice_ray, limit), entries + i);
            }
        } else {
            const BoxRay boxes = box_ray(block, s_.lattice_ray);
            for (size_t i = 0; i < kBlockLanes; i += kFloatLanes) {
                Float enter = box_entries(block, i, boxes, limit);
                if ((kThick || !boxes_suffice_) && !all(enter > limit))
                    enter = max(enter, entry_lanes<kThick>(load_nodes(block, i, step_exponent), s_.lattice_ray, limit));
                store(enter, entries + i);
            }
        }
        for (uint32_t lane = 0; lane < count; ++lane) {
            if (!(entries[lane] <= limit_)) continue;
            uint32_t at = size_++;
            for (; at > base_ && s_.stack[at - 1].bound < entries[lane]; --at) s_.stack[at] = s_.stack[at - 1];
            s_.stack[at] = {first + lane, 0, entries[lane], 0};
        }
        return true;
    }

    // The search ends here: `bound` and what waits on the stack is not looked at. Always true.
    bool leave_aside(float bound) {
        double least = bound;
        for (uint32_t i = 0; i < size_; ++i) least = std::min(least, double{s_.stack[i].bound});
        s_.clear = least * s_.ray.length;
        return true;
    }

    RaycastSearch& s_;
    // Around a few triangles, boxes are about as close as ellipsoids, and cost a quarter.
    const bool boxes_suffice_ = s_.side.tree.has_triangles();
    uint32_t size_ = 0, base_ = 0;
    float limit_ = 1; // parameter of the best hit
};

bool traverse_target(RaycastSearch& search) {
    const bool thick = search.lattice_ray.thickness > 0;
    if (search.growth)
        return thick ? RaycastTraversal<true, true>(search).run() : RaycastTraversal<false, true>(search).run();
    return thick ? RaycastTraversal<true, false>(search).run() : RaycastTraversal<false, false>(search).run();
}

} // namespace
} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace prolate::query {
HWY_EXPORT(traverse_target);
bool traverse(RaycastSearch& search) noexcept {
    return HWY_DYNAMIC_DISPATCH(traverse_target)(search);
}
} // namespace prolate::query
#endif // HWY_ONCE
