// raycast() and its kin: the query around the traversal (search.cpp).
#include "query/node/scratch.hpp"
#include "query/raycast/search.hpp"

#include <prolate/tools.hpp>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace prolate::query {

namespace {

LatticeRay to_lattice(const PlacedRay& ray, const LatticeInfo& lattice, double thickness) {
    const double per_step = steps_per_metre(lattice);
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
} // namespace prolate::query

namespace prolate {
namespace {

using query::to_double, query::to_float;

RaycastResult cast(const TreeView& tree, const Pose& pose, const Ray& ray, Scratch context,
                   const QueryOptions& query_options, bool any, const float* growth = nullptr) {
    using glm::dvec3;
    if (!query::suffices(context, tree)) return {};
    QueryOptions options = query::sound(query_options);
    options.margin = std::min(query::with_radius(options.margin, tree.radius()),
                              std::numeric_limits<float>::max()); // an infinite one would make NaNs
    RaycastResult out;
    const query::RelativePose to_frame = query::relative_pose(pose, {ray.origin, {}});
    query::PlacedEllipsoid root = query::place(growth ? tree.root() : tree.root_bound(), tree.scale());
    if (growth) root.size *= double{growth[0]}, root.reach *= double{growth[0]};
    const query::PlacedRay placed = query::place(ray, to_frame, root, options.margin);
    if (!placed.valid) return out;
    if (placed.empty) {
        out.verdict = Verdict::separated, out.clear = ray.max_t;
        return out;
    }
    query::RaycastSearch search{.side = query::tree_side(tree, options.max_level),
                                .ray = placed,
                                .lattice_ray = query::to_lattice(placed, tree.raw().lattice(), options.margin),
                                .options = options,
                                .any = any,
                                .growth = growth,
                                .stack = context.entries(),
                                .stats = {}};
    const bool finished = query::traverse(search);
    out.stats = search.stats;
    out.stats.deepest_level = search.side.deepest_level();
    out.clear = placed.begin + std::max(0.0, std::min(search.clear, search.found ? search.best.t : placed.length));
    if (!search.found) {
        if (finished) out.verdict = Verdict::separated, out.clear = ray.max_t;
        return out;
    }
    const dvec3 direction = to_double(ray.direction);
    out.verdict = Verdict::overlapping;
    out.t = placed.begin + search.best.t;
    out.node = search.node, out.triangle = search.triangle;
    // Scaled first: the products of tiny or huge edges may lie beyond a double's squares.
    dvec3 normal = search.best.normal;
    const double largest = std::max({std::abs(normal.x), std::abs(normal.y), std::abs(normal.z)});
    normal = largest > 0 ? normal / largest * to_frame.rotation : -direction;
    out.point = to_float(to_double(ray.origin) + out.t * direction);
    out.normal = to_float(normal / glm::length(normal));
    return out;
}

} // namespace

RaycastResult raycast(const TreeView& tree, const Pose& pose, const Ray& ray, Scratch context,
                      const QueryOptions& options) noexcept {
    return cast(tree, pose, ray, context, options, false);
}

RaycastResult raycast_any(const TreeView& tree, const Pose& pose, const Ray& ray, Scratch context,
                          const QueryOptions& options) noexcept {
    return cast(tree, pose, ray, context, options, true);
}

RaycastResult raycast_cut(const TreeView& tree, const Pose& pose, const Ray& ray, std::span<const float> growth,
                          Scratch context, const QueryOptions& options) noexcept {
    return cast(tree, pose, ray, context, options, false, growth.data());
}

RaycastResult raycast_cut_any(const TreeView& tree, const Pose& pose, const Ray& ray, std::span<const float> growth,
                              Scratch context, const QueryOptions& options) noexcept {
    return cast(tree, pose, ray, context, options, true, growth.data());
}

} // namespace prolate
