// Ray against tree: eight children at a time, nearest first.
//
// The kernel (ray_lanes-inl.hpp) gives a lower bound of the parameter at which the ray enters each child. Children wait
// on a stack, the nearest on top, and are skipped when the best hit so far lies before their bound. Leaves are decided
// in double precision (ray.hpp).
//
// Sound because a node's bounding volume holds all leaves below it: where the ray misses the node, it misses these. To
// meet the ellipsoids of a cut, also of an exact tree (raycast_cut), the nodes' own are grown until they hold all below
// them; their boxes are not, and are passed over.
//
// Complexity: one block test for each node that is opened.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "query/raycast/raycast.cpp"
#include "query/simd/targets.hpp" // before foreach_target.h

#include <hwy/foreach_target.h>

#include "query/ellipsoid/convert.hpp"
#include "query/node/limits.hpp"
#include "query/node/tree_side.hpp"
#include "query/raycast/lanes-inl.hpp"
#include "query/raycast/ray.hpp"

#include <prolate/raycast.hpp>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

#ifndef PROLATE_QUERY_RAYCAST_ONCE // what the targets share
#define PROLATE_QUERY_RAYCAST_ONCE
namespace prolate::query {

// One raycast() query.
struct Cast {
    TreeSide body;
    const PlacedRay ray;
    const LatticeRay lattice_ray;
    const QueryOptions& options;
    const bool any;            ///< stop at the first hit that is found
    const float* const growth; ///< of raycast_cut(): by slots; else null
    QueryContext::Entry* const stack;
    QueryStats stats;
    bool found = false;
    RayHit best{};           ///< of the placed ray
    double clear = HUGE_VAL; ///< of the placed ray: the least bound of what was left aside
    uint32_t node = 0, triangle = kNoTriangle;

    // Decides on a leaf, or on a node that max_level lets stand for what is below it. True if a hit is the best now.
    bool meet(uint32_t at) noexcept {
        const auto take = [&](const std::optional<RayHit>& hit, uint32_t t) {
            if (!hit || (found && !(hit->t < best.t))) return false;
            found = true, best = *hit, node = at, triangle = t;
            return true;
        };
        const TriangleRange triangles = body.tree.triangles(at);
        const auto hit_by = [&](const auto& leaf) {
            if (!(options.margin > 0)) return hit(ray, leaf);
            PlacedRay still_open = ray; // what lies behind the best hit takes less time
            if (found) still_open.length = best.t;
            return hit_within(double{options.margin}, still_open, leaf);
        };
        if (triangles.count == 0 || growth)
            return take(hit_by(place(growth ? body.tree.ellipsoid(at) : body.tree.bound(at))), kNoTriangle);
        bool taken = false;
        stats.triangle_tests += triangles.count;
        for (uint32_t t = triangles.first; t < triangles.first + triangles.count; ++t)
            taken = take(hit_by(place(body.tree, t)), t) || taken;
        return taken;
    }
};

} // namespace prolate::query
#endif // PROLATE_QUERY_RAYCAST_ONCE

HWY_BEFORE_NAMESPACE();
namespace prolate::query::HWY_NAMESPACE {
namespace {

template <bool kThick, bool kGrown> class RaySearch {
public:
    explicit RaySearch(Cast& cast) : c_(cast) {}

    // False if the tests ran out.
    bool run() {
        if (!test(0, 1)) return !leave_aside(0);
        while (size_ > 0) {
            const QueryContext::Entry e = c_.stack[--size_];
            if (e.bound > limit_) continue;
            const ChildRange children = c_.body.tree.children(e.node_a);
            if (children.count == 0 || e.node_a >= c_.body.limit_from) {
                if (c_.body.tree.triangles(e.node_a).count > left()) return !leave_aside(e.bound);
                if (!c_.meet(e.node_a)) continue;
                if (c_.any) return leave_aside(std::numeric_limits<float>::infinity());
                const double limit = c_.best.t / c_.ray.length;
                // Rounded up; below the kernel's margin anyway, as is the division's rounding.
                if (limit < 1) limit_ = std::nextafter(static_cast<float>(limit), 1.0f);
                continue;
            }
            base_ = size_;
            for (uint32_t i = 0; i < children.count; i += kBlockLanes)
                if (!test(children.first + i, std::min(children.count - i, kBlockLanes))) return !leave_aside(e.bound);
        }
        return true;
    }

private:
    uint64_t left() const { // of the budget
        return c_.options.max_pair_tests - std::min(c_.options.max_pair_tests, c_.stats.tests());
    }

    // One block: puts the lanes that may be met on the stack, the nearest of the family on top.
    bool test(uint32_t first, uint32_t count) {
        if (count > left()) return false;
        c_.stats.pair_tests += count, ++c_.stats.block_tests;
        c_.body.deepest = std::max(c_.body.deepest, first + count - 1);
        alignas(32) float entries[kBlockLanes];
        const std::byte* const block = kGrown ? c_.body.tree.block(first / kBlockLanes) : c_.body.block(first);
        const int32_t step_exponent = c_.body.lattice.step_exponent;
        const Float limit = set(limit_);
        if constexpr (kGrown) {
            for (size_t i = 0; i < kBlockLanes; i += kFloatLanes) {
                const LaneNodes nodes =
                    grown(load_nodes(block, i, step_exponent), load_unaligned(c_.growth + first + i));
                store(entry_lanes<kThick>(nodes, c_.lattice_ray, limit), entries + i);
            }
        } else {
            const BoxRay boxes = box_ray(block, c_.lattice_ray);
            for (size_t i = 0; i < kBlockLanes; i += kFloatLanes) {
                Float enter = box_entries(block, i, boxes, limit);
                if (!all(enter > limit))
                    enter = max(enter, entry_lanes<kThick>(load_nodes(block, i, step_exponent), c_.lattice_ray, limit));
                store(enter, entries + i);
            }
        }
        for (uint32_t lane = 0; lane < count; ++lane) {
            if (!(entries[lane] <= limit_)) continue;
            uint32_t at = size_++;
            for (; at > base_ && c_.stack[at - 1].bound < entries[lane]; --at) c_.stack[at] = c_.stack[at - 1];
            c_.stack[at] = {first + lane, 0, entries[lane], 0};
        }
        return true;
    }

    // The search ends here: `bound` and what waits on the stack is not looked at. Always true.
    bool leave_aside(float bound) {
        double least = bound;
        for (uint32_t i = 0; i < size_; ++i) least = std::min(least, double{c_.stack[i].bound});
        c_.clear = least * c_.ray.length;
        return true;
    }

    Cast& c_;
    uint32_t size_ = 0, base_ = 0;
    float limit_ = 1; // parameter of the best hit
};

bool cast_target(Cast& cast) {
    const bool thick = cast.lattice_ray.thickness > 0;
    if (cast.growth) return thick ? RaySearch<true, true>(cast).run() : RaySearch<false, true>(cast).run();
    return thick ? RaySearch<true, false>(cast).run() : RaySearch<false, false>(cast).run();
}

} // namespace
} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace prolate::query {
namespace {

LatticeRay to_lattice(const PlacedRay& ray, const LatticeInfo& lattice, double thickness) {
    const double per_step = power_of_two(-lattice.step_exponent);
    double origin[3], span[3], reach = ray.reach * per_step;
    for (size_t i = 0; i < 3; ++i) {
        const auto g = static_cast<glm::length_t>(i);
        const double shift = lattice.origin[i];
        origin[i] = ray.origin[g] * per_step - shift;
        span[i] = ray.direction[g] * ray.length * per_step;
        reach += std::abs(shift);
    }
    return lattice_ray(origin, span, reach, thickness * per_step);
}

} // namespace

HWY_EXPORT(cast_target);
bool search(Cast& cast) noexcept {
    return HWY_DYNAMIC_DISPATCH(cast_target)(cast);
}

} // namespace prolate::query

namespace prolate {

namespace {

using query::to_double, query::to_float;

RaycastResult cast(const TreeView& tree, const Pose& pose, const Ray& ray, QueryContext& context,
                   const QueryOptions& query_options, bool any, const float* growth = nullptr) {
    using glm::dvec3;
    QueryOptions options = query::sound(query_options);
    options.margin = std::min(options.margin, std::numeric_limits<float>::max()); // an infinite one would make NaNs
    RaycastResult out;
    const query::RelativePose to_frame = query::relative_pose(pose, {ray.origin, {}});
    query::PlacedEllipsoid root = query::place(growth ? tree.root() : tree.bound(0));
    if (growth) root.size *= double{growth[0]}, root.reach *= double{growth[0]};
    const query::PlacedRay placed = query::place(ray, to_frame, root, options.margin);
    if (!placed.valid) return out;
    if (placed.empty) {
        out.verdict = Verdict::separated, out.clear = ray.max_t;
        return out;
    }
    query::Cast cast{.body = query::tree_side(tree, options.max_level),
                     .ray = placed,
                     .lattice_ray = query::to_lattice(placed, tree.lattice(), options.margin),
                     .options = options,
                     .any = any,
                     .growth = growth,
                     .stack = context.entries,
                     .stats = {}};
    const bool finished = query::search(cast);
    out.stats = cast.stats;
    out.stats.deepest_level = cast.body.deepest_level();
    out.clear = placed.begin + std::max(0.0, std::min(cast.clear, cast.found ? cast.best.t : placed.length));
    if (!cast.found) {
        if (finished) out.verdict = Verdict::separated, out.clear = ray.max_t;
        return out;
    }
    const dvec3 direction = to_double(ray.direction);
    out.verdict = Verdict::overlapping;
    out.t = placed.begin + cast.best.t;
    out.node = cast.node, out.triangle = cast.triangle;
    // Scaled first: the products of tiny or huge edges may lie beyond a double's squares.
    dvec3 normal = cast.best.normal;
    const double largest = std::max({std::abs(normal.x), std::abs(normal.y), std::abs(normal.z)});
    normal = largest > 0 ? normal / largest * to_frame.rotation : -direction;
    out.point = to_float(to_double(ray.origin) + out.t * direction);
    out.normal = to_float(normal / glm::length(normal));
    return out;
}

} // namespace

RaycastResult raycast(const TreeView& tree, const Pose& pose, const Ray& ray, QueryContext& context,
                      const QueryOptions& options) noexcept {
    return cast(tree, pose, ray, context, options, false);
}

RaycastResult raycast_any(const TreeView& tree, const Pose& pose, const Ray& ray, QueryContext& context,
                          const QueryOptions& options) noexcept {
    return cast(tree, pose, ray, context, options, true);
}

RaycastResult raycast_cut(const TreeView& tree, const Pose& pose, const Ray& ray, std::span<const float> growth,
                          QueryContext& context, const QueryOptions& options) noexcept {
    return cast(tree, pose, ray, context, options, false, growth.data());
}

RaycastResult raycast_cut_any(const TreeView& tree, const Pose& pose, const Ray& ray, std::span<const float> growth,
                              QueryContext& context, const QueryOptions& options) noexcept {
    return cast(tree, pose, ray, context, options, true, growth.data());
}

} // namespace prolate
#endif // HWY_ONCE
