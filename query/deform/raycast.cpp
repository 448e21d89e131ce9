// raycast() of deformed bodies: the query around its search (ray_search.cpp).
#include "query/deform/ray_search.hpp"
#include "query/node/limits.hpp"
#include "query/node/scratch.hpp"

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace prolate {
namespace {

using query::to_double, query::to_float;

// Completes what is hit.
void describe(const query::RaySearch& search, const Ray& ray, const glm::dmat3& to_body, DeformedRaycastResult& out) {
    const glm::dvec3 direction = to_double(ray.direction);
    out.t = out.clear = search.ray.begin + search.best.t;
    out.node = search.node, out.triangle = search.triangle;
    // Scaled first: the products of tiny or huge edges may lie beyond a double's squares.
    glm::dvec3 normal = search.best.normal;
    const double largest = std::max({std::abs(normal.x), std::abs(normal.y), std::abs(normal.z)});
    normal = largest > 0 ? normal / largest * to_body : -direction;
    out.point = to_float(to_double(ray.origin) + out.t * direction);
    out.normal = to_float(normal / glm::length(normal));
}

} // namespace

DeformedRaycastResult raycast(const DeformedBody& body, const Ray& ray, Scratch context,
                              const QueryOptions& options) noexcept {
    DeformedRaycastResult out;
    const query::Deformed deformed(body, options.max_level);
    if (!deformed.in_range()) {
        out.reason = Undecided::coordinates;
        return out;
    }
    if (!query::suffices(context, body.tree)) return out;
    const double margin = std::min(query::with_radius(query::sound(options).margin, body.tree.radius()),
                                   std::numeric_limits<float>::max());
    const glm::dmat3 to_body = glm::transpose(query::rotation_matrix(body.pose.rotation));
    const glm::dvec3 from_body = to_double(ray.origin) - to_double(body.pose.translation);
    const query::PlacedRay placed =
        query::place(ray, {to_body, to_body * from_body, glm::length(from_body)}, deformed, margin);
    if (!placed.valid) return out;
    out.reason = Undecided::no, out.verdict = Verdict::separated, out.clear = ray.max_t;
    if (placed.empty) return out;
    query::RaySearch search(deformed, placed, context.entries(), margin, options.max_pair_tests, false);
    const bool finished = search.run();
    out.stats = search.stats;
    if (search.found) {
        out.verdict = Verdict::overlapping;
        describe(search, ray, to_body, out);
    }
    if (!finished) {
        out.clear = placed.begin;
        if (!search.found) out.verdict = Verdict::undecided, out.reason = Undecided::budget;
    }
    return out;
}

} // namespace prolate
