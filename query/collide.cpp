// Tree against tree: simultaneous descent over pairs of nodes of equal level.
//
// From a pair (A, B) that is not separated, A is tested against each child of B and B against each child of A; then
// only the product of the survivors is tested pair by pair, depth first. A leaf, or a node at max_level, stays while
// its partner descends. So which pairs are tested depends on neither the order of the descent nor max_level (that
// only cuts it off): if level l says separated, so does every deeper one.
//
// Sound because a child covers its part of the solid and A covers the parts of all its children: if A is apart from
// B's child i, no part under A meets that part of B.
//
// Two leaves of exact trees meet if a triangle of one meets a triangle of the other; a leaf ellipsoid of a tree without
// triangles stands for itself. If nothing meets, no surface crosses another, so each connected component of the one
// lies wholly inside or outside of the other: one vertex a component (or center a leaf ellipsoid) tells.
//
// Complexity: 2k tests, then at most k^2, for each pair of inner nodes that meets. Stack: one frame a level.
#include "query/inside.hpp"
#include "query/separation.hpp"
#include "query/triangle.hpp"

#include <prolate/query.hpp>

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <utility>

namespace prolate {
namespace {

using query::PairVerdict;

// Swapped arguments must give the same verdict in spite of rounding, so each call works in one fixed order.
template <size_t Words, class T> bool bits_less(const T& x, const T& y) {
    using Bits = std::array<uint32_t, Words>;
    return std::bit_cast<Bits>(x) < std::bit_cast<Bits>(y);
}
bool pose_less(const Pose& x, const Pose& y) {
    return bits_less<7>(x, y);
}
bool tree_less(const TreeView& x, const TreeView& y) {
    const auto p = x.bytes(), q = y.bytes();
    if (p.size() != q.size()) return p.size() < q.size();
    return p.data() != q.data() && std::memcmp(p.data(), q.data(), p.size()) < 0;
}

uint32_t next_bit(uint64_t mask, uint32_t from) {
    return from < kMaxDegree ? static_cast<uint32_t>(std::countr_zero(mask & (~uint64_t{0} << from))) : kMaxDegree;
}
static_assert(kMaxDegree == 64, "children are one bit each of a uint64_t");

class Descent {
public:
    Descent(const TreeView& a, const Pose& pose_a, const TreeView& b, const Pose& pose_b, CollideContext::Frame* frames,
            const QueryOptions& options)
        : a_(a), b_(b), pose_a_(pose_a), pose_b_(pose_b), b_to_a_(query::relative_pose(pose_a, pose_b)),
          frames_(frames), options_(options) {}

    CollideResult run() {
        result_.verdict = descend();
        if (result_.verdict == Verdict::separated && roots_meet_) result_.verdict = look_inside();
        return result_;
    }

private:
    using Frame = CollideContext::Frame;
    enum class Test { apart, meets, no_budget };

    Test test(uint32_t node_a, uint32_t node_b, uint32_t level) {
        if (result_.stats.pair_tests >= options_.max_pair_tests) return Test::no_budget;
        const auto pair =
            query::test_pair(query::place(a_.ellipsoid(node_a)), query::place(b_.ellipsoid(node_b), b_to_a_));
        ++result_.stats.pair_tests;
        result_.stats.evaluations += pair.evaluations;
        result_.stats.deepest_level = std::max(result_.stats.deepest_level, level);
        return pair.verdict == PairVerdict::separated ? Test::apart : Test::meets;
    }

    // What takes a node's place one level below `level`: its children, or itself if it stays.
    bool stays(const TreeView& tree, uint32_t node, uint32_t level) const {
        return level >= options_.max_level || tree.is_leaf(node);
    }
    ChildRange below(const TreeView& tree, uint32_t node, uint32_t level) const {
        return stays(tree, node, level) ? ChildRange{node, 1} : tree.children(node);
    }

    // Fills the masks of survivors; false if the budget ran out. A node that stays survives by itself.
    bool open(Frame& frame) {
        const auto sift = [&](const TreeView& tree, uint32_t node, uint64_t& survivors, auto&& test_child) {
            const ChildRange children = below(tree, node, frame.level);
            survivors = stays(tree, node, frame.level) ? 1 : 0;
            if (survivors) return true;
            for (uint32_t i = 0; i < children.count; ++i) {
                const Test outcome = test_child(children.first + i);
                if (outcome == Test::no_budget) return false;
                if (outcome == Test::meets) survivors |= uint64_t{1} << i;
            }
            return true;
        };
        const uint32_t level = frame.level + 1;
        return sift(b_, frame.node_b, frame.children_b, [&](uint32_t i) { return test(frame.node_a, i, level); }) &&
               sift(a_, frame.node_a, frame.children_a, [&](uint32_t i) { return test(i, frame.node_b, level); });
    }

    Verdict descend() {
        const Test roots = test(0, 0, 0);
        if (roots == Test::no_budget) return Verdict::undecided;
        if (roots == Test::apart) return Verdict::separated; // what they enclose, too
        roots_meet_ = true;
        if (stays(a_, 0, 0) && stays(b_, 0, 0)) return leaves_meet(0, 0) ? Verdict::overlapping : Verdict::separated;
        uint32_t depth = 0; // the frame in work; its index is its level
        frames_[0] = {.node_a = 0, .node_b = 0, .children_a = 0, .children_b = 0, .next_a = 0, .next_b = 0, .level = 0};
        if (!open(frames_[0])) return Verdict::undecided;
        for (;;) {
            Frame& frame = frames_[depth];
            uint32_t i = next_bit(frame.children_a, frame.next_a), j = next_bit(frame.children_b, frame.next_b);
            if (j == kMaxDegree) { // next row of the product
                i = next_bit(frame.children_a, i + 1);
                j = next_bit(frame.children_b, 0);
            }
            if (i == kMaxDegree || j == kMaxDegree) {
                if (depth == 0) return Verdict::separated;
                --depth;
                continue;
            }
            frame.next_a = i, frame.next_b = j + 1;

            const uint32_t node_a = below(a_, frame.node_a, frame.level).first + i;
            const uint32_t node_b = below(b_, frame.node_b, frame.level).first + j;
            const uint32_t level = frame.level + 1;
            // If one node stayed, open() has tested this very pair.
            if (!stays(a_, frame.node_a, frame.level) && !stays(b_, frame.node_b, frame.level)) {
                const Test outcome = test(node_a, node_b, level);
                if (outcome == Test::no_budget) return Verdict::undecided;
                if (outcome == Test::apart) continue;
            }
            if (stays(a_, node_a, level) && stays(b_, node_b, level)) {
                if (!leaves_meet(node_a, node_b)) continue;
                result_.node_a = node_a, result_.node_b = node_b;
                return Verdict::overlapping;
            }
            Frame& next = frames_[++depth];
            next = {.node_a = node_a,
                    .node_b = node_b,
                    .children_a = 0,
                    .children_b = 0,
                    .next_a = 0,
                    .next_b = 0,
                    .level = level};
            if (!open(next)) return Verdict::undecided;
        }
    }

    // Of two ellipsoids that meet and go no deeper: do their triangles, if they have any?
    bool leaves_meet(uint32_t node_a, uint32_t node_b) {
        if (!a_.is_leaf(node_a) || !b_.is_leaf(node_b)) return true; // max_level ended the descent
        const TriangleRange in_a = a_.triangles(node_a), in_b = b_.triangles(node_b);
        const auto meets = [&](const auto& x, const auto& y) {
            ++result_.stats.triangle_tests;
            return !query::apart(x, y);
        };
        if (in_a.count == 0 && in_b.count == 0) return true;
        if (in_a.count == 0) {
            const auto ellipsoid = query::place(a_.ellipsoid(node_a));
            for (uint32_t t = in_b.first; t < in_b.first + in_b.count; ++t)
                if (meets(query::place(b_, t, b_to_a_), ellipsoid)) return result_.triangle_b = t, true;
            return false;
        }
        if (in_b.count == 0) {
            const auto ellipsoid = query::place(b_.ellipsoid(node_b), b_to_a_);
            for (uint32_t t = in_a.first; t < in_a.first + in_a.count; ++t)
                if (meets(query::place(a_, t), ellipsoid)) return result_.triangle_a = t, true;
            return false;
        }
        for (uint32_t j = in_b.first; j < in_b.first + in_b.count; ++j) {
            const auto triangle_b = query::place(b_, j, b_to_a_);
            for (uint32_t i = in_a.first; i < in_a.first + in_a.count; ++i)
                if (meets(query::place(a_, i), triangle_b)) return result_.triangle_a = i, result_.triangle_b = j, true;
        }
        return false;
    }

    // No surface meets another: is a part of one body inside the other?
    Verdict look_inside() {
        const Verdict first = encloses(a_, pose_a_, b_, pose_b_);
        return first == Verdict::separated ? encloses(b_, pose_b_, a_, pose_a_) : first;
    }
    Verdict encloses(const TreeView& outer, const Pose& pose_outer, const TreeView& inner, const Pose& pose_inner) {
        if (!outer.has_triangles() || outer.bake_info().surface_mode) return Verdict::separated;
        const query::RelativePose to_outer = query::relative_pose(pose_outer, pose_inner);
        const auto look = [&](const Vec3& p) {
            const auto winding = query::winding_number(outer, query::place(p, to_outer), result_.stats.pair_tests,
                                                       options_.max_pair_tests);
            if (!winding) return Verdict::undecided;
            result_.enclosed = *winding != 0;
            return result_.enclosed ? Verdict::overlapping : Verdict::separated;
        };
        Verdict verdict = Verdict::separated;
        for (uint32_t v = 0; v < inner.component_count() && verdict == Verdict::separated; ++v)
            verdict = look(inner.vertex(v));
        for (uint32_t n = 0; n < inner.node_count() && !inner.has_triangles() && verdict == Verdict::separated; ++n)
            if (inner.is_leaf(n)) verdict = look(inner.ellipsoid(n).center);
        return verdict;
    }

    const TreeView& a_;
    const TreeView& b_;
    const Pose& pose_a_;
    const Pose& pose_b_;
    const query::RelativePose b_to_a_;
    Frame* const frames_;
    const QueryOptions& options_;
    bool roots_meet_ = false;
    CollideResult result_;
};

} // namespace

CollideResult collide(const TreeView& a, const Pose& pose_a, const TreeView& b, const Pose& pose_b,
                      CollideContext& context, const QueryOptions& options) noexcept {
    const bool swap = pose_a == pose_b ? tree_less(b, a) : pose_less(pose_b, pose_a);
    if (!swap) return Descent(a, pose_a, b, pose_b, context.frames, options).run();
    CollideResult result = Descent(b, pose_b, a, pose_a, context.frames, options).run();
    std::swap(result.node_a, result.node_b);
    std::swap(result.triangle_a, result.triangle_b);
    return result;
}

Verdict collide(const Ellipsoid& a, const Pose& pose_a, const Ellipsoid& b, const Pose& pose_b) noexcept {
    const bool swap = pose_a == pose_b ? bits_less<9>(b, a) : pose_less(pose_b, pose_a);
    const auto pair = swap ? query::test_pair(query::place(b), query::place(a, query::relative_pose(pose_b, pose_a)))
                           : query::test_pair(query::place(a), query::place(b, query::relative_pose(pose_a, pose_b)));
    return pair.verdict == PairVerdict::separated ? Verdict::separated : Verdict::overlapping;
}

} // namespace prolate
