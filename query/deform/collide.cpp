// collide() of deformed bodies. Descends both trees at once, depth first: of two nodes whose ellipsoids are not
// separated, the larger one is opened. Boxes, hulls and slabs of the file hold for bodies at rest only and are passed
// over; each node's ellipsoid is moved and enlarged when it is looked at, and pairs are decided in double precision at
// once (query/ellipsoid/separation.hpp), so that leaves need no second test.
//
// Sound because a node's ellipsoid holds all triangles that it stands for wherever they have moved (deformation.hpp):
// where two are apart, so are these. Each point of the surface lies in some leaf, whose ancestors are all asked.
#include "query/deform/body.hpp"
#include "query/deform/enclosure.hpp"
#include "query/ellipsoid/gap.hpp"
#include "query/node/limits.hpp"
#include "query/node/scratch.hpp"
#include "query/triangle/ellipsoid_distance.hpp"
#include "query/triangle/separation.hpp"

#include <algorithm>
#include <cmath>

namespace prolate {
namespace {

using query::Bound, query::Deformed, query::PlacedTriangle, query::RelativePose;

class Collision {
public:
    Collision(const Deformed& a, const Deformed& b, const RelativePose& b_to_a, float margin, uint64_t most_tests,
              Scratch::Entry* stack)
        : a_(a), b_(b), b_to_a_(b_to_a), margin_(margin), most_tests_(most_tests), stack_(stack) {}

    // Of the surfaces alone.
    Verdict surfaces() {
        if (!spend(result.stats.pair_tests)) return Verdict::undecided;
        const Bound root_a = a_.bound(0), root_b = in_a(0);
        if (apart(root_a, root_b)) return Verdict::separated;
        roots_meet = true;
        uint32_t size = 0;
        stack_[size++] = {0, 0, 0, 0};
        while (size > 0) {
            const Scratch::Entry top = stack_[--size];
            const bool end_a = a_.ends_at(top.node_a), end_b = b_.ends_at(top.node_b);
            if (end_a && end_b) {
                if (meet(top.node_a, top.node_b)) return Verdict::overlapping;
            } else {
                open(top, end_a, end_b, size);
            }
            if (out_of_tests_) return Verdict::undecided;
        }
        return Verdict::separated;
    }

    DeformedCollideResult result;
    bool roots_meet = false;

private:
    Bound in_a(uint32_t node_b) const { return query::place(b_.bound(node_b), b_to_a_); }
    bool apart(const Bound& x, const Bound& y) const {
        return query::separated(x.core, y.core, margin_ + x.radius + y.radius);
    }

    // Counts one test; false if there is none left.
    bool spend(uint64_t& counter) {
        out_of_tests_ = result.stats.tests() >= most_tests_;
        counter += out_of_tests_ ? 0 : 1;
        return !out_of_tests_;
    }

    // Puts the children of the larger node, each with the other node, on the stack, if they are not apart.
    void open(const Scratch::Entry& pair, bool end_a, bool end_b, uint32_t& size) {
        const Bound of_a = a_.bound(pair.node_a), of_b = in_a(pair.node_b);
        const bool open_a = !end_a && (end_b || of_a.core.size + of_a.radius >= of_b.core.size + of_b.radius);
        const Deformed& side = open_a ? a_ : b_;
        const ChildRange children = side.tree().children(open_a ? pair.node_a : pair.node_b);
        result.stats.deepest_level = std::max(result.stats.deepest_level, side.tree().level_of(children.first));
        for (uint32_t c = children.first; c < children.first + children.count; ++c) {
            if (!spend(result.stats.pair_tests)) return;
            if (open_a ? apart(a_.bound(c), of_b) : apart(of_a, in_a(c))) continue;
            stack_[size++] = {open_a ? c : pair.node_a, open_a ? pair.node_b : c, 0, 0};
        }
    }

    // Two nodes at which the search ends, and whose ellipsoids are not separated.
    bool meet(uint32_t node_a, uint32_t node_b) {
        const TriangleRange of_a = a_.triangles(node_a), of_b = b_.triangles(node_b);
        const auto take = [&](uint32_t triangle_a, uint32_t triangle_b) {
            result.pair = {node_a, node_b, triangle_a, triangle_b};
            return true;
        };
        if (of_a.count == 0 && of_b.count == 0) return take(kNoTriangle, kNoTriangle);
        if (of_a.count == 0 || of_b.count == 0) {
            const Bound other = of_a.count == 0 ? a_.bound(node_a) : in_a(node_b);
            const TriangleRange& some = of_a.count == 0 ? of_b : of_a;
            for (uint32_t t = some.first; t < some.first + some.count; ++t) {
                if (!spend(result.stats.triangle_tests)) return false;
                const PlacedTriangle placed = of_a.count == 0 ? query::place(b_.triangle(t), b_to_a_) : a_.triangle(t);
                if (!apart(placed, other)) return of_a.count == 0 ? take(kNoTriangle, t) : take(t, kNoTriangle);
            }
            return false;
        }
        for (uint32_t t = of_b.first; t < of_b.first + of_b.count; ++t) {
            const PlacedTriangle placed = query::place(b_.triangle(t), b_to_a_);
            for (uint32_t s = of_a.first; s < of_a.first + of_a.count; ++s) {
                if (!spend(result.stats.triangle_tests)) return false;
                if (!query::separated(a_.triangle(s), placed, margin_)) return take(s, t);
            }
        }
        return false;
    }
    bool apart(const PlacedTriangle& triangle, const Bound& bound) const {
        const double within = margin_ + bound.radius;
        return within > 0 ? query::distance(triangle, bound.core).lower > within
                          : query::separated(triangle, bound.core);
    }

    const Deformed &a_, &b_;
    const RelativePose b_to_a_;
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
    Collision collision(deformed_a, deformed_b, b_to_a, margin, options.max_pair_tests, context.entries());
    Verdict verdict = collision.surfaces();
    if (verdict == Verdict::separated && collision.roots_meet) {
        const auto look = [&](const Deformed& inner, const Deformed& outer, const RelativePose& inner_to_outer) {
            if (verdict != Verdict::separated) return;
            const query::Enclosure found = query::look_inside(inner, outer, inner_to_outer, context.entries(),
                                                              options.max_pair_tests, collision.result.stats);
            if (found == query::Enclosure::perhaps) verdict = Verdict::overlapping, collision.result.enclosed = true;
            if (found == query::Enclosure::out_of_tests) verdict = Verdict::undecided;
        };
        look(deformed_b, deformed_a, b_to_a);
        look(deformed_a, deformed_b, query::inverse(b_to_a));
    }
    out = collision.result;
    out.verdict = verdict;
    out.reason = verdict == Verdict::undecided ? Undecided::budget : Undecided::no;
    return out;
}

} // namespace prolate
