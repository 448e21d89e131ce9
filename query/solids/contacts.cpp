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
// More than what rounding a sum that comes to `p` to floats, or one of its terms, moves a body by.
double rounding(const Vec3& p, const Vec3& moved_by) {
    return 0x1p-23 * (glm::length(to_double(p)) + glm::length(to_double(moved_by)));
}

} // namespace
} // namespace query

SolidsContacts contacts(const Solid& a, const Pose& pose_a, const Solid& b, const Pose& pose_b,
                        ContactManifolds& manifolds, Scratch context, const SolidsOptions& options) noexcept {
    SolidsContacts out;
    query::SolidPair pair(a, pose_a, b, pose_b, context, options.max_pair_tests);
    if (!pair.may_be_asked()) {
        manifolds.count = 0;
        return out;
    }
    const float margin = query::sound_length(options.margin), uncertainty = query::sound_length(options.uncertainty);
    const ContactResult outer = contacts(a.outer(), pose_a, b.outer(), pose_b, manifolds, context,
                                         {.max_pair_tests = pair.left(), .margin = margin});
    query::add(outer.stats, pair.stats);
    const bool farther = outer.verdict == Verdict::separated && uncertainty > 0;
    const Verdict met = farther ? pair.outer_meet(query::with_radius(margin, double{uncertainty})) : outer.verdict;
    out.verdict = pair.answer(met, margin, uncertainty).verdict, out.found = outer.found;
    const auto separated_at = [&](const Pose& moved, double off = 0) {
        const CollideResult r =
            collide(a.outer(), pose_a, b.outer(), moved, context,
                    {.max_pair_tests = pair.left(), .margin = query::with_radius(uncertainty, off)});
        query::add(r.stats, pair.stats);
        return r.verdict == Verdict::separated;
    };
    if (out.verdict == Verdict::separated || (margin > 0 && separated_at(pose_b))) {
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
                const Vec3 way_out = query::to_float(moved_by);
                if (!separated_at(moved, query::rounding(moved.translation, way_out))) continue;
                out.way_out = way_out, out.depth_upper = glm::length(query::to_double(way_out)) * (1 + 0x1p-50);
                break;
            }
    }
    out.stats = pair.stats;
    return out;
}

} // namespace prolate
