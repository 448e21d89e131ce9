// Tree against tree: simultaneous descent, a block of eight children at a time.
//
// Of a pair of nodes that meet, the larger is opened: its children, up to eight of them in a block, are tested at once
// against the other (lanes-inl.hpp), and those that are not separated from it make new pairs. Two leaves are decided in
// double precision (leaves.cpp). Which node is opened depends on the pair alone, so max_level and budgets only cut the
// descent off: if level l says separated, so does every deeper one.
//
// Sound because a node covers the parts of all its children: if B is apart from A's child i, no part under B meets that
// part of A.
//
// Depth first, and of the children that meet, that with the deepest overlap first: bodies that touch are found out
// soon, and for bodies that do not the order makes no difference.
//
// Complexity: one block test for each pair of nodes that meet, unless both are leaves.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "query/collide.cpp"
#include "query/targets.hpp" // before foreach_target.h

#include <hwy/foreach_target.h>

#include "query/descent.hpp"
#include "query/enclosure.hpp"
#include "query/lanes-inl.hpp"
#include "query/order.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <bit>
#include <utility>

HWY_BEFORE_NAMESPACE();
namespace prolate::query::HWY_NAMESPACE {
namespace {

// QueryContext::Entry::flags: which of the two nodes is to be opened, and whether the other is a leaf; or both are.
constexpr uint32_t kOpenB = 1, kOtherIsLeaf = 2, kLeaves = 4;

template <bool kMargin> class Search {
public:
    explicit Search(Descent& descent)
        : d_(descent),
          stack_(descent.stack), sides_{{descent.a, descent.lattice_b_to_a}, {descent.b, descent.lattice_a_to_b}} {}

    Verdict run() {
        const Verdict verdict = search();
        d_.stats.pair_tests = pair_tests_, d_.stats.block_tests = block_tests_;
        d_.a.deepest = sides_[0].deepest, d_.b.deepest = sides_[1].deepest;
        return verdict;
    }

private:
    // Nodes that were placed before: every third or so is tested against another block soon.
    static constexpr uint32_t kPlaced = 8;
    struct Placed {
        uint32_t node = UINT32_MAX;
        Single single;
    };
    // One of the bodies, as that whose children are tested.
    struct Side {
        Side(const Body& body, const LatticePose& other_to_here)
            : blocks(body.tree.block(0)), step_exponent(body.lattice.step_exponent), leaves_from(body.leaves_from),
              limit_from(body.limit_from), pose(other_to_here), per_step(power_of_two(-step_exponent)) {}
        const std::byte* block(uint32_t slot) const { return blocks + size_t{slot / kBlockLanes} * kBlockBytes; }

        const std::byte* blocks;
        int32_t step_exponent;
        uint32_t leaves_from, limit_from, deepest = 0;
        const LatticePose& pose;
        double per_step;
        Placed placed[kPlaced]; // of the other body's nodes
    };

    Verdict search() {
        // The roots, as if B's were the only child of a node that meets everything.
        if (budget() < 1) return Verdict::undecided;
        test_all(kOpenB, 0, 1, 0, d_.a.tree.is_leaf(0) ? kOtherIsLeaf : 0);
        d_.roots_meet = size_ > 0;
        while (size_ > 0) {
            const auto e = stack_[--size_];
            if ((e.flags & kLeaves) != 0) {
                if (d_.meet(e.node_a, e.node_b)) return Verdict::overlapping;
                continue;
            }
            const uint32_t open = e.flags & kOpenB;
            const uint32_t node = open != 0 ? e.node_b : e.node_a, other = open != 0 ? e.node_a : e.node_b;
            const Side& side = sides_[open];
            if (node >= side.limit_from) { // max_level ends the descent
                if (d_.take({e.node_a, e.node_b, kNoTriangle, kNoTriangle})) return Verdict::overlapping;
                continue;
            }
            const std::byte* const block = side.block(node);
            const uint32_t lane = node % kBlockLanes, count = load_le<uint8_t>(block + kBlockCount + lane);
            const auto first = load_le<uint32_t>(block + kBlockFirst + size_t{4} * lane);
            if (count > budget()) return Verdict::undecided;
            if (count <= kBlockLanes)
                test(open, first, count, other, e.flags & kOtherIsLeaf);
            else
                test_all(open, first, count, other, e.flags & kOtherIsLeaf);
        }
        return Verdict::separated;
    }

    uint64_t budget() const { return d_.options.max_pair_tests - pair_tests_; }

    // One block, B's if kOpenB is given, against a node of the other tree: pushes the pairs that meet, the deepest
    // last.
    HWY_INLINE void test(uint32_t open, uint32_t first, uint32_t count, uint32_t other, uint32_t other_is_leaf) {
        const LaneTag d;
        Side& side = sides_[open];
        const std::byte* const block = side.block(first);
        pair_tests_ += count, ++block_tests_;
        side.deepest = std::max(side.deepest, first + count - 1);
        Placed& placed = side.placed[other % kPlaced];
        if (placed.node != other) {
            placed.single = place_here(sides_[open ^ kOpenB].block(other), other % kBlockLanes, side.pose);
            placed.node = other;
        }
        const Single& single = placed.single;
        const float lattice_margin = kMargin ? margin_in(side) : 0.0f;
        uint32_t meet = boxes_meet(block, single, lattice_margin) & ((1u << count) - 1);
        if (meet == 0) return;
        uint32_t met = 0, larger = 0;
        alignas(32) float depth[kBlockLanes];
        const Lanes margin = hn::Set(d, lattice_margin);
        for (size_t i = 0; i < kBlockLanes; i += hn::Lanes(d)) {
            const LaneTerms t = evaluate(load_nodes(block, i, side.step_exponent), single);
            met |= bits_of(hn::Not(separated<kMargin>(t, margin)), i);
            larger |= bits_of(hn::Gt(t.size, hn::Set(d, single.size)), i);
            hn::StoreU(hn::Div(t.p, t.sum), d, depth + i);
        }
        meet &= met;
        if (meet == 0) return;
        const uint32_t leaves = first >= side.leaves_from ? 0xff : leaf_lanes(block);
        const uint32_t opened = ~leaves & (other_is_leaf != 0 ? 0xff : larger);
        const uint32_t if_opened = open | other_is_leaf;
        const uint32_t if_leaf = other_is_leaf != 0 ? kLeaves : (open ^ kOpenB) | kOtherIsLeaf;
        uint32_t deepest = size_;
        float least = HUGE_VALF;
        for (; meet != 0; meet &= meet - 1) {
            const auto lane = static_cast<uint32_t>(std::countr_zero(meet));
            const uint32_t node = first + lane, flags = (opened >> lane & 1) != 0   ? if_opened
                                                        : (leaves >> lane & 1) != 0 ? if_leaf
                                                                                    : open ^ kOpenB;
            if (depth[lane] < least) least = depth[lane], deepest = size_;
            stack_[size_++] = {open != 0 ? other : node, open != 0 ? node : other, depth[lane], flags};
        }
        std::swap(stack_[deepest], stack_[size_ - 1]);
    }

    // Some or all children, where that is rare: in a loop with the usual case this would cost it registers.
    HWY_NOINLINE void test_all(uint32_t open, uint32_t first, uint32_t count, uint32_t other, uint32_t other_is_leaf) {
        for (uint32_t i = 0; i < count; i += kBlockLanes)
            test(open, first + i, std::min(count - i, kBlockLanes), other, other_is_leaf);
    }

    // Bit i: lane i, if there is such a node, has no children: its count is 0, or one of triangles.
    static uint32_t leaf_lanes(const std::byte* block) {
        static_assert(kTriangleLeaf == 0x80);
        constexpr uint64_t kTop = 0x8080808080808080;
        const auto counts = load_le<uint64_t>(block + kBlockCount);
        const uint64_t some = (counts & ~kTop) + ~kTop; // top bit of a byte: its lower bits are not all zero
        const uint64_t leaves = (counts | ~some) & kTop;
        return static_cast<uint32_t>((leaves >> 7) * 0x0102040810204080 >> 56); // gathers one bit of each byte
    }

    // options.margin + skin in lattice steps, rounded up.
    float margin_in(const Side& side) const {
        return static_cast<float>((double{d_.options.margin} + d_.skin) * kRoundUp * side.per_step);
    }
    static constexpr double kRoundUp = 1 + 0x1p-20; // also pays for the rounding of margin |n|

    // Opening a node takes one entry off and puts at most kMaxDegree on, and no pair lies deeper than both trees
    // together.
    static_assert(QueryContext::kEntries > 2 * (kMaxLevels - 1) * (kMaxDegree - 1) + 1);
    Descent& d_;
    QueryContext::Entry* const stack_;
    uint32_t size_ = 0;
    uint64_t pair_tests_ = 0, block_tests_ = 0;
    Side sides_[2];
};

Verdict descend_target(Descent& descent) {
    return descent.options.margin + descent.skin > 0 ? Search<true>(descent).run() : Search<false>(descent).run();
}

} // namespace
} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace prolate::query {
HWY_EXPORT(descend_target);
Verdict descend(Descent& descent) noexcept {
    return HWY_DYNAMIC_DISPATCH(descend_target)(descent);
}
} // namespace prolate::query

namespace prolate {
namespace {

// The whole query with the bodies in their fixed order.
Verdict run(query::Descent& d) {
    Verdict verdict = query::descend(d);
    if (d.found > 0) verdict = Verdict::overlapping;
    d.stats.deepest_level = std::max(d.a.deepest_level(), d.b.deepest_level());
    if (verdict != Verdict::separated || !d.roots_meet) return verdict;
    return query::look_inside(d.a.tree, d.b.tree, d.b_to_a, d.stats, d.options.max_pair_tests);
}

MeetingPair exchanged(const MeetingPair& pair) {
    return {pair.node_b, pair.node_a, pair.triangle_b, pair.triangle_a};
}

// ---- coherence ----

// Of the smaller root: the first skin, the thinnest and the thickest; and how many times as thick as the last motion.
constexpr double kFirstSkin = 0x1p-8, kThinnestSkin = 0x1p-12, kThickestSkin = 0x1p-5, kSkinSteps = 4;
constexpr double kRoundDown = 1 - 0x1p-20; // more than the rounding of a float

// No point of body B has moved farther than this, as body A sees it, metres; NaN if a pose is not finite.
double motion(const PairCache& cache, const Pose& pose_a, const Pose& pose_b, const query::PlacedEllipsoid& root_b) {
    const query::RelativePose before = query::relative_pose(cache.pose_a, cache.pose_b);
    const query::RelativePose now = query::relative_pose(pose_a, pose_b);
    double turned = 0;
    for (glm::length_t c = 0; c < 3; ++c) {
        const glm::dvec3 column = now.rotation[c] - before.rotation[c];
        turned += glm::dot(column, column);
    }
    // Both placements are rounded, by less than kSeparationMargin of all lengths (separation.hpp).
    return std::sqrt(turned) * root_b.reach + glm::length(now.translation - before.translation) +
           query::kSeparationMargin * (2 * root_b.reach + before.distance + now.distance);
}

// The bodies are certainly so far apart, by spheres around their roots; NaN if the pose is not finite.
double gap_of_spheres(const TreeView& a, const TreeView& b, const query::RelativePose& b_to_a) {
    const query::PlacedEllipsoid root_a = query::place(a.ellipsoid(0)), root_b = query::place(b.ellipsoid(0));
    const glm::dvec3 center_b = b_to_a.rotation * root_b.center + b_to_a.translation;
    return glm::distance(root_a.center, center_b) - root_a.size - root_b.size -
           query::kSeparationMargin * (root_a.reach + root_b.reach + b_to_a.distance);
}

// Does the pair that the cache names exist?
bool names_leaves(const MeetingPair& pair, const TreeView& a, const TreeView& b) {
    const auto good = [](const TreeView& tree, uint32_t node, uint32_t triangle) {
        if (node >= tree.slot_count() || !tree.is_node(node) || !tree.is_leaf(node)) return false;
        const TriangleRange range = tree.triangles(node);
        return range.count == 0 ? triangle == kNoTriangle : triangle - range.first < range.count;
    };
    return good(a, pair.node_a, pair.triangle_a) && good(b, pair.node_b, pair.triangle_b);
}

// Only whole searches are remembered: a level limit asks another question.
bool usable(const PairCache* cache, const TreeView& a, const TreeView& b, const QueryOptions& options) {
    return cache && options.max_level + 1 >= std::max(a.level_count(), b.level_count());
}

} // namespace

CollideAllResult collide_all(const TreeView& a, const Pose& pose_a, const TreeView& b, const Pose& pose_b,
                             std::span<MeetingPair> pairs, QueryContext& context,
                             const QueryOptions& options) noexcept {
    const bool swap = query::must_swap(a, pose_a, b, pose_b);
    query::Descent descent = swap ? query::Descent(b, pose_b, a, pose_a, context, options)
                                  : query::Descent(a, pose_a, b, pose_b, context, options);
    descent.all = true;
    descent.pairs = pairs;
    const Verdict verdict = run(descent);
    if (swap)
        for (MeetingPair& pair : pairs.first(static_cast<size_t>(std::min<uint64_t>(descent.found, pairs.size()))))
            pair = exchanged(pair);
    return {verdict, verdict == Verdict::overlapping && descent.found == 0, descent.found, descent.stats};
}

CollideResult collide(const TreeView& a, const Pose& pose_a, const TreeView& b, const Pose& pose_b,
                      QueryContext& context, const QueryOptions& options, PairCache* cache) noexcept {
    if (!usable(cache, a, b, options)) cache = nullptr;
    double moved = 0, smaller = 0;
    if (cache) {
        const query::PlacedEllipsoid root_a = query::place(a.ellipsoid(0)), root_b = query::place(b.ellipsoid(0));
        smaller = std::min(root_a.size, root_b.size);
        if (cache->verdict != Verdict::undecided) moved = motion(*cache, pose_a, pose_b, root_b);
        if (cache->verdict == Verdict::separated && moved + options.margin < cache->distance)
            return {Verdict::separated, false, {}, {}};
    }

    const bool swap = query::must_swap(a, pose_a, b, pose_b);
    const TreeView &first = swap ? b : a, &second = swap ? a : b;
    const query::RelativePose to_first =
        swap ? query::relative_pose(pose_b, pose_a) : query::relative_pose(pose_a, pose_b);
    const double gap = gap_of_spheres(first, second, to_first); // most pairs of a scene, at a fifth of the cost
    if (gap > options.margin && options.max_pair_tests > 0) {
        if (cache) *cache = {Verdict::separated, {}, static_cast<float>(gap * kRoundDown), pose_a, pose_b};
        return {Verdict::separated, false, {}, {.pair_tests = 1}};
    }
    query::Descent descent(first, second, to_first, context, options);
    MeetingPair pair;
    descent.pairs = {&pair, 1};
    const auto answer = [&](Verdict verdict) {
        if (swap) pair = exchanged(pair);
        return CollideResult{verdict, verdict == Verdict::overlapping && descent.found == 0, pair, descent.stats};
    };
    if (!cache) return answer(run(descent));

    if (cache->verdict == Verdict::overlapping && names_leaves(cache->pair, a, b)) {
        const MeetingPair last = swap ? exchanged(cache->pair) : cache->pair;
        if (descent.meets(last)) {
            descent.take(last);
            cache->pose_a = pose_a, cache->pose_b = pose_b;
            return answer(Verdict::overlapping);
        }
    }
    const double skin = cache->verdict == Verdict::undecided
                            ? kFirstSkin * smaller
                            : std::clamp(kSkinSteps * moved, kThinnestSkin * smaller, kThickestSkin * smaller);
    descent.set_skin(static_cast<float>(skin));
    const CollideResult result = answer(run(descent));
    const double distance = double{options.margin} + descent.skin;
    *cache = {result.verdict, result.pair, static_cast<float>(distance * kRoundDown), pose_a, pose_b};
    return result;
}

} // namespace prolate
#endif // HWY_ONCE
