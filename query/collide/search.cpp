// Tree against tree: both are descended at once, a block of eight children at a time.
//
// Of a pair of nodes that meet, the larger is opened, by its size times how far it reaches towards the other: its
// children, up to eight of them in a block, are tested at once against the other (query/node/lanes-inl.hpp), and those
// that are not separated from it make new pairs. Of exact trees, those that nearly are get a closer look along the
// direction that nearly separates them: hulls of what is below the nodes (query/node/hull_lanes-inl.hpp), or the
// triangles of two leaves (query/triangle/support.hpp). Two leaves are decided at once, in double precision
// (leaves.cpp). Which node is opened depends on the pair alone, so max_level and budgets only cut the traversal off: if
// level l says separated, so does every deeper one.
//
// Sound because a node's bounding volume holds all leaves below it: if B is separated from A's child i, no leaf of B
// meets one under that child.
//
// Of the roots, where both have one block of children, these are tried at once instead: B's are placed together, and
// those that meet the box around A are tested against A's. So small trees end soon.
//
// Depth first, and of the children that meet, the deepest overlap first: bodies that touch are found out soon, and for
// bodies that do not the order makes no difference.
//
// Complexity: one block test for each pair of nodes that meet, unless both are leaves.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "query/collide/search.cpp"
#include "query/simd/targets.hpp" // before foreach_target.h

#include <hwy/foreach_target.h>

#include "query/collide/search.hpp"
#include "query/node/hull_lanes-inl.hpp"
#include "query/node/side-inl.hpp"
#include "src/slab.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

HWY_BEFORE_NAMESPACE();
namespace prolate::query::HWY_NAMESPACE {
namespace {

// Scratch::Entry::flags: which of the two nodes is to be opened, whether the other is a leaf, and whether slabs
// have said what they can.
constexpr uint32_t kOpensB = 1, kOtherIsLeaf = 2, kInOnePlane = 4;

// Nodes of which p / (a + b) is greater may well be separated along n by their hulls, or triangles; below, a closer
// look costs more than it saves.
constexpr float kNearlySeparated = 0.76f, kLeavesNearlySeparated = 0.75f;

// kSifts: search.sift is not null, and the margin may be 0 though kMargin is set. kCovers: no tree has triangles.
template <bool kMargin, bool kSifts, bool kCovers> class CollideTraversal {
    using Side = HWY_NAMESPACE::Side<PlacedNode>;

public:
    explicit CollideTraversal(CollideSearch& search)
        : s_(search), stack_(search.stack),
          b_to_a_(lattice_pose(search.b_to_a, search.b.lattice, search.a.lattice)), sides_{{search.a, b_to_a_},
                                                                                           {search.b, a_to_b_}} {}

    Verdict run() {
        const Verdict verdict = descend_from_roots();
        s_.stats.pair_tests = pair_tests_, s_.stats.block_tests = block_tests_;
        s_.a.deepest = sides_[0].deepest, s_.b.deepest = sides_[1].deepest;
        return verdict;
    }

private:
    Verdict descend_from_roots() {
        const ChildRange in_a = one_block(sides_[0]), in_b = one_block(sides_[1]);
        const bool sifts_triangles = kSifts && have_hulls(); // which go by all that was found before
        if (!sifts_triangles && in_a.count > 0 && in_b.count > 0) return descend_from(in_a, in_b);
        // As if B's root were the only child of a node that meets everything.
        if (budget() < 1) return Verdict::undecided;
        pair_tests_ = 1;
        if (test_all(kOpensB, {0, 1}, 0, s_.a.tree.is_leaf(0) ? kOtherIsLeaf : 0)) return stopped();
        return descend();
    }
    // What is on the stack.
    Verdict descend() {
        left_ = budget();
        while (size_ > 0) {
            auto e = stack_[--size_];
            if (kSifts && s_.sift(s_.sift_user, &e, &e + 1) == &e) continue;
            const uint32_t open = e.flags & kOpensB;
            const uint32_t node = open != 0 ? e.node_b : e.node_a, other = open != 0 ? e.node_a : e.node_b;
            const Side& side = sides_[open];
            if (node >= side.limit_from) { // max_level ends the traversal
                if (s_.take({e.node_a, e.node_b, kNoTriangle, kNoTriangle})) return Verdict::overlapping;
                continue;
            }
            const ChildRange children = children_in(side.block(node), node % kBlockLanes);
            if (kSifts) left_ = budget();
            if (children.count > left_) return Verdict::undecided;
            pair_tests_ += children.count, left_ -= children.count; // also those that it may not come to
            if (children.count <= kBlockLanes ? test(open, children.first, children.count, other, e.flags)
                                              : test_all(open, children, other, e.flags))
                return stopped();
        }
        return Verdict::separated;
    }

    // What is known of the lanes that were not separated.
    struct Kept {
        alignas(64) float depth[kBlockLanes]; // p / (a + b)
        alignas(64) float n[3][kBlockLanes];
        uint32_t overlap = 0; // bit i: two leaves without triangles certainly overlap
        // For hulls only:
        alignas(64) float gap[kBlockLanes]; // beyond the margins
        alignas(64) float a[kBlockLanes], b[kBlockLanes];
        alignas(64) float in_a[3][kBlockLanes], in_b[3][kBlockLanes]; // L1^T n, L2^T n
        HWY_INLINE void keep(const LaneTerms& t, size_t i) {
            store(t.p / t.sum, depth + i);
            store(t.n, n, i);
        }
        HWY_INLINE void keep_for_hulls(const LaneTerms& t, Float margin, size_t i) {
            store(t.a, a + i), store(t.b, b + i);
            store(t.in_a, in_a, i), store(t.in_b, in_b, i);
            Float beyond = t.gap;
            if constexpr (kMargin) beyond = beyond - margin * length(t.n);
            store(choose(t.one_norm > kLaneDirection, beyond, set(-HUGE_VALF)), gap + i);
        }
    };

    // The hull record of an inner node, if it has one.
    static const std::byte* hull_at(const Side& side, uint32_t slot) {
        const std::byte* const block = side.block(slot);
        const uint32_t at = slot % kBlockLanes;
        if (side.hulls == nullptr || load_le<uint8_t>(block + kBlockCount + at) >= kTriangleLeaf) return nullptr;
        return hull_of(side.hulls, block, at);
    }

    // Those of the lanes whose hulls and that of the other tree's node are separated along n. Of the rest, kept.depth
    // becomes what the hulls say.
    HWY_NOINLINE uint32_t separated_by_hulls(uint32_t open, uint32_t first, uint32_t lanes, uint32_t leaves,
                                             uint32_t other, Kept& kept) {
        const Side& side = sides_[open];
        const std::byte* const block = side.block(first);
        const HullRows hull_a = load_hull(hull_at(sides_[open ^ kOpensB], other));
        uint32_t out = 0;
        for (; lanes != 0; lanes &= lanes - 1) {
            const auto lane = static_cast<uint32_t>(std::countr_zero(lanes));
            const HullRows hull_b = load_hull((leaves >> lane & 1) != 0 ? nullptr : hull_of(side.hulls, block, lane));
            const float a = kept.a[lane], b = kept.b[lane];
            const float reach_a = hull_a.reach(kept.in_a[0][lane], kept.in_a[1][lane], kept.in_a[2][lane], a);
            const float reach_b = hull_b.reach(-kept.in_b[0][lane], -kept.in_b[1][lane], -kept.in_b[2][lane], b);
            if (kept.gap[lane] + ((a - reach_a) + (b - reach_b)) > 0)
                out |= 1u << lane;
            else
                kept.depth[lane] *= (a + b) / (reach_a + reach_b);
        }
        return out;
    }
    // Once there are more pairs than usual: much is equally near.
    bool slabs_pay() const { return !kCovers && have_slabs_ && block_tests_ > kPatience; }
    // Takes those of the pairs from stack_[before] on, which a block has put there, that slabs separate.
    HWY_NOINLINE void sift_by_slabs(uint32_t before, uint32_t open, const Kept& kept) {
        const uint32_t end = std::exchange(size_, before);
        for (uint32_t i = before; i < end; ++i) {
            QueryContext::Entry e = stack_[i];
            const Slabs slabs = slabs_of(open, e, kept);
            if (slabs == Slabs::separated) continue;
            if (slabs == Slabs::in_one_plane) e.flags |= kInOnePlane;
            stack_[size_++] = e;
        }
    }
    // What the slabs of a pair say.
    Slabs slabs_of(uint32_t open, const QueryContext::Entry& e, const Kept& kept) {
        const NodeWithHull a{s_.a.tree, e.node_a, hull_at(sides_[0], e.node_a)},
            b{s_.b.tree, e.node_b, hull_at(sides_[1], e.node_b)};
        if (!is_flat(a) && !is_flat(b)) return Slabs::say_nothing;
        const uint32_t lane = (open != 0 ? e.node_b : e.node_a) % kBlockLanes;
        const glm::dvec3 n =
            glm::normalize(glm::dvec3(kept.n[0][lane], kept.n[1][lane], kept.n[2][lane])); // in the opened one's frame
        return s_.slabs_of(a, b, open != 0 ? s_.b_to_a.rotation * n : n);
    }

    Verdict stopped() const { return s_.out_of_tests ? Verdict::undecided : Verdict::overlapping; }

    uint64_t budget() const { // s_.stats has the triangles' tests, and the nodes' later
        const uint64_t left = s_.left();
        return left - std::min(left, pair_tests_ - s_.stats.pair_tests);
    }

    HWY_NOINLINE void place_a() {
        a_to_b_ = lattice_pose(inverse(s_.b_to_a), s_.a.lattice, s_.b.lattice);
        have_a_to_b_ = true;
    }

    // One block, B's if kOpensB is given, against a node of the other tree: decides on the leaves that meet, and pushes
    // the other pairs that do, the deepest last. True to stop the query.
    HWY_INLINE bool test(uint32_t open, uint32_t first, uint32_t count, uint32_t other, uint32_t of_parent) {
        if (open != 0 && !have_a_to_b_) place_a();
        const Side& side = sides_[open];
        const std::byte* const block = side.block(first);
        return test(open, first, count, other, sides_[open].place(sides_[open ^ kOpensB], other).single, of_parent,
                    [&](size_t lane) { return load_nodes(block, lane, side.lattice.step_exponent); });
    }
    // `single`: the other node, placed. `nodes(i)`: those of the block from lane i on.
    template <class Nodes>
    HWY_INLINE bool test(uint32_t open, uint32_t first, uint32_t count, uint32_t other, const Single& single,
                         uint32_t of_parent, Nodes&& nodes) {
        const uint32_t other_is_leaf = of_parent & kOtherIsLeaf;
        const uint32_t inherited = of_parent & (kSifts ? kInOnePlane | CollideSearch::kSiftBits : kInOnePlane);
        Side& side = sides_[open];
        const std::byte* const block = side.block(first);
        ++block_tests_;
        side.deepest = std::max(side.deepest, first + count - 1);
        const float lattice_margin = kMargin ? margin_in(side) : 0.0f;
        uint32_t meet = boxes_meet(block, single, lattice_margin) & ((1u << count) - 1);
        if (meet == 0) return false;
        uint32_t met = 0, larger = 0, near = 0;
        Kept kept;
        const Float margin = set(lattice_margin);
        for (size_t i = 0; i < kBlockLanes; i += kFloatLanes) {
            const LaneNodes e = nodes(i);
            const LaneTerms t = evaluate(e, single);
            met |= bits(!separated<kMargin>(t, margin)) << i;
            larger |= bits(t.b * t.size > t.a * single.size) << i;
            near |= bits(t.p > kNearlySeparated * t.sum) << i;
            kept.keep(t, i);
            if (have_hulls()) kept.keep_for_hulls(t, margin, i);
            if (kCovers && other_is_leaf != 0) kept.overlap |= bits(overlapping(e, single, t)) << i;
        }
        meet &= met;
        if (meet == 0) return false;
        s_.roots_meet = true;
        const uint32_t leaves = side.leaf_lanes(first, block);
        if (other_is_leaf != 0 && (meet & leaves) != 0) {
            if (decide(open, first, meet & leaves, other, kept, inherited)) return true;
            left_ = budget();
            meet &= ~leaves;
        }
        const uint32_t opened = ~leaves & (other_is_leaf != 0 ? 0xff : larger);
        const uint32_t if_opened = open | other_is_leaf | inherited, if_other_opened = (open ^ kOpensB) | inherited;
        const uint32_t before = size_;
        if (have_hulls() && (meet & near) != 0)
            meet &= ~separated_by_hulls(open, first, meet & near, leaves, other, kept);
        if (meet == 0) return false;
        const auto push = [&](uint32_t lane) {
            const uint32_t node = first + lane;
            const uint32_t flags =
                (opened >> lane & 1) != 0 ? if_opened : if_other_opened | (leaves >> lane & 1) * kOtherIsLeaf;
            stack_[size_++] = {open != 0 ? other : node, open != 0 ? node : other, kept.depth[lane], flags};
        };
        auto deepest = static_cast<uint32_t>(std::countr_zero(meet));
        while ((meet &= meet - 1) != 0) {
            const auto lane = static_cast<uint32_t>(std::countr_zero(meet));
            const bool deeper = kept.depth[lane] < kept.depth[deepest];
            push(deeper ? deepest : lane);
            deepest = deeper ? lane : deepest;
        }
        push(deepest);
        if (slabs_pay() && (of_parent & kInOnePlane) == 0) sift_by_slabs(before, open, kept);
        if (kSifts) size_ = static_cast<uint32_t>(s_.sift(s_.sift_user, stack_ + before, stack_ + size_) - stack_);
        return false;
    }

    // Decides on these lanes, the deepest first, against the other tree's leaf. True to stop the query.
    HWY_NOINLINE bool decide(uint32_t open, uint32_t first, uint32_t lanes, uint32_t other, const Kept& kept,
                             uint32_t flags) {
        s_.stats.pair_tests = pair_tests_;
        while (lanes != 0) {
            auto lane = static_cast<uint32_t>(std::countr_zero(lanes));
            for (uint32_t rest = lanes & (lanes - 1); rest != 0; rest &= rest - 1) {
                const auto next = static_cast<uint32_t>(std::countr_zero(rest));
                if (kept.depth[next] < kept.depth[lane]) lane = next;
            }
            lanes &= ~(1u << lane);
            const uint32_t node = first + lane, node_a = open != 0 ? other : node, node_b = open != 0 ? node : other;
            if (kSifts) {
                Scratch::Entry e{node_a, node_b, 0, flags};
                if (s_.sift(s_.sift_user, &e, &e + 1) == &e) continue;
            }
            if ((kept.overlap >> lane & 1) != 0) { // as s_.meet() would find, at a fifth of the cost
                if (s_.take({node_a, node_b, kNoTriangle, kNoTriangle})) return true;
                continue;
            }
            const bool look = kept.depth[lane] > kLeavesNearlySeparated;
            const glm::dvec3 to_lane =
                look ? glm::dvec3(kept.n[0][lane], kept.n[1][lane], kept.n[2][lane]) : glm::dvec3(0); // in its frame
            if (s_.meet(node_a, node_b, open != 0 ? s_.b_to_a.rotation * to_lane : -to_lane)) return true;
        }
        return false;
    }

    // The roots, where both have one block of children: B's children are placed all at once, and those that meet the
    // box of A's root are tested against A's, the nearest first, and with what comes of it done before the next.
    HWY_NOINLINE Verdict descend_from(const ChildRange& in_a, const ChildRange& in_b) {
        if (in_b.count > budget()) return Verdict::undecided;
        LaneNodes nodes_a[kBlockLanes / kFloatLanes];
        for (size_t i = 0; i < kBlockLanes; i += kFloatLanes)
            nodes_a[i / kFloatLanes] = load_nodes(sides_[0].block(in_a.first), i, sides_[0].lattice.step_exponent);
        PlacedBlock placed;
        const std::byte* const block = sides_[1].block(in_b.first);
        place_block(block, b_to_a_, placed);
        const uint32_t leaves = sides_[1].leaf_lanes(in_b.first, block);
        pair_tests_ = in_b.count, block_tests_ = 1;
        const auto nodes = [&](size_t i) -> const LaneNodes& { return nodes_a[i / kFloatLanes]; };
        alignas(64) float far[kBlockLanes];
        uint32_t near = near_root(placed, (1u << in_b.count) - 1, far);
        if (std::min(sides_[0].limit_from, sides_[1].limit_from) == 0) // as little as what deeper searches begin with
            return near != 0 && s_.take({0, 0, kNoTriangle, kNoTriangle}) ? Verdict::overlapping : Verdict::separated;
        sides_[1].deepest = in_b.first + in_b.count - 1;
        while (near != 0) {
            auto lane = static_cast<uint32_t>(std::countr_zero(near));
            for (uint32_t rest = near & (near - 1); rest != 0; rest &= rest - 1)
                if (const auto next = static_cast<uint32_t>(std::countr_zero(rest)); far[next] < far[lane]) lane = next;
            near &= ~(1u << lane);
            if (in_a.count > budget()) return Verdict::undecided;
            pair_tests_ += in_a.count;
            if (test(0, in_a.first, in_a.count, in_b.first + lane, placed[lane], (leaves >> lane & 1) * kOtherIsLeaf,
                     nodes))
                return stopped();
            if (size_ == 0) continue;
            if (const Verdict verdict = descend(); verdict != Verdict::separated) return verdict;
        }
        return Verdict::separated;
    }
    // The children of a root, if they are a block.
    static ChildRange one_block(const Side& side) {
        const ChildRange children = children_in(side.block(0), 0);
        return side.leaves_from > 0 && children.count <= kBlockLanes ? children : ChildRange{0, 0};
    }
    // B's lanes, as bits, that boxes do not separate from A's root, and `far` off its center, by spheres. Says, too,
    // whether one body may hold the other: not if all that there is of B lies on one side of A.
    uint32_t near_root(const PlacedBlock& placed, uint32_t lanes, float (&far)[kBlockLanes]) {
        const BlockBoxes boxes(sides_[0].block(0));
        const float margin = kMargin ? margin_in(sides_[0]) : 0.0f;
        uint32_t near = lanes;
        bool on_one_side = false;
        float middle[3];
        for (size_t r = 0; r < 3; ++r) {
            const auto at = [&](int32_t side) { // exact
                return static_cast<float>(boxes.origin(r)) + static_cast<float>(side) * boxes.step(r);
            };
            const float low = at(boxes.low(r, 0)), high = at(boxes.high(r, 0));
            uint32_t above = 0, below = 0;
            for (size_t i = 0; i < kBlockLanes; i += kFloatLanes) {
                above |= bits(load(placed.low[r] + i) > high + margin) << i;
                below |= bits(load(placed.high[r] + i) < low - margin) << i;
            }
            near &= ~(above | below);
            on_one_side = on_one_side || (above & lanes) == lanes || (below & lanes) == lanes;
            middle[r] = 0.5f * (low + high);
        }
        for (size_t i = 0; i < kBlockLanes; i += kFloatLanes)
            store(length(load(placed.center, i) - set(middle)) - load(placed.size + i), far + i);
        s_.roots_meet = !on_one_side;
        return near;
    }

    // Some or all children, where that is rare: in a loop with the usual case this would cost it registers.
    HWY_NOINLINE bool test_all(uint32_t open, ChildRange children, uint32_t other, uint32_t of_parent) {
        return !for_each_block(
            children, [&](uint32_t first, uint32_t count) { return !test(open, first, count, other, of_parent); });
    }

    // options.margin + skin in lattice steps, rounded up.
    float margin_in(const Side& side) const {
        return static_cast<float>((double{s_.options.margin} + s_.skin) * kRoundUp * steps_per_metre(side.lattice));
    }
    static constexpr double kRoundUp = 1 + 0x1p-20; // also pays for the rounding of margin |n|

    // Opening a node takes one entry off and puts at most kMaxDegree on, and no pair lies deeper than both trees
    // together.
    static_assert(QueryContext::kEntries > 2 * (kMaxLevels - 1) * (kMaxDegree - 1) + 1);
    CollideSearch& s_;
    Scratch::Entry* const stack_;
    uint32_t size_ = 0;
    uint64_t pair_tests_ = 0, block_tests_ = 0, left_ = 0; // left_: of the budget, for nodes
    bool have_hulls() const { return !kCovers && have_hulls_; }
    const bool have_hulls_ = s_.a.tree.has_triangles() || s_.b.tree.has_triangles();
    const bool have_slabs_ = s_.a.has_slabs || s_.b.has_slabs;
    const LatticePose b_to_a_;
    LatticePose a_to_b_; // once it is asked for: small trees end before
    bool have_a_to_b_ = false;
    Side sides_[2];
};

Verdict traverse_target(CollideSearch& search) {
    if (search.sift != nullptr) return CollideTraversal<true, true, false>(search).run();
    if (search.options.margin + search.skin > 0) return CollideTraversal<true, false, false>(search).run();
    return search.a.tree.has_triangles() || search.b.tree.has_triangles()
               ? CollideTraversal<false, false, false>(search).run()
               : CollideTraversal<false, false, true>(search).run();
}

} // namespace
} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace prolate::query {
HWY_EXPORT(traverse_target);
Verdict traverse(CollideSearch& search) noexcept {
    return HWY_DYNAMIC_DISPATCH(traverse_target)(search);
}
} // namespace prolate::query
#endif // HWY_ONCE
