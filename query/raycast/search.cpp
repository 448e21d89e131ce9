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
#include "query/raycast/triangle_lanes-inl.hpp"

#include <algorithm>
#include <bit>
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
            const uint32_t lane = e.node_a % kBlockLanes;
            const std::byte* const block = s_.side.block(e.node_a);
            if ((s_.side.leaf_lanes(e.node_a - lane, block) >> lane & 1) != 0 || e.node_a >= s_.side.limit_from) {
                const TriangleRange triangles = s_.side.tree.triangles(e.node_a);
                if (triangles.count > s_.left()) return !leave_aside(e.bound);
                if (!meet(e.node_a, triangles)) continue;
                if (s_.any) return leave_aside(std::numeric_limits<float>::infinity());
                const double limit = s_.best.t / s_.ray.length;
                // Rounded up; below the kernel's margin anyway, as is the division's rounding.
                if (limit < 1) limit_ = std::nextafter(static_cast<float>(limit), 1.0f);
                continue;
            }
            base_ = size_;
            if (!for_each_block(children_in(block, lane),
                                [&](uint32_t first, uint32_t count) { return test(first, count); }))
                return !leave_aside(e.bound);
        }
        return true;
    }

private:
    // A leaf, or a node that stands for what is below it. True if a hit is the best now.
    bool meet(uint32_t at, const TriangleRange& triangles) {
        if (triangles.count == 0 || kGrown) return s_.meet(at);
        s_.stats.triangle_tests += triangles.count;
        bool taken = false;
        for (uint32_t i = 0; i < triangles.count; i += kFour) {
            const uint32_t first = triangles.first + i, count = std::min(triangles.count - i, uint32_t{kFour});
            uint32_t open = (1u << count) - 1;
            if (!(s_.options.margin > 0)) { // what lies beyond the best hit is not taken
                const double farthest = s_.found ? s_.best.t : s_.ray.length;
                open = may_hit(s_.side.tree, first, count, s_.ray, s_.reach, farthest);
            }
            for (; open != 0; open &= open - 1)
                taken = s_.meet_triangle(at, first + static_cast<uint32_t>(std::countr_zero(open))) || taken;
        }
        return taken;
    }

    // One block: puts the lanes that may be met on the stack, the nearest of the family on top.
    bool test(uint32_t first, uint32_t count) {
        if (count > s_.left()) return false;
        s_.stats.pair_tests += count, ++s_.stats.block_tests;
        s_.side.deepest = std::max(s_.side.deepest, first + count - 1);
        alignas(32) float entries[kBlockLanes];
        const std::byte* const block = kGrown ? s_.side.tree.raw().block(first / kBlockLanes) : s_.side.block(first);
        const int32_t step_exponent = s_.side.lattice.step_exponent;
        const Float limit = set(limit_);
        uint32_t open = 0;
        const auto keep = [&](Float enter, size_t i) {
            store(enter, entries + i);
            open |= bits(enter <= limit) << i;
        };
        if constexpr (kGrown) {
            for (size_t i = 0; i < kBlockLanes; i += kFloatLanes) {
                const LaneNodes nodes =
                    grown(load_nodes(block, i, step_exponent), load_unaligned(s_.growth + first + i));
                keep(entry_lanes<kThick>(nodes, s_.lattice_ray, limit), i);
            }
        } else {
            const BoxRay boxes = box_ray(block, s_.lattice_ray);
            for (size_t i = 0; i < kBlockLanes; i += kFloatLanes) {
                Float enter = box_entries(block, i, s_.lattice_ray, boxes, limit);
                if ((kThick || !boxes_suffice_) && !all(enter > limit))
                    enter = max(enter, entry_lanes<kThick>(load_nodes(block, i, step_exponent), s_.lattice_ray, limit));
                keep(enter, i);
            }
        }
        for (open &= (1u << count) - 1; open != 0; open &= open - 1) {
            const auto lane = static_cast<uint32_t>(std::countr_zero(open));
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
