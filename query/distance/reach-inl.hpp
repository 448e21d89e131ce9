// How far the triangles below the nodes of one tree reach along the normal of the nearest pair found so far. Two nodes
// whose reaches leave a gap along it are that far apart: the direction is not the pair's own, but where the bodies are
// nearest it is the best there is, and a node's reach serves all pairs that the node is in. Per SIMD target; include it
// below hwy/foreach_target.h.
//
// A reach is first that of the node's hull, or exactly that of a leaf's triangles. If that leaves a pair undecided, and
// the hull's share is to blame, it is that of the farthest leaf, found by descending: a block at a time, the farthest
// child first.
//
// Rounding: heights n.x are products and sums in double of lengths within S (query/triangle/support.hpp), whose
// kSeparationMargin S the traversal takes off; what is added to them is in float, in steps:
//   hull    v = L^T n is wrong by 14 u |L| (lanes-inl.hpp) and u |L| for n, its reach by 12 u |L| (hull_lanes-inl.hpp);
//           kLaneMargin |L|, 32 u, is added
//   lanes   the same for |L^T n|, and for n.c of three products and two sums 6 u |c|; kLaneMargin (|L| + |c|) is added.
//           The box's sides are exact, and the sum of their products wrong by 5 u of what kLaneMargin is added for
#include "query/distance/patch-inl.hpp"
#include "query/node/hull_lanes-inl.hpp"
#include "query/node/tree_side.hpp"
#include "query/triangle/support.hpp"

#include <prolate/query.hpp>

#include <cmath>

// clang-format off
#if defined(PROLATE_QUERY_DISTANCE_REACH_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef PROLATE_QUERY_DISTANCE_REACH_INL_HPP
#undef PROLATE_QUERY_DISTANCE_REACH_INL_HPP
#else
#define PROLATE_QUERY_DISTANCE_REACH_INL_HPP
#endif
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace prolate::query::HWY_NAMESPACE {

/// Of one node, metres along the normal from the body's origin.
struct NodeReach {
    uint32_t node, turn; // which, and along which normal: the nth
    double most;         // nothing below it reaches farther,
    double spare;        // but perhaps this much less; 0: a closer look tells no more
};

/// Of a tree with triangles.
class ReachAlong {
public:
    explicit ReachAlong(const TreeSide& side) : side_(side), step_(step_of(side.lattice)) {}

    /// From now on along n, of length 1, in the body's frame.
    void turn(const glm::dvec3& n) {
        if (turn_ == 0)
            for (NodeReach& at : known_) at.turn = 0;
        ++turn_, n_ = n, base_ = 0;
        for (size_t i = 0; i < 3; ++i) {
            const double component = n[static_cast<glm::length_t>(i)];
            along_[i] = static_cast<float>(component);
            base_ += component * double(side_.lattice.origin[i]);
        }
    }
    HWY_INLINE const NodeReach& of(uint32_t node) {
        NodeReach& at = known_[node % kKnown];
        if (at.turn != turn_ || at.node != node) at = first_look(node);
        return at;
    }
    /// At a closer look: of the farthest leaf, or little more. One that is no more than `enough` need not be known, and
    /// one above `hopeless` is of no use. Needs the stack that a search for one leaf does.
    HWY_NOINLINE const NodeReach& closer(uint32_t node, double enough, double hopeless, Scratch::Entry* stack) {
        const NodeReach before = of(node);
        const double most = farthest(node, enough, hopeless, stack);
        return known_[node % kKnown] = {node, turn_, std::min(before.most, most),
                                        most <= enough ? std::max(0.0, before.spare - (before.most - most)) : 0};
    }

private:
    static constexpr uint32_t kKnown = 32;
    static constexpr uint32_t kMostBlocks = 24; // of a closer look: flat faces are seen by slabs instead

    double metres(double steps) const { return (base_ + steps) * step_; }

    HWY_NOINLINE NodeReach first_look(uint32_t node) const {
        const uint32_t lane = node % kBlockLanes;
        const std::byte* const block = side_.block(node);
        const auto children = load_le<uint8_t>(block + kBlockCount + lane);
        TriangleRange range{0, 0}; // whose reach is worth knowing at once
        if (children > kTriangleLeaf)
            range = {first_triangle(block, lane), uint32_t{children} - kTriangleLeaf};
        else if (side_.has_slabs)
            range = patch_at(side_, node);
        if (range.count > 0) return {node, turn_, triangle_support(side_.tree, range, n_), 0};
        const LaneNode e = load_node(block, lane, side_.lattice.step_exponent);
        const float x = along_[0], y = along_[1], z = along_[2];
        const float v[3] = {e.l11 * x + e.l21 * y + e.l31 * z, e.l22 * y + e.l32 * z, e.l33 * z};
        const float width = std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
        const float size = e.l11 + std::abs(e.l21) + e.l22 + std::abs(e.l31) + std::abs(e.l32) + e.l33; // at least |L|
        const double center = (n_.x * double{e.center[0]} + n_.y * double{e.center[1]}) + n_.z * double{e.center[2]};
        const std::byte* const hull = hull_of(side_.hulls, block, lane);
        const float reach = hull_reach(hull, v[0], v[1], v[2], width);
        const auto stated = load_le<uint8_t>(hull + kHullShare);
        const float share = stated > 0 ? static_cast<float>(stated) * kPerHullShare : 1;
        return {node, turn_, metres(center + double{reach + kLaneMargin * size}), double{share * width} * step_};
    }

    // Upper bounds of the lanes of a block, steps from the lattice's origin; NaN becomes infinite.
    HWY_INLINE void bounds(const std::byte* block, float (&out)[kBlockLanes]) const {
        const BlockBoxes boxes(block);
        for (size_t first = 0; first < kBlockLanes; first += kFloatLanes) {
            const LaneNodes e = load_nodes(block, first, side_.lattice.step_exponent);
            const Float3 n = set(along_);
            const Float size = sqrt(trace(shape_of(e.factor)));
            const Float ellipsoid =
                dot(n, e.center) + width(e, n) + (kLaneMargin * size + kLaneMargin * kLargestCenter);
            Float box = set(0);
            float largest = 0;
            for (size_t i = 0; i < 3; ++i) {
                const auto origin = static_cast<float>(boxes.origin(i));
                box = box + (box_sides(block, along_[i] > 0 ? kBlockBoxHigh : kBlockBoxLow, i, first) * boxes.step(i) +
                             origin) *
                                along_[i];
                largest += std::abs(origin) + 255 * boxes.step(i);
            }
            const Float bound = lesser(ellipsoid, box + kLaneMargin * largest);
            store(choose(bound == bound, bound, set(HUGE_VALF)), out + first);
        }
    }

    double farthest(uint32_t root, double most, double hopeless, Scratch::Entry* stack) {
        uint32_t size = 0, blocks = 0;
        stack[size++] = {root, 0, HUGE_VALF, 0};
        while (size > 0) {
            const Scratch::Entry e = stack[--size];
            if (metres(double{e.bound}) <= most) continue;
            const NodeReach here = of(e.node_a);
            if (here.most <= most) continue;
            if (here.spare == 0) {
                if (here.most > hopeless) return HUGE_VAL;
                most = here.most;
                continue;
            }
            if (++blocks > kMostBlocks) return HUGE_VAL;
            if (const TriangleRange range = patch_at(side_, e.node_a); range.count > 0) {
                const double reach = triangle_support(side_.tree, range, n_);
                if (reach > hopeless) return HUGE_VAL;
                most = std::max(most, reach);
                continue;
            }
            const ChildRange children = children_in(side_.block(e.node_a), e.node_a % kBlockLanes);
            for_each_block(children, [&](uint32_t first, uint32_t count) {
                alignas(32) float bound[kBlockLanes];
                bounds(side_.block(first), bound);
                const uint32_t base = size;
                for (uint32_t lane = 0; lane < count; ++lane) {
                    if (metres(double{bound[lane]}) <= most) continue;
                    uint32_t at = size++;
                    for (; at > base && stack[at - 1].bound > bound[lane]; --at) stack[at] = stack[at - 1];
                    stack[at] = {first + lane, 0, bound[lane], 0};
                }
                return true;
            });
        }
        return most;
    }

    const TreeSide& side_;
    const double step_;
    glm::dvec3 n_{0, 0, 0};
    float along_[3] = {};
    double base_ = 0; // n times the lattice's origin, steps
    uint32_t turn_ = 0;
    NodeReach known_[kKnown]; // set with the first turn, which many queries do without
};

/// Of two trees with triangles: which nodes are far enough from each other along the normal of the nearest pair?
class AlongNormal {
public:
    explicit AlongNormal(DistanceSearch& search) : s_(search), reaches_{ReachAlong(s_.a), ReachAlong(s_.b)} {}

    /// Notes two nodes, which are no nearer than `bound`, if they need not be looked at.
    HWY_INLINE bool separates(uint32_t node_a, uint32_t node_b, double bound) {
        return follow() && leave_enough(reaches_[0].of(node_a), reaches_[1].of(node_b), bound);
    }
    /// The same, at a closer look if that may settle it.
    HWY_INLINE bool separates_closely(const Scratch::Entry& e, double bound, Scratch::Entry* stack) {
        if (!follow()) return false;
        const NodeReach &a = reaches_[0].of(e.node_a), &b = reaches_[1].of(e.node_b);
        if (leave_enough(a, b, bound)) return true;
        const double room = (along_ - s_.enough()) - 2 * kSeparationMargin * s_.reach_of_triangles(); // for both
        if (a.most + b.most - (a.spare + b.spare) > room) return false;
        return closer_look(e, bound, room, a, b, stack);
    }

private:
    // False if there is no normal yet.
    HWY_INLINE bool follow() {
        if (turn_ != s_.normals_found) {
            turn_ = s_.normals_found;
            reaches_[0].turn(s_.normal), reaches_[1].turn(-s_.normal_b);
            along_ = glm::dot(s_.normal, s_.b_to_a.translation);
        }
        return turn_ != 0;
    }
    HWY_NOINLINE bool closer_look(const Scratch::Entry& e, double bound, double room, NodeReach a, NodeReach b,
                                  Scratch::Entry* stack) {
        if (a.spare > 0) {
            a = reaches_[0].closer(e.node_a, room - b.most, room - (b.most - b.spare), stack);
            if (leave_enough(a, b, bound)) return true;
            if (a.most + b.most - b.spare > room) return false;
        }
        if (b.spare > 0) b = reaches_[1].closer(e.node_b, room - a.most, room - a.most, stack);
        return leave_enough(a, b, bound);
    }
    HWY_INLINE bool leave_enough(const NodeReach& a, const NodeReach& b, double bound) {
        const double gap = ((along_ - b.most) - a.most) - kSeparationMargin * s_.reach_of_triangles();
        const double certain = gap * (1 - 0x1p-50);
        return certain >= s_.enough() && s_.skips(std::max(certain, bound));
    }

    DistanceSearch& s_;
    ReachAlong reaches_[2];
    uint32_t turn_ = 0; // which normal they are along,
    double along_ = 0;  // and how far the way from A's origin to B's is
};

} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif // PROLATE_QUERY_DISTANCE_REACH_INL_HPP
