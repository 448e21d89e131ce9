// raycast() and its kin: the query around the traversal (search.cpp).
#include "query/node/scratch.hpp"
#include "query/raycast/search.hpp"

#include <prolate/tools.hpp>

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <span>

namespace prolate {

using glm::dvec3, query::to_double, query::to_float;

namespace query {
namespace {

QueryOptions for_rays(const TreeView& tree, const QueryOptions& options) {
    QueryOptions out = sound(options);
    out.margin = std::min(with_radius(out.margin, tree.radius()),
                          std::numeric_limits<float>::max()); // an infinite one would make NaNs
    return out;
}

RayBound root_of(const TreeView& tree, const float* growth) {
    if (!growth) return ray_bound(tree);
    const PlacedEllipsoid e = place(tree.root(), tree.scale());
    return {e.center, e.size * double{growth[0]}, e.reach * double{growth[0]}};
}

PlacedRay place_ray(const RaycastBody& body, const Ray& ray) {
    const dvec3 from_body = to_double(ray.origin) - body.translation;
    return place(ray, body.rotation, body.rotation * from_body, glm::length(from_body), body.root,
                 double{body.options.margin});
}

} // namespace

RaycastBody::RaycastBody(const TreeView& tree, const Pose& pose, Scratch scratch, const QueryOptions& asked,
                         const float* grown) noexcept
    : side(tree_side(tree, asked.max_level)), options(for_rays(tree, asked)), growth(grown),
      stacks(suffices(scratch, tree) ? reinterpret_cast<RayFamily*>(scratch.entries()) : nullptr),
      stack_size(ray_stack_size(tree)), root(root_of(tree, grown)), translation(to_double(pose.translation)),
      rotation(glm::transpose(rotation_matrix(pose.rotation))), per_step(steps_per_metre(side.lattice)) {
    for (size_t i = 0; i < 3; ++i) shift[i] = side.lattice.origin[i], shift_reach += std::abs(shift[i]);
}

RaycastSearch::RaycastSearch(const RaycastBody& of_all, const Ray& world_ray, bool any_hit) noexcept
    : body(of_all), ray(place_ray(of_all, world_ray)), any(any_hit) {}

} // namespace query

namespace {

dvec3 face_normal(const TreeView& tree, uint32_t triangle) {
    const auto [a, b, c] = tree.triangle(triangle);
    const dvec3 from = query::position(tree, a);
    return glm::cross(query::position(tree, b) - from, query::position(tree, c) - from);
}

// Completes what is hit.
void complete_hit(const query::RaycastSearch& search, const Ray& ray, RaycastResult& out) {
    const query::RaycastBody& body = search.body;
    const dvec3 direction = to_double(ray.direction);
    out.verdict = Verdict::overlapping;
    out.t = search.ray.begin + search.best.t;
    out.node = search.node, out.triangle = search.triangle;
    dvec3 normal = search.best.normal;
    if (search.triangle != kNoTriangle && !(body.options.margin > 0))
        normal = face_normal(body.side.tree, search.triangle);
    // Scaled first: the products of tiny or huge edges may lie beyond a double's squares.
    const double largest = std::max({std::abs(normal.x), std::abs(normal.y), std::abs(normal.z)});
    normal = largest > 0 ? normal * (1 / largest) * body.rotation : -direction;
    out.point = to_float(to_double(ray.origin) + out.t * direction);
    out.normal = to_float(normal * (1 / glm::length(normal)));
}

void complete(const query::RaycastSearch& search, const Ray& ray, RaycastResult& out) {
    out.stats = search.stats;
    if (search.finished && !search.found) {
        out.verdict = Verdict::separated, out.clear = ray.max_t;
        return;
    }
    if (search.found) complete_hit(search, ray, out);
    const double clear = std::min(search.clear, search.found ? search.best.t : search.ray.length);
    out.clear = search.ray.begin + std::max(0.0, clear);
}

// No more rays than that, or than there are stacks for.
template <size_t kMost>
void cast_some(const query::RaycastBody& body, std::span<const Ray> rays, std::span<RaycastResult> out, bool any) {
    using query::RaycastSearch;
    alignas(RaycastSearch) std::byte memory[kMost * sizeof(RaycastSearch)];
    auto* const searches = reinterpret_cast<RaycastSearch*>(memory);
    size_t of[kMost], count = 0;
    for (size_t i = 0; i < rays.size(); ++i) {
        out[i] = {};
        const RaycastSearch& search = *std::construct_at(searches + count, body, rays[i], any);
        if (!search.ray.valid) continue;
        if (search.ray.empty)
            out[i].verdict = Verdict::separated, out[i].clear = rays[i].max_t;
        else
            of[count++] = i;
    }
    if (count == 0) return;
    query::traverse({searches, count});
    for (size_t i = 0; i < count; ++i) complete(searches[i], rays[of[i]], out[of[i]]);
}

RaycastResult cast(const query::RaycastBody& body, const Ray& ray, bool any) {
    RaycastResult out;
    if (body.stacks) cast_some<1>(body, {&ray, 1}, {&out, 1}, any);
    return out;
}

} // namespace

RaycastResult raycast(const TreeView& tree, const Pose& pose, const Ray& ray, Scratch context,
                      const QueryOptions& options) noexcept {
    return cast({tree, pose, context, options, nullptr}, ray, false);
}

void raycast(const TreeView& tree, const Pose& pose, std::span<const Ray> rays, std::span<RaycastResult> out,
             Scratch context, const QueryOptions& options) noexcept {
    const query::RaycastBody body(tree, pose, context, options, nullptr);
    const size_t count = std::min(rays.size(), out.size());
    if (!body.stacks) std::fill_n(out.begin(), count, RaycastResult{});
    const size_t stacks =
                     size_t{context.count()} * sizeof(Scratch::Entry) / (body.stack_size * sizeof(query::RayFamily)),
                 at_once = std::min<size_t>(stacks, query::kRaysAtOnce);
    for (size_t i = 0; body.stacks && i < count; i += at_once) {
        const size_t some = std::min(count - i, at_once);
        cast_some<query::kRaysAtOnce>(body, rays.subspan(i, some), out.subspan(i, some), false);
    }
}

RaycastResult raycast_any(const TreeView& tree, const Pose& pose, const Ray& ray, Scratch context,
                          const QueryOptions& options) noexcept {
    return cast({tree, pose, context, options, nullptr}, ray, true);
}

RaycastResult raycast_cut(const TreeView& tree, const Pose& pose, const Ray& ray, std::span<const float> growth,
                          Scratch context, const QueryOptions& options) noexcept {
    return cast({tree, pose, context, options, growth.data()}, ray, false);
}

RaycastResult raycast_cut_any(const TreeView& tree, const Pose& pose, const Ray& ray, std::span<const float> growth,
                              Scratch context, const QueryOptions& options) noexcept {
    return cast({tree, pose, context, options, growth.data()}, ray, true);
}

} // namespace prolate
