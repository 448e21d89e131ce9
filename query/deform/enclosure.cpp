#include "query/deform/enclosure.hpp"

#include "query/deform/ray_search.hpp"
#include "query/ellipsoid/gap.hpp"
#include "query/node/limits.hpp"
#include "query/node/scratch.hpp"

#include <glm/geometric.hpp>

#include <limits>

namespace prolate::query {
namespace {

using glm::dvec3;

class Look {
public:
    Look(const Deformed& inner, const Deformed& outer, const RelativePose& inner_to_outer, Scratch::Entry* stack,
         uint64_t most_tests, QueryStats& stats)
        : inner_(inner), outer_(outer), inner_to_outer_(inner_to_outer), stack_(stack), most_tests_(most_tests),
          stats_(stats), root_(outer.bound(0)) {}

    Enclosure run() {
        if (!outer_.encloses()) return Enclosure::none;
        if (inner_.witness_count() == 0) return look_at_leaves();
        for (uint32_t w = 0; w < inner_.witness_count(); ++w) {
            const PlacedPoint p = inner_.witness(w);
            if (const Enclosure e = look_at(p); e != Enclosure::none) return e;
        }
        return Enclosure::none;
    }

private:
    // A point of the inner body, in its frame.
    Enclosure look_at(const PlacedPoint& point) {
        const dvec3 origin = inner_to_outer_.rotation * point.position + inner_to_outer_.translation;
        const RelativePose from_point{glm::dmat3(1), origin, point.reach + inner_to_outer_.distance};
        const auto escapes = [&](const dvec3& direction) {
            const PlacedRay ray =
                place(Ray{{}, to_float(direction), std::numeric_limits<float>::infinity()}, from_point, outer_, 0);
            if (!ray.valid) return false;
            if (ray.empty) return true;
            RaySearch search(outer_, ray, stack_ + base_, 0, tests_left(most_tests_, stats_.tests()), true);
            const bool finished = search.run();
            add(search.stats, stats_);
            return finished && !search.found;
        };
        if (escapes(glm::normalize(origin - root_.core.center))) return Enclosure::none;
        for (int i = 0; i < 27; ++i) {
            const dvec3 direction(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1);
            if (direction == dvec3(0) || std::abs(direction.x) + std::abs(direction.y) + std::abs(direction.z) == 2)
                continue; // neither an axis nor a diagonal
            if (escapes(direction)) return Enclosure::none;
            if (stats_.tests() >= most_tests_) return Enclosure::out_of_tests;
        }
        return stats_.tests() >= most_tests_ ? Enclosure::out_of_tests : Enclosure::perhaps;
    }

    // Of a rigid tree without triangles: the centers of all leaves that may lie in the outer body's root.
    Enclosure look_at_leaves() {
        uint32_t size = 0;
        stack_[size++] = {0, 0, 0, 0};
        base_ = siblings_on_the_way(inner_.tree()) + 1;
        while (size > 0) {
            const uint32_t node = stack_[--size].node_a;
            if (stats_.tests() >= most_tests_) return Enclosure::out_of_tests;
            ++stats_.pair_tests;
            const Bound bound = inner_.bound(node);
            if (separated(root_.core, place(bound, inner_to_outer_).core, root_.radius + bound.radius)) continue;
            if (inner_.tree().is_leaf(node)) {
                if (const Enclosure e = look_at({bound.core.center, bound.core.reach}); e != Enclosure::none) return e;
                continue;
            }
            const ChildRange children = inner_.tree().children(node);
            for (uint32_t c = 0; c < children.count; ++c) stack_[size++] = {children.first + c, 0, 0, 0};
        }
        return Enclosure::none;
    }

    const Deformed &inner_, &outer_;
    const RelativePose& inner_to_outer_;
    Scratch::Entry* const stack_;
    const uint64_t most_tests_;
    QueryStats& stats_;
    const Bound root_;
    uint32_t base_ = 0; ///< of the rays' part of the stack
};

} // namespace

Enclosure look_inside(const Deformed& inner, const Deformed& outer, const RelativePose& inner_to_outer,
                      Scratch::Entry* stack, uint64_t most_tests, QueryStats& stats) noexcept {
    return Look(inner, outer, inner_to_outer, stack, most_tests, stats).run();
}

Enclosure look_inside_both(const DeformedPair& pair, Scratch::Entry* stack, uint64_t most_tests,
                           QueryStats& stats) noexcept {
    const Enclosure found = look_inside(pair.b, pair.a, pair.b_to_a, stack, most_tests, stats);
    if (found != Enclosure::none) return found;
    return look_inside(pair.a, pair.b, inverse(pair.b_to_a), stack, most_tests, stats);
}

} // namespace prolate::query
