// raycast() and its kin: the query around the traversal (search.cpp).
#include "query/node/scratch.hpp"
#include "query/raycast/search.hpp"

#include <prolate/tools.hpp>

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

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

void RaycastSearch::begin(const PlacedRay& placed, bool any_hit) noexcept {
    ray = placed, any = any_hit;
    lattice_ray = to_lattice(placed, side.lattice, double{options.margin});
    side.deepest = 0, stats = {}, found = false, clear = HUGE_VAL;
}

} // namespace prolate::query

namespace prolate {
namespace {

using query::to_double, query::to_float;

QueryOptions for_rays(const TreeView& tree, const QueryOptions& options) {
    QueryOptions out = query::sound(options);
    out.margin = std::min(query::with_radius(out.margin, tree.radius()),
                          std::numeric_limits<float>::max()); // an infinite one would make NaNs
    return out;
}

query::PlacedEllipsoid root_of(const TreeView& tree, const float* growth) {
    query::PlacedEllipsoid out = query::place(growth ? tree.root() : tree.root_bound(), tree.scale());
    if (growth) out.size *= double{growth[0]}, out.reach *= double{growth[0]};
    return out;
}

// Rays against one body at one pose: what they have in common is prepared once.
class RayCaster {
public:
    RayCaster(const TreeView& tree, const Pose& pose, Scratch context, const QueryOptions& options,
              const float* growth = nullptr)
        : root_(root_of(tree, growth)), translation_(to_double(pose.translation)),
          rotation_(glm::transpose(query::rotation_matrix(pose.rotation))),
          search_(query::tree_side(tree, options.max_level), for_rays(tree, options), growth,
                  query::suffices(context, tree) ? context.entries() : nullptr, root_.reach) {}

    RaycastResult cast(const Ray& ray, bool any) {
        using glm::dvec3;
        RaycastResult out;
        if (!search_.stack) return out;
        const dvec3 from_body = to_double(ray.origin) - translation_;
        const query::PlacedRay placed = query::place(ray, {rotation_, rotation_ * from_body, glm::length(from_body)},
                                                     root_, double{search_.options.margin});
        if (!placed.valid) return out;
        if (placed.empty) {
            out.verdict = Verdict::separated, out.clear = ray.max_t;
            return out;
        }
        search_.begin(placed, any);
        const bool finished = query::traverse(search_);
        out.stats = search_.stats;
        out.stats.deepest_level = search_.side.deepest_level();
        out.clear =
            placed.begin + std::max(0.0, std::min(search_.clear, search_.found ? search_.best.t : placed.length));
        if (!search_.found) {
            if (finished) out.verdict = Verdict::separated, out.clear = ray.max_t;
            return out;
        }
        const dvec3 direction = to_double(ray.direction);
        out.verdict = Verdict::overlapping;
        out.t = placed.begin + search_.best.t;
        out.node = search_.node, out.triangle = search_.triangle;
        // Scaled first: the products of tiny or huge edges may lie beyond a double's squares.
        dvec3 normal = search_.best.normal;
        const double largest = std::max({std::abs(normal.x), std::abs(normal.y), std::abs(normal.z)});
        normal = largest > 0 ? normal / largest * rotation_ : -direction;
        out.point = to_float(to_double(ray.origin) + out.t * direction);
        out.normal = to_float(normal / glm::length(normal));
        return out;
    }

private:
    const query::PlacedEllipsoid root_;
    const glm::dvec3 translation_;
    const glm::dmat3 rotation_;   ///< from the world to the body
    query::RaycastSearch search_; ///< without a stack if the scratch is too small
};

} // namespace

RaycastResult raycast(const TreeView& tree, const Pose& pose, const Ray& ray, Scratch context,
                      const QueryOptions& options) noexcept {
    return RayCaster(tree, pose, context, options).cast(ray, false);
}

void raycast(const TreeView& tree, const Pose& pose, std::span<const Ray> rays, std::span<RaycastResult> out,
             Scratch context, const QueryOptions& options) noexcept {
    RayCaster caster(tree, pose, context, options);
    for (size_t i = 0; i < std::min(rays.size(), out.size()); ++i) out[i] = caster.cast(rays[i], false);
}

RaycastResult raycast_any(const TreeView& tree, const Pose& pose, const Ray& ray, Scratch context,
                          const QueryOptions& options) noexcept {
    return RayCaster(tree, pose, context, options).cast(ray, true);
}

RaycastResult raycast_cut(const TreeView& tree, const Pose& pose, const Ray& ray, std::span<const float> growth,
                          Scratch context, const QueryOptions& options) noexcept {
    return RayCaster(tree, pose, context, options, growth.data()).cast(ray, false);
}

RaycastResult raycast_cut_any(const TreeView& tree, const Pose& pose, const Ray& ray, std::span<const float> growth,
                              Scratch context, const QueryOptions& options) noexcept {
    return RayCaster(tree, pose, context, options, growth.data()).cast(ray, true);
}

} // namespace prolate
