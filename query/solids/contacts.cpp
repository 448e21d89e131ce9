// contacts() of solids: the manifolds of the outer covers, and bounds of the depth on both sides.
//
// Lower bound: solids that hold two ellipsoids are at least as deep in each other as these. Upper bound: a translation
// after which collide() says that the outer covers are separated.
#include "query/solids/solids.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace prolate {
namespace query {
namespace {

// Times a manifold's depth. The first suffices where the manifold is all that is in the way.
constexpr double kWays[] = {1.01, 1.25, 1.6, 2.5};
constexpr int kHalvings = 3; // of what is left between a way that does not lead out and one that does

// The depth of the deepest point of a manifold.
double deepest_point(const Manifold& manifold) {
    float depth = 0;
    for (uint32_t i = 0; i < manifold.count; ++i) depth = std::max(depth, manifold.points[i].depth);
    return double{depth};
}

// Translations of B, the shortest of which is kept.
class WaysOut {
public:
    WaysOut(const TreeView& a, const Pose& pose_a, const TreeView& b, const Pose& pose_b, Scratch context,
            float uncertainty, SolidPair& pair)
        : a_(a), b_(b), pose_a_(pose_a), pose_b_(pose_b), context_(context), uncertainty_(uncertainty), pair_(pair) {}

    bool separated_at(const Pose& moved, double off = 0) {
        const CollideResult r = collide(a_, pose_a_, b_, moved, context_,
                                        {.max_pair_tests = pair_.left(), .margin = with_radius(uncertainty_, off)});
        add(r.stats, pair_.stats);
        return r.verdict == Verdict::separated;
    }
    // Along a manifold's normal, unit, about as far as it is deep.
    void look_along(const glm::dvec3& normal, double depth) {
        double in = 0;
        for (const double times : kWays) {
            const double out = times * depth;
            if (!(out > 0 && out < length)) return;
            if (leads_out(normal, out)) return in > 0 ? shorten(normal, in, out) : void();
            in = out;
        }
    }
    // Until spheres around the bodies are apart: that leads out, unless the budget ends.
    void look_away() {
        const PlacedEllipsoid a = place(a_.root_bound(), a_.scale(), world_pose(pose_a_)),
                              b = place(b_.root_bound(), b_.scale(), world_pose(pose_b_));
        const double far = glm::distance(a.center, b.center);
        const glm::dvec3 normal = far > 0 ? (b.center - a.center) / far : glm::dvec3(1, 0, 0);
        const double radii = double{a_.radius()} + b_.radius() + double{uncertainty_};
        const double out = 1.001 * (a.size + b.size + radii) - far;
        if (leads_out(normal, out)) shorten(normal, 0, out);
    }

    double length = std::numeric_limits<double>::infinity();
    Vec3 way{0, 0, 0};

private:
    bool leads_out(const glm::dvec3& normal, double distance) {
        Pose moved = pose_b_;
        moved.translation = to_float(to_double(pose_b_.translation) + distance * normal);
        const Vec3 by = to_float(to_double(moved.translation) - to_double(pose_b_.translation));
        // More than what rounding the sum, or one of its terms, to floats moves the body by.
        const double off = 0x1p-23 * (glm::length(to_double(moved.translation)) + glm::length(to_double(by)));
        if (!separated_at(moved, off)) return false;
        const double moved_by = glm::length(to_double(by)) * (1 + 0x1p-50);
        if (moved_by < length) length = moved_by, way = by;
        return true;
    }
    void shorten(const glm::dvec3& normal, double in, double out) {
        for (int i = 0; i < kHalvings; ++i) {
            const double middle = 0.5 * (in + out);
            (leads_out(normal, middle) ? out : in) = middle;
        }
    }

    const TreeView &a_, &b_;
    const Pose &pose_a_, &pose_b_;
    const Scratch context_;
    const float uncertainty_;
    SolidPair& pair_;
};

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
    query::WaysOut ways(a.outer(), pose_a, b.outer(), pose_b, context, uncertainty, pair);
    if (out.verdict == Verdict::separated || (margin > 0 && ways.separated_at(pose_b))) {
        out.depth_upper = 0;
    } else {
        out.depth_lower = std::max(0.0, pair.depth() - double{uncertainty});
        for (uint32_t i = 0; i < manifolds.count; ++i) {
            const Manifold& manifold = manifolds.manifolds[i];
            ways.look_along(query::to_double(manifold.normal), query::deepest_point(manifold));
        }
        if (!(ways.length < HUGE_VAL)) ways.look_away();
        out.way_out = ways.way, out.depth_upper = ways.length;
    }
    out.stats = pair.stats;
    return out;
}

} // namespace prolate
