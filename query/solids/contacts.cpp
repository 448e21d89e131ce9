// contacts() of solids: the manifolds of the outer covers, and bounds of the depth on both sides.
//
// Lower bound: solids that hold two ellipsoids are at least as deep in each other as these. Upper bound: a translation
// after which collide() says that the outer covers are separated.
#include "query/solids/solids.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace prolate {
namespace query {
namespace {

constexpr double kWays[] = {1.01, 1.25, 1.6, 2.5}; // times a manifold's depth

// The depth of the deepest point of a manifold.
double deepest_point(const Manifold& manifold) {
    float depth = 0;
    for (uint32_t i = 0; i < manifold.count; ++i) depth = std::max(depth, manifold.points[i].depth);
    return double{depth};
}

Vec3 sum(const Vec3& p, const glm::dvec3& v) {
    return to_float(to_double(p) + v);
}

} // namespace
} // namespace query

SolidsContacts contacts(const Solid& a, const Pose& pose_a, const Solid& b, const Pose& pose_b,
                        ContactManifolds& manifolds, Scratch context, const SolidsOptions& options) noexcept {
    SolidsContacts out;
    const SolidsResult met = collide(a, pose_a, b, pose_b, context, options);
    query::SolidPair pair(a, pose_a, b, pose_b, context, options.max_pair_tests);
    pair.stats = met.stats;
    if (!pair.may_be_asked()) {
        manifolds.count = 0;
        return out;
    }
    const ContactResult outer = contacts(a.outer(), pose_a, b.outer(), pose_b, manifolds, context,
                                         {.max_pair_tests = pair.left(), .margin = options.margin});
    query::add(outer.stats, pair.stats);
    out.verdict = met.verdict, out.found = outer.found;
    const float uncertainty = query::sound_length(options.uncertainty);
    const auto separated_at = [&](const Pose& moved) {
        const CollideResult r = collide(a.outer(), pose_a, b.outer(), moved, context,
                                        {.max_pair_tests = pair.left(), .margin = uncertainty});
        query::add(r.stats, pair.stats);
        return r.verdict == Verdict::separated;
    };
    if (separated_at(pose_b)) {
        out.depth_upper = 0;
    } else {
        out.depth_lower = std::max(0.0, pair.depth() - double{uncertainty});
        for (uint32_t i = 0; i < manifolds.count; ++i)
            for (const double way : query::kWays) {
                const Manifold& manifold = manifolds.manifolds[i];
                const double depth = way * query::deepest_point(manifold);
                if (!(depth > 0 && depth < out.depth_upper)) break;
                Pose moved = pose_b;
                moved.translation = query::sum(pose_b.translation, depth * query::to_double(manifold.normal));
                const glm::dvec3 moved_by = query::to_double(moved.translation) - query::to_double(pose_b.translation);
                if (!separated_at(moved)) continue;
                out.way_out = query::to_float(moved_by);
                out.depth_upper = glm::length(moved_by) * (1 + 0x1p-50);
                break;
            }
    }
    out.stats = pair.stats;
    return out;
}

} // namespace prolate
