#include "query/world/two_bodies.hpp"

#include "query/ellipsoid/separation.hpp"
#include "query/node/limits.hpp"
#include "query/node/order.hpp"
#include "query/shapes/rounded_box.hpp"
#include "query/world/bounds.hpp"

#include <prolate/half_space.hpp>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <type_traits>
#include <utility>
#include <variant>

namespace prolate::query {
namespace {

using glm::dvec3;

CollideResult on_ground(const Body& body, const HalfSpace& ground, Scratch context, const QueryOptions& options) {
    const OverlapResult r = prolate::overlap(*body.tree(), body.pose, ground, context, options);
    return {.verdict = r.verdict, .enclosed = false, .pair = {r.node, 0, r.triangle, kNoTriangle}, .stats = r.stats};
}

// A certified upper bound of the height of an ellipsoid's lowest point over the ground, metres; rounding as separated()
// below has it.
double lowest_at_most(const TreeView& tree, uint32_t node, const Pose& pose, const HalfSpace& ground) {
    const PlacedEllipsoid e = place(tree.ellipsoid(node), tree.scale(), world_pose(pose));
    const dvec3 n = to_double(ground.normal), unit = n / glm::length(n);
    const double offset = ground.offset, height = glm::dot(unit, e.center) - glm::length(unit * e.factor) - offset;
    return height - double{tree.radius()} + kSeparationMargin * (e.reach + std::abs(offset));
}

// A solid and the ground: the lower bound is that of its outer cover, the upper one that of the lowest leaf of the
// inner cover.
SolidsDistance solid_to_ground(const Body& body, const HalfSpace& ground, Scratch context,
                               const DistanceOptions& options) {
    const Solid solid(*body.tree());
    SolidsDistance out;
    if (!solid.is_known()) return out;
    const auto ask = [&](const TreeView& tree) {
        DistanceOptions limits = options;
        limits.max_pair_tests = tests_left(options.max_pair_tests, out.stats.tests());
        const DistanceResult found = prolate::distance(tree, body.pose, ground, context, limits);
        add(found.stats, out.stats);
        return found;
    };
    const auto take_upper = [&](const DistanceResult& found, double upper) {
        out.upper = upper, out.point_a = found.point_a, out.point_b = found.point_b;
    };
    const DistanceResult outer = ask(solid.outer());
    out.lower = outer.lower;
    if (outer.verdict == Verdict::separated || solid.outer().has_triangles()) out.verdict = outer.verdict;
    if (solid.outer().has_triangles()) take_upper(outer, outer.upper);
    if (solid.outer().has_triangles() || solid.inner() == nullptr || out.lower >= sound_length(options.max_distance))
        return out;
    const DistanceResult inner = ask(*solid.inner());
    if (!std::isfinite(inner.upper)) return out;
    take_upper(inner, std::max(0.0, lowest_at_most(*solid.inner(), inner.pair.node_a, body.pose, ground)));
    if (out.lower == 0 && out.upper == 0) out.verdict = Verdict::overlapping;
    return out;
}

SolidsResult solid_on_ground(const Body& body, const HalfSpace& ground, Scratch context, const SolidsOptions& options) {
    const Solid solid(*body.tree());
    const double normal = glm::length(to_double(ground.normal));
    if (!solid.is_known() || !(normal > 0) || !std::isfinite(normal + world_pose(body.pose).distance)) return {};
    const float margin = sound_length(options.margin), uncertainty = sound_length(options.uncertainty);
    const OverlapResult outer = prolate::overlap(
        solid.outer(), body.pose, ground, context,
        {.max_pair_tests = options.max_pair_tests, .margin = with_radius(margin, double{uncertainty})});
    SolidsResult out{outer.verdict, outer.verdict == Verdict::undecided, outer.stats};
    if (outer.verdict != Verdict::overlapping || solid.outer().has_triangles()) return out;
    out.verdict = Verdict::undecided;
    if (solid.inner() == nullptr) return out;
    const DistanceResult inner =
        prolate::distance(*solid.inner(), body.pose, ground, context,
                          {.max_pair_tests = tests_left(options.max_pair_tests, out.stats.tests())});
    add(inner.stats, out.stats);
    const bool found = std::isfinite(inner.upper);
    out.out_of_budget = !found;
    if (found && lowest_at_most(*solid.inner(), inner.pair.node_a, body.pose, ground) + double{uncertainty} <= margin)
        out.verdict = Verdict::overlapping;
    return out;
}

// Bodies change places: of a result that names points, and of manifolds.
void exchange(ContactManifolds& manifolds) {
    for (uint32_t i = 0; i < std::min(manifolds.count, kManifolds); ++i) {
        Manifold& m = manifolds.manifolds[i];
        m.normal = {-m.normal.x, -m.normal.y, -m.normal.z};
        for (uint32_t k = 0; k < std::min(m.count, kManifoldPoints); ++k)
            std::swap(m.points[k].point_a, m.points[k].point_b);
    }
}

// A half-space's height along a ray is linear: it is `height` at its origin, times |normal|, and grows by `slope`.
struct Descent {
    double height, height_error, slope, slope_error;
};
// Products of floats are exact, the sums and the root are wrong by less than 8 u of the moduli, u = 2^-53; a sum that
// has one term is exact, so that a ray that runs level with the ground never meets it.
Descent descent(const HalfSpace& ground, const Ray& ray, double margin) {
    const dvec3 n = to_double(ground.normal), at = n * to_double(ray.origin), along = n * to_double(ray.direction);
    const double length = glm::length(n), offset = (double{ground.offset} + margin) * length;
    const auto moduli = [](const dvec3& v) { return std::abs(v.x) + std::abs(v.y) + std::abs(v.z); };
    const double largest = std::max({std::abs(along.x), std::abs(along.y), std::abs(along.z)});
    return {.height = (at.x + at.y + at.z) - offset,
            .height_error = 0x1p-49 * (moduli(at) + (std::abs(double{ground.offset}) + margin) * length),
            .slope = along.x + along.y + along.z,
            .slope_error = moduli(along) > largest ? 0x1p-50 * moduli(along) : 0};
}

RaycastResult raycast(const HalfSpace& ground, const Ray& ray, double margin) {
    RaycastResult out;
    const dvec3 direction = to_double(ray.direction);
    const double lengths = glm::length(direction) + glm::length(to_double(ray.origin));
    if (!std::isfinite(lengths) || direction == dvec3(0) || std::isnan(ray.max_t)) return out;
    if (ray.max_t < 0) {
        out.verdict = Verdict::separated, out.clear = ray.max_t;
        return out;
    }
    const Descent d = descent(ground, ray, margin);
    dvec3 normal = to_double(ground.normal);
    if (d.height > d.height_error) {
        if (d.slope >= d.slope_error) {
            out.verdict = Verdict::separated, out.clear = ray.max_t;
            return out;
        }
        out.clear = (d.height - d.height_error) / (d.slope_error - d.slope) * (1 - 0x1p-50);
        if (out.clear > ray.max_t) {
            out.verdict = Verdict::separated, out.clear = ray.max_t;
            return out;
        }
    } else { // it begins within, or all is within a half-space that is not finite
        normal = -direction;
    }
    out.verdict = Verdict::overlapping, out.t = out.clear;
    out.point = to_float(to_double(ray.origin) + out.t * direction);
    out.normal = to_float(normal / glm::length(normal));
    return out;
}

// How far a shape is from a half-space, in double: n and the offset are wrong by a few u, the rest as rounded_box.hpp
// has it; a NaN is no separation.
bool separated(const RoundedBox& shape, const HalfSpace& ground) {
    const dvec3 n = to_double(ground.normal), unit = n / glm::length(n);
    double width = shape.radius;
    for (glm::length_t i = 0; i < 3; ++i) width += std::abs(glm::dot(unit, shape.axes[i] * shape.half[i]));
    const double offset = ground.offset;
    return glm::dot(unit, shape.center) - width - offset > kSeparationMargin * (shape.reach + std::abs(offset));
}

// std::visit() throws, if it were for a variant without a value.
template <class Call> auto of(const Probe& probe, Call&& call) {
    if (const auto* const sphere = std::get_if<Sphere>(&probe)) return call(*sphere);
    if (const auto* const capsule = std::get_if<Capsule>(&probe)) return call(*capsule);
    if (const auto* const box = std::get_if<Box>(&probe)) return call(*box);
    return call(*std::get_if<PlacedTree>(&probe));
}

} // namespace

CollideResult collide(const Body& a, const Body& b, Scratch context, const QueryOptions& options,
                      PairCache* cache) noexcept {
    const TreeView *x = a.tree(), *y = b.tree();
    if (x != nullptr && y != nullptr) return prolate::collide(*x, a.pose, *y, b.pose, context, options, cache);
    if (x != nullptr) return on_ground(a, *b.half_space(), context, options);
    if (y == nullptr) return {};
    CollideResult out = on_ground(b, *a.half_space(), context, options);
    out.pair = exchanged(out.pair);
    return out;
}

DistanceResult distance(const Body& a, const Body& b, Scratch context, const DistanceOptions& options,
                        DistanceCache* cache) noexcept {
    const TreeView *x = a.tree(), *y = b.tree();
    if (x != nullptr && y != nullptr) return prolate::distance(*x, a.pose, *y, b.pose, context, options, cache);
    if (x != nullptr) return prolate::distance(*x, a.pose, *b.half_space(), context, options);
    if (y == nullptr) return {};
    DistanceResult out = prolate::distance(*y, b.pose, *a.half_space(), context, options);
    exchange_bodies(out);
    return out;
}

SolidsResult collide_solids(const Body& a, const Body& b, Scratch context, const SolidsOptions& options,
                            SolidsCache* cache) noexcept {
    const TreeView *x = a.tree(), *y = b.tree();
    if (x != nullptr && y != nullptr)
        return prolate::collide(Solid(*x), a.pose, Solid(*y), b.pose, context, options, cache);
    if (x != nullptr) return solid_on_ground(a, *b.half_space(), context, options);
    return y != nullptr ? solid_on_ground(b, *a.half_space(), context, options) : SolidsResult{};
}

SolidsDistance distance_solids(const Body& a, const Body& b, Scratch context, const DistanceOptions& options) noexcept {
    const TreeView *x = a.tree(), *y = b.tree();
    if (x != nullptr && y != nullptr) return prolate::distance(Solid(*x), a.pose, Solid(*y), b.pose, context, options);
    if (x != nullptr) return solid_to_ground(a, *b.half_space(), context, options);
    if (y == nullptr) return {};
    SolidsDistance out = solid_to_ground(b, *a.half_space(), context, options);
    std::swap(out.point_a, out.point_b);
    return out;
}

ContactResult contacts(const Body& a, const Body& b, ContactManifolds& manifolds, Scratch context,
                       const QueryOptions& options) noexcept {
    const TreeView *x = a.tree(), *y = b.tree();
    if (x != nullptr && y != nullptr) return prolate::contacts(*x, a.pose, *y, b.pose, manifolds, context, options);
    if (x != nullptr) return prolate::contacts(*x, a.pose, *b.half_space(), manifolds, context, options);
    if (y == nullptr) return {};
    exchange(manifolds);
    const ContactResult out = prolate::contacts(*y, b.pose, *a.half_space(), manifolds, context, options);
    exchange(manifolds);
    return out;
}

SweepResult sweep(const Body& a, const Motion& motion_a, const Body& b, const Motion& motion_b, Scratch context,
                  const SweepOptions& options) noexcept {
    const TreeView *x = a.tree(), *y = b.tree();
    if (x != nullptr && y != nullptr) return prolate::sweep(*x, motion_a, *y, motion_b, context, options);
    if (x != nullptr) return prolate::sweep(*x, motion_a, *b.half_space(), context, options);
    if (y == nullptr) return {};
    SweepResult out = prolate::sweep(*y, motion_b, *a.half_space(), context, options);
    exchange_bodies(out);
    return out;
}

RaycastResult raycast(const Body& body, const Ray& ray, Scratch context, const QueryOptions& options) noexcept {
    if (body.tree() != nullptr) return prolate::raycast(*body.tree(), body.pose, ray, context, options);
    return raycast(*body.half_space(), ray, sound(options).margin);
}

Verdict overlap(const Body& body, const Probe& probe, Scratch context, const QueryOptions& options) noexcept {
    return of(probe, [&]<class Shape>(const Shape& p) {
        const TreeView* const tree = body.tree();
        if constexpr (std::is_same_v<Shape, PlacedTree>) {
            if (tree != nullptr) return prolate::collide(*tree, body.pose, p.tree, p.pose, context, options).verdict;
            return prolate::overlap(p.tree, p.pose, *body.half_space(), context, options).verdict;
        } else {
            if (tree != nullptr) return prolate::overlap(*tree, body.pose, p, context, options).verdict;
            const RoundedBox shape = place(p, Pose{}, sound(options).margin);
            return separated(shape, *body.half_space()) ? Verdict::separated : Verdict::overlapping;
        }
    });
}

Bounds bounds_of(const Probe& probe, float margin) noexcept {
    return of(probe, [&]<class Shape>(const Shape& p) {
        if constexpr (std::is_same_v<Shape, PlacedTree>) {
            return bounds(p.tree, p.pose, margin);
        } else {
            const RoundedBox shape = place(p, Pose{}, margin);
            dvec3 half(shape.radius + kSeparationMargin * shape.reach);
            for (glm::length_t i = 0; i < 3; ++i) { // glm::abs() branches
                const dvec3 edge = shape.axes[i] * shape.half[i];
                half += dvec3(std::abs(edge.x), std::abs(edge.y), std::abs(edge.z));
            }
            const dvec3 low = shape.center - half, high = shape.center + half;
            return Bounds{{round_down(low.x), round_down(low.y), round_down(low.z)},
                          {round_up(high.x), round_up(high.y), round_up(high.z)}};
        }
    });
}

} // namespace prolate::query
