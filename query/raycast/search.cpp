// Rays against a tree: eight children at a time, nearest first.
//
// The kernel (lanes-inl.hpp) gives a lower bound of the parameter at which the ray enters each child: its box, and its
// ellipsoid, too, unless the tree is exact and the ray thin. (Boxes alone take 20 % less time on the horse, the bunny
// and machine parts, and 2 to 6 % on coarse meshes.) Children wait on a stack, the nearest on top, and are skipped when
// the best hit so far lies before their bound. Leaves are decided in double precision (ray.hpp): ellipsoids when their
// turn comes, triangles at once, those of all leaves of a block together (triangle_lanes-inl.hpp).
//
// A ray spends most of its time waiting: for what it loads, for the last of a chain of operations, for a guess of what
// comes next that was wrong. So several rays take each step in turn, those without branches first, and wait together.
// None knows of the others: answers and counts are those of a ray by itself.
//
// Sound because a node's bounding volume holds all leaves below it: where the ray misses the node, it misses these. To
// meet the ellipsoids of a cut, also of an exact tree (raycast_cut), the nodes' own are grown until they hold all below
// them; their boxes are not, and are passed over.
//
// Complexity: one block test for each node that is opened.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "query/raycast/search.cpp"
#include "query/simd/targets.hpp" // before foreach_target.h

#include <hwy/cache_control.h>
#include <hwy/foreach_target.h>

#include "query/raycast/lanes-inl.hpp"
#include "query/raycast/search.hpp"
#include "query/raycast/triangle_lanes-inl.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <span>

HWY_BEFORE_NAMESPACE();
namespace prolate::query::HWY_NAMESPACE {
namespace {

enum class Meets {
    triangles,  // of an exact tree, by a thin ray
    ellipsoids, // and what lies within the margin
    grown       // ellipsoids of a cut
};

template <Meets kMeets, bool kAlone> class RaycastTraversal {
public:
    // Begins at the root. False if there is nothing to do.
    bool begin(RaycastSearch& search, size_t place) {
        s_ = &search, side_ = &search.body.side;
        base_ = top_ = search.body.stacks + place * search.body.stack_size;
        left_ = search.body.options.max_pair_tests;
        place_in_lattice(search);
        return open(0, 1, 0, 0);
    }

    // The lanes of the block that may be met become a family on the stack, but for leaves whose triangles come next.
    HWY_INLINE void test() {
        const LatticeRay& ray = lattice_ray_;
        const int32_t step_exponent = side_->lattice.step_exponent;
        const Float limit = set(limit_);
        const size_t count = std::min<size_t>(siblings_, kBlockLanes);
        uint32_t met = 0;
        const auto keep = [&](size_t i, Float enter, Float leave) {
            store_unaligned(enter, top_->bounds + i);
            met |= bits(enter <= leave) << i;
        };
        [[maybe_unused]] BoxRay boxes;
        if constexpr (!kGrown) boxes = box_ray(block_, ray);
        for (size_t i = 0; i < kBlockLanes; i += kFloatLanes) {
            if constexpr (kGrown) {
                const LaneNodes nodes =
                    grown(load_nodes(block_, i, step_exponent), load_unaligned(s_->body.growth + first_ + i));
                keep(i, ellipsoid_entries(nodes, limit), limit);
            } else {
                BoxTimes in = box_times(block_, i, ray, boxes, limit);
                if constexpr (kMeets != Meets::triangles)
                    if (!all(in.enter > in.leave))
                        in.enter = max(in.enter, ellipsoid_entries(load_nodes(block_, i, step_exponent), limit));
                keep(i, in.enter, in.leave);
            }
        }
        met &= (1u << count) - 1;
        if constexpr (kMeets == Meets::triangles) {
            const uint32_t leaves = triangle_lanes(block_);
            leaves_ = met & leaves, met &= ~leaves;
        }
        waiting_lanes_ = met;
        top_->first = first_, top_->level = level_;
        siblings_ -= static_cast<uint32_t>(count);
    }

    // Are there triangles to meet?
    bool at_leaves() const { return leaves_ != 0; }

    // Takes up to four triangles off the leaves, if the tests suffice.
    void gather() {
        constexpr uint32_t kFour = RayTriangles::kLanes;
        for (gathered_ = 0; leaves_ != 0 && gathered_ < kFour;) {
            const auto lane = static_cast<uint32_t>(std::countr_zero(leaves_));
            const uint32_t from = first_triangle(block_, lane) + of_leaf_,
                           count = load_le<uint8_t>(block_ + kBlockCount + lane) - uint32_t{kTriangleLeaf};
            if (of_leaf_ == 0) {
                if (!afford(count)) {
                    leaves_ = 0;
                    break;
                }
                s_->stats.triangle_tests += count;
                hwy::Prefetch(side_->tree.raw().triangles() +
                              size_t{from} * 3 * index_bytes(side_->tree.vertex_count()));
            }
            for (uint32_t i = 0; i < kFour; ++i) // without a guess of how many there are
                nodes_[gathered_ + i] = first_ + lane, triangles_.index[gathered_ + i] = from + i;
            const uint32_t some = std::min(count - of_leaf_, kFour - gathered_);
            const bool all = of_leaf_ + some == count;
            gathered_ += some, of_leaf_ = all ? 0 : of_leaf_ + some;
            leaves_ = all ? leaves_ & (leaves_ - 1) : leaves_;
        }
        for (uint32_t i = 1; i < kFour; ++i) // the first one again, for want of others
            triangles_.index[i] = triangles_.index[i < gathered_ ? i : 0], nodes_[i] = nodes_[i < gathered_ ? i : 0];
    }
    HWY_INLINE void test_triangles() {
        hits_ = hit_four(side_->tree, triangles_, s_->ray, s_->body.root.reach, std::min(s_->best.t, s_->ray.length));
    }
    void meet_triangles() {
        if (gathered_ == 0) return;
        const uint32_t node = nodes_[hits_.lane], triangle = triangles_.index[hits_.lane];
        const bool better = hits_.t < s_->best.t;
        if (!better && hits_.open == 0) return; // guessed, so that what comes next need not wait for it
        s_->best.t = std::min(s_->best.t, hits_.t), s_->found = s_->found || better;
        s_->node = better ? node : s_->node, s_->triangle = better ? triangle : s_->triangle;
        for (uint32_t rest = hits_.open; rest != 0; rest &= rest - 1) {
            const auto i = static_cast<uint32_t>(std::countr_zero(rest));
            s_->meet_triangle(nodes_[i], triangles_.index[i]);
        }
        heed_best();
    }

    // Turns to the next block. False if the search ends.
    bool next() {
        if (!s_->finished) return end(bound_); // leaves of the block are left, also where others are hit
        if (done_) return end(siblings_ > 0 ? bound_ : kNever);
        if (std::has_single_bit(waiting_lanes_) && siblings_ == 0) { // as it is most often, and sooner found
            const auto lane = static_cast<uint32_t>(std::countr_zero(waiting_lanes_)) % kBlockLanes;
            const float bound = top_->bounds[lane];
            if (bound <= limit_ && !ends(first_, block_, lane)) return open_children(block_, lane, bound, level_);
        }
        push();
        if (siblings_ > 0) return open(first_ + kBlockLanes, siblings_, bound_, level_);
        while (top_ != base_) {
            RayFamily& family = top_[-1];
            const uint32_t lane = nearest(family);
            const float bound = family.bounds[lane];
            family.waiting &= ~(1u << lane);
            if (bound > limit_) family.waiting = 0;
            if (family.waiting == 0) --top_;
            if (bound > limit_) continue;
            const std::byte* const block = block_of(family.first);
            if (!ends(family.first, block, lane)) return open_children(block, lane, bound, family.level);
            if (!meet(family.first + lane)) return end(bound);
            if (done_) return end(kNever);
        }
        return false;
    }
    // Of what is told after the search.
    void finish() const {
        s_->stats.pair_tests = s_->body.options.max_pair_tests - left_ - s_->stats.triangle_tests;
        s_->stats.block_tests = blocks_, s_->stats.deepest_level = deepest_;
    }

private:
    static constexpr bool kGrown = kMeets == Meets::grown;
    static constexpr float kNever = std::numeric_limits<float>::infinity();

    // Lanes that are leaves with triangles, as bits.
    static uint32_t triangle_lanes(const std::byte* block) {
        static_assert(kTriangleLeaf == 0x80);
        const uint64_t leaves = load_le<uint64_t>(block + kBlockCount) & 0x8080808080808080;
        return static_cast<uint32_t>((leaves >> 7) * 0x0102040810204080 >> 56); // gathers one bit of each byte
    }
    HWY_INLINE Float ellipsoid_entries(const LaneNodes& nodes, Float limit) const {
        return lattice_ray_.thickness > 0 ? entry_lanes<true>(nodes, lattice_ray_, limit)
                                          : entry_lanes<false>(nodes, lattice_ray_, limit);
    }
    const std::byte* block_of(uint32_t first) const {
        if constexpr (kMeets == Meets::triangles) return side_->blocks + size_t{first / kBlockLanes} * kBlockBytes;
        return kGrown ? side_->tree.raw().block(first / kBlockLanes) : side_->block(first);
    }
    void push() {
        top_->waiting = waiting_lanes_;
        top_ += waiting_lanes_ != 0;
        waiting_lanes_ = 0;
    }
    // Infinite of those that do not wait.
    HWY_INLINE static Float waiting_bounds(const RayFamily& family, size_t first) {
        const std::array<uint8_t, 8> waiting{static_cast<uint8_t>(family.waiting >> first)};
        return choose(hn::LoadMaskBits(FloatTag(), waiting.data()), load_unaligned(family.bounds + first), set(kNever));
    }
    // Of those that wait, some of which there are.
    HWY_INLINE static uint32_t nearest(const RayFamily& family) {
        if constexpr (kAlone) { // what is likely is guessed well
            uint32_t best = 0, rest = family.waiting;
            float least = kNever;
            for (; rest != 0; rest &= rest - 1) {
                const auto lane = static_cast<uint32_t>(std::countr_zero(rest)) % kBlockLanes;
                if (family.bounds[lane] <= least) best = lane, least = family.bounds[lane];
            }
            return best;
        } else {
            Float bounds = set(kNever);
            for (size_t i = 0; i < kBlockLanes; i += kFloatLanes) bounds = min(bounds, waiting_bounds(family, i));
            const Float least = hn::MinOfLanes(FloatTag(), bounds);
            uint32_t lanes = 0;
            for (size_t i = 0; i < kBlockLanes; i += kFloatLanes)
                lanes |= bits(waiting_bounds(family, i) == least) << i;
            return static_cast<uint32_t>(std::bit_width(lanes)) - 1;
        }
    }
    // Is this a leaf, or does it stand for what is below it? Leaves with triangles do not come here.
    bool ends(uint32_t first, const std::byte* block, uint32_t lane) const {
        if (first >= side_->limit_from) return true;
        return kMeets != Meets::triangles && (side_->leaf_lanes(first, block) >> lane & 1) != 0;
    }

    HWY_INLINE bool open_children(const std::byte* block, uint32_t lane, float bound, uint32_t level) {
        return open(first_child(block, lane), load_le<uint8_t>(block + kBlockCount + lane), bound, level + 1);
    }
    HWY_INLINE bool open(uint32_t first, uint32_t siblings, float bound, uint32_t level) {
        first_ = first, siblings_ = siblings, bound_ = bound, level_ = level;
        if (!afford(std::min(siblings, kBlockLanes))) return end(bound);
        block_ = block_of(first);
        ++blocks_, deepest_ = std::max(deepest_, level);
        hwy::Prefetch(block_ + kBlockCount), hwy::Prefetch(block_ + kBlockBoxLow);
        return true;
    }
    HWY_INLINE bool afford(uint32_t tests) {
        s_->finished = tests <= left_;
        if (s_->finished) left_ -= tests;
        return s_->finished;
    }

    // The search ends here: `bound` and what waits on the stack is not looked at. Always false.
    HWY_NOINLINE bool end(float bound) {
        push();
        for (; top_ != base_; --top_)
            for (uint32_t rest = top_[-1].waiting; rest != 0; rest &= rest - 1)
                bound = std::min(bound, top_[-1].bounds[std::countr_zero(rest)]);
        s_->clear = double{bound} * s_->ray.length;
        return false;
    }

    void place_in_lattice(const RaycastSearch& search) {
        using Axes = hn::CappedTag<double, 4>;
        const RaycastBody& body = search.body;
        alignas(32) double origin[4], span[4];
        for (size_t at = 0; at < 4; at += hn::MaxLanes(Axes())) { // behind three coordinates there are others
            const auto per_step = hn::Set(Axes(), body.per_step), length = hn::Set(Axes(), search.ray.length);
            const auto from = hn::LoadU(Axes(), &search.ray.origin.x + at);
            const auto along = hn::LoadU(Axes(), &search.ray.direction.x + at);
            hn::Store(from * per_step - hn::LoadU(Axes(), body.shift + at), Axes(), origin + at);
            hn::Store(along * length * per_step, Axes(), span + at);
        }
        query::HWY_NAMESPACE::place_in_lattice(origin, span, search.ray.reach * body.per_step + body.shift_reach,
                                               double{body.options.margin} * body.per_step, lattice_ray_);
    }

    // The best hit may have changed.
    HWY_INLINE void heed_best() {
        const double limit = s_->best.t / s_->ray.length;
        // Rounded up; below the kernel's margin anyway, as is the division's rounding.
        limit_ = limit < 1 ? std::min(1.0f, next_above(static_cast<float>(limit))) : 1.0f;
        done_ = (s_->any && s_->found) || !(s_->best.t > 0);
    }
    static float next_above(float x) { // x >= 0
        return std::bit_cast<float>(std::bit_cast<uint32_t>(std::abs(x)) + 1);
    }

    // A leaf, or a node that stands for what is below it. False if the tests ran out.
    bool meet(uint32_t at) {
        const TriangleRange triangles = kGrown ? TriangleRange{} : side_->tree.triangles(at);
        if (!afford(triangles.count)) return false;
        s_->stats.triangle_tests += triangles.count;
        if (triangles.count == 0) s_->meet(at);
        for (uint32_t i = 0; i < triangles.count; ++i) s_->meet_triangle(at, triangles.first + i);
        heed_best();
        return true;
    }

    RaycastSearch* s_;
    LatticeRay lattice_ray_;
    const TreeSide* side_;
    RayFamily *base_, *top_; // of the stack: what waits on it
    uint64_t left_;          // tests
    uint32_t blocks_ = 0, deepest_ = 0;
    float limit_ = 1;   // parameter of the best hit
    bool done_ = false; // nothing that waits matters
    // The block that is looked at, how many siblings lie in it and after, and the bound of their parent.
    const std::byte* block_;
    uint32_t first_, siblings_, level_;
    float bound_;
    uint32_t waiting_lanes_ = 0; // of it, at top_
    // Leaves of it whose triangles are still to be met, how many of the first one's were, and those at hand.
    uint32_t leaves_ = 0, of_leaf_ = 0, gathered_ = 0, nodes_[2 * RayTriangles::kLanes] = {};
    RayTriangles triangles_;
    FourHits hits_;
};

template <Meets kMeets, size_t kMost> void traverse_rays(std::span<RaycastSearch> searches) {
    using Traversal = RaycastTraversal<kMeets, kMost == 1>;
    Traversal rays[kMost];
    Traversal* active[kMost];
    uint32_t left = 0;
    for (size_t i = 0; i < searches.size(); ++i) {
        active[left] = rays + i;
        left += active[left]->begin(searches[i], i);
    }
    while (left > 0) {
        Traversal* at_leaves[kMost];
        uint32_t some = 0;
        for (uint32_t i = 0; i < left; ++i) {
            active[i]->test();
            at_leaves[some] = active[i], some += active[i]->at_leaves();
        }
        while (some > 0) {
            uint32_t stay = 0;
            for (uint32_t i = 0; i < some; ++i) {
                at_leaves[i]->gather();
                at_leaves[i]->test_triangles();
                at_leaves[i]->meet_triangles();
                at_leaves[stay] = at_leaves[i], stay += at_leaves[i]->at_leaves();
            }
            some = stay;
        }
        uint32_t stay = 0;
        for (uint32_t i = 0; i < left; ++i) {
            active[stay] = active[i];
            stay += active[i]->next();
        }
        left = stay;
    }
    for (size_t i = 0; i < searches.size(); ++i) rays[i].finish();
}

template <Meets kMeets> void traverse_some(std::span<RaycastSearch> searches) {
    if (searches.size() == 1)
        traverse_rays<kMeets, 1>(searches);
    else
        traverse_rays<kMeets, kRaysAtOnce>(searches);
}

void traverse_target(std::span<RaycastSearch> searches) {
    const RaycastBody& body = searches[0].body;
    if (body.growth)
        traverse_rays<Meets::grown, 1>(searches);
    else if (body.side.tree.has_triangles() && !(body.options.margin > 0))
        traverse_some<Meets::triangles>(searches);
    else
        traverse_some<Meets::ellipsoids>(searches);
}

} // namespace
} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace prolate::query {
HWY_EXPORT(traverse_target);
void traverse(std::span<RaycastSearch> searches) noexcept {
    HWY_DYNAMIC_DISPATCH(traverse_target)(searches);
}
} // namespace prolate::query
#endif // HWY_ONCE
