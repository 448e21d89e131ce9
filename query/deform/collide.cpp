// collide() of deformed bodies. Descends both trees at once, depth first: of two nodes whose ellipsoids are not
// separated, the larger one is opened. Boxes, hulls and slabs of the file hold for bodies at rest only and are passed
// over; each node's ellipsoid is moved and enlarged when it is looked at, and pairs are decided in double precision at
// once (query/ellipsoid/separation.hpp), so that leaves need no second test.
//
// Sound because a node's ellipsoid holds all triangles that it stands for wherever they have moved (deformation.hpp):
// where two are apart, so are these. Each point of the surface lies in some leaf, whose ancestors are all asked.
#include "query/deform/enclosure.hpp"
#include "query/deform/pair.hpp"
#include "query/node/limits.hpp"
#include "query/node/scratch.hpp"
#include "query/triangle/separation.hpp"

#include <algorithm>
#include <cmath>

namespace prolate {
namespace {

using query::Bound, query::Deformed, query::DeformedPair, query::PlacedTriangle, query::RelativePose;

class Collision {
public:
    Collision(const DeformedPair& pair, float margin, uint64_t most_tests, Scratch::Entry* stack)
        : pair_(pair), margin_(margin), most_tests_(most_tests), stack_(stack) {}

    // Of the surfaces alone.
    Verdict surfaces() {
        if (!spend(result.stats.pair_tests)) return Verdict::undecided;
        if (query::apart(pair_.bound_a(0), pair_.bound_b(0), margin_)) return Verdict::separated;
        roots_meet = true;
        uint32_t size = 0;
        stack_[size++] = {0, 0, 0, 0};
        while (size > 0) {
            const Scratch::Entry top = stack_[--size];
            const bool met =
                pair_.are_leaves(top.node_a, top.node_b) ? leaves_meet(top.node_a, top.node_b) : !open(top, size);
            if (met) return Verdict::overlapping;
            if (out_of_tests_) return Verdict::undecided;
        }
        return Verdict::separated;
    }

    DeformedCollideResult result;
    bool roots_meet = false;

private:
    // Counts one test; false if there is none left.
    bool spend(uint64_t& counter) {
        out_of_tests_ = result.stats.tests() >= most_tests_;
        counter += out_of_tests_ ? 0 : 1;
        return !out_of_tests_;
    }
    bool take(uint32_t node_a, uint32_t node_b, uint32_t triangle_a, uint32_t triangle_b) {
        result.pair = {node_a, node_b, triangle_a, triangle_b};
        return true;
    }

    // Puts the children of the larger node, each with the other node, on the stack, if they are not apart. False if
    // the node is too deep: then the pair meets.
    bool open(const Scratch::Entry& pair, uint32_t& size) {
        const Bound of_a = pair_.bound_a(pair.node_a), of_b = pair_.bound_b(pair.node_b);
        const bool open_a = pair_.opens_a(pair.node_a, of_a, pair.node_b, of_b);
        const Deformed& side = open_a ? pair_.a : pair_.b;
        const uint32_t opened = open_a ? pair.node_a : pair.node_b;
        if (side.too_deep(opened)) return !take(pair.node_a, pair.node_b, kNoTriangle, kNoTriangle);
        const ChildRange children = side.tree().children(opened);
        result.stats.deepest_level = std::max(result.stats.deepest_level, side.tree().level_of(children.first));
        for (uint32_t c = children.first; c < children.first + children.count; ++c) {
            if (!spend(result.stats.pair_tests)) return true;
            if (open_a ? query::apart(pair_.bound_a(c), of_b, margin_) : query::apart(of_a, pair_.bound_b(c), margin_))
                continue;
            stack_[size++] = {open_a ? c : pair.node_a, open_a ? pair.node_b : c, 0, 0};
        }
        return true;
    }

    // Two leaves whose ellipsoids are not separated.
    bool leaves_meet(uint32_t node_a, uint32_t node_b) {
        const TriangleRange of_a = pair_.a.triangles(node_a), of_b = pair_.b.triangles(node_b);
        if (of_a.count == 0 && of_b.count == 0) return take(node_a, node_b, kNoTriangle, kNoTriangle);
        if (of_a.count > 0 && of_b.count > 0) return triangles_meet(node_a, of_a, node_b, of_b);
        const bool in_a = of_a.count > 0;
        const Bound other = in_a ? pair_.bound_b(node_b) : pair_.bound_a(node_a);
        const TriangleRange& some = in_a ? of_a : of_b;
        for (uint32_t t = some.first; t < some.first + some.count; ++t) {
            if (!spend(result.stats.triangle_tests)) return false;
            if (!query::apart(in_a ? pair_.triangle_a(t) : pair_.triangle_b(t), other, margin_))
                return take(node_a, node_b, in_a ? t : kNoTriangle, in_a ? kNoTriangle : t);
        }
        return false;
    }
    bool triangles_meet(uint32_t node_a, TriangleRange of_a, uint32_t node_b, TriangleRange of_b) {
        PlacedTriangle in_a[kMaxLeafTriangles];
        for (uint32_t i = 0; i < of_a.count; ++i) in_a[i] = pair_.triangle_a(of_a.first + i);
        for (uint32_t t = of_b.first; t < of_b.first + of_b.count; ++t) {
            const PlacedTriangle in_b = pair_.triangle_b(t);
            for (uint32_t i = 0; i < of_a.count; ++i) {
                if (!spend(result.stats.triangle_tests)) return false;
                if (!query::separated(in_a[i], in_b, margin_)) return take(node_a, node_b, of_a.first + i, t);
            }
        }
        return false;
    }

    const DeformedPair& pair_;
    const double margin_;
    const uint64_t most_tests_;
    Scratch::Entry* const stack_;
    bool out_of_tests_ = false;
};

} // namespace

DeformedCollideResult collide(const DeformedBody& a, const DeformedBody& b, Scratch context,
                              const QueryOptions& options) noexcept {
    const Deformed deformed_a(a, options.max_level), deformed_b(b, options.max_level);
    DeformedCollideResult out;
    if (!deformed_a.in_range() || !deformed_b.in_range()) {
        out.reason = Undecided::coordinates;
        return out;
    }
    const RelativePose b_to_a = query::relative_pose(a.pose, b.pose);
    if (!std::isfinite(b_to_a.distance) || !query::suffices(context, a.tree, b.tree)) return out;
    const float margin = query::with_radius(query::sound(options).margin, double{a.tree.radius()} + b.tree.radius());
    const DeformedPair pair{deformed_a, deformed_b, b_to_a};
    Collision collision(pair, margin, options.max_pair_tests, context.entries());
    Verdict verdict = collision.surfaces();
    if (verdict == Verdict::separated && collision.roots_meet) {
        const query::Enclosure found =
            query::look_inside_both(pair, context.entries(), options.max_pair_tests, collision.result.stats);
        if (found == query::Enclosure::perhaps) verdict = Verdict::overlapping, collision.result.enclosed = true;
        if (found == query::Enclosure::out_of_tests) verdict = Verdict::undecided;
    }
    out = collision.result;
    out.verdict = verdict;
    out.reason = verdict == Verdict::undecided ? Undecided::budget : Undecided::no;
    return out;
}

} // namespace prolate
