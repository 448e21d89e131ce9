// signed_distance() and contains(): the queries around the traversal (search.cpp). What is nearest comes first; then a
// ray tells on which side of a closed surface the point is (query/inside), or the ellipsoids that hold it how deep.
#include "query/ellipsoid/separation.hpp"
#include "query/inside/inside.hpp"
#include "query/node/scratch.hpp"
#include "query/points/search.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace prolate::query {
namespace {

using glm::dvec3;

enum class Side : uint8_t { outside, inside, on_surface, unknown }; // on it, or too near to tell

// What is known of a point: lower <= distance from the surface <= upper, and its side.
struct Answer {
    Side side = Side::unknown;
    double lower = 0, upper = NearestSearch::kInfinity;
    dvec3 nearest{0, 0, 0}, gradient{0, 0, 0};
};

// Many points against one tree, in its frame.
class PointBatch {
public:
    PointBatch(const TreeView& tree, const Pose& pose, Scratch context, const PointOptions& options)
        : tree_(tree), to_tree_(relative_pose(pose, Pose{})), to_world_(relative_pose(Pose{}, pose)), context_(context),
          max_tests_(options.max_pair_tests), max_distance_(sound_length(options.max_distance) + tree.radius()),
          radius_(tree.radius()), ellipsoids_(!tree.has_triangles() && !tree.bake_info().exact),
          surface_mode_(tree.surface_mode()), has_room_(suffices(context, tree)),
          reach_(place(tree.bound(0), tree.scale()).reach) {}

    SignedDistance signed_distance(const Vec3& p) {
        SignedDistance out = of_core(p);
        return radius_ > 0 ? of_rounded(out) : out;
    }
    SignedDistance of_core(const Vec3& p) {
        const PlacedPoint point = place(p, to_tree_);
        SignedDistance out;
        if (!std::isfinite(point.reach) || !has_room_) return out;
        const NearestSearch found = nearest(point, max_distance_, out);
        Answer answer = answer_for(point, found, out.stats);
        if (ellipsoids_ && !(answer.lower > 0)) answer = depth(point, answer, out);
        known_ = {answer.side, point, answer.lower, found.triangle};
        tell(answer, out);
        return out;
    }

    // Only whether the point is outside: what is not nearer than rounding need not be looked at.
    Verdict contains(const Vec3& p) {
        if (radius_ > 0) return signed_distance(p).verdict;
        const PlacedPoint point = place(p, to_tree_);
        if (!std::isfinite(point.reach) || !has_room_) return Verdict::undecided;
        SignedDistance out;
        const double rounding = 4 * kSeparationMargin * (point.reach + reach_);
        const NearestSearch found = nearest(point, rounding, out);
        Answer answer = answer_for(point, found, out.stats);
        if (ellipsoids_ && !(answer.lower > 0)) answer.side = Side::on_surface;
        tell(answer, out);
        return out.verdict;
    }

private:
    // Of all within the radius: outside, the distance less that. Inside, its surface is at least as far as that, and
    // how far is not known.
    SignedDistance of_rounded(SignedDistance out) const {
        const bool outside = out.lower > radius_;
        if (outside)
            out.verdict = Verdict::separated;
        else if (out.upper <= radius_ || out.verdict == Verdict::overlapping ||
                 out.upper - out.lower <= 4 * kSeparationMargin * (reach_ + radius_))
            out.verdict = Verdict::overlapping;
        else
            out.verdict = Verdict::undecided;
        out.lower = outside ? out.lower * (1 - 0x1p-51) - radius_ : -NearestSearch::kInfinity;
        out.upper = out.upper - radius_ + 0x1p-51 * (std::abs(out.upper) + radius_);
        const auto by = static_cast<float>(radius_);
        out.point = {out.point.x + by * out.gradient.x, out.point.y + by * out.gradient.y,
                     out.point.z + by * out.gradient.z};
        return out;
    }

    // The last point: a surface is no nearer to it than `lower`.
    struct Known {
        Side side = Side::unknown;
        PlacedPoint point{};
        double lower = 0;
        uint32_t triangle = kNoTriangle;
    };

    NearestSearch nearest(const PlacedPoint& point, double max_distance, SignedDistance& out) {
        NearestSearch search(tree_, point, context_, max_tests_, ellipsoids_);
        search.look_within(max_distance);
        if (known_.triangle != kNoTriangle && search.left() > 0) search.hint(known_.triangle);
        traverse(search);
        search.decided = std::min(search.decided, max_distance);
        out.stats = search.stats;
        out.stats.deepest_level = search.side.deepest_level();
        out.node = search.node, out.triangle = search.triangle;
        return search;
    }

    // Distance and side, but not the depth in ellipsoids.
    Answer answer_for(const PlacedPoint& point, const NearestSearch& found, QueryStats& stats) const {
        Answer out{side_of(point, found, stats),
                   std::min({found.decided, found.metres(found.open), found.upper}),
                   found.upper,
                   found.nearest,
                   {}};
        const dvec3 away = point.position - found.nearest;
        const double length = glm::length(away), normal = glm::length(found.normal);
        if (length > 0 && out.lower > 0)
            out.gradient = away / (out.side == Side::inside ? -length : length);
        else if (normal > 0)
            out.gradient = found.normal / normal;
        return out;
    }

    Side side_of(const PlacedPoint& point, const NearestSearch& found, QueryStats& stats) const {
        if (!(found.decided > 0)) return found.upper < NearestSearch::kInfinity ? Side::on_surface : Side::unknown;
        if (!(found.metres(found.open) > 0)) return Side::unknown;
        if (!found.in_root_box || surface_mode_ || ellipsoids_) return Side::outside;
        if (!tree_.has_triangles()) return Side::unknown;
        const double moved = glm::length(point.position - known_.point.position);
        if (known_.side != Side::unknown &&
            moved + kSeparationMargin * (point.reach + known_.point.reach) < known_.lower)
            return known_.side;
        const auto winding = winding_number(tree_, point, stats, max_tests_);
        return !winding ? Side::unknown : *winding != 0 ? Side::inside : Side::outside;
    }

    // Of a point that may lie in ellipsoids: at least as deep as in the deepest of them, and no deeper than the way out
    // of all of them in the direction that leaves this one soonest.
    Answer depth(const PlacedPoint& point, const Answer& around, SignedDistance& out) {
        DepthSearch deepest(tree_, point, context_, tests_left(max_tests_, out.stats.tests()));
        deepest.limit = 0;
        traverse(deepest);
        add(out.stats, deepest.stats);
        if (deepest.exit == 0) { // in none that was looked at: on the surface, or the budget ran out
            Answer answer = around;
            if (deepest.open < NearestSearch::kInfinity) answer.upper = NearestSearch::kInfinity;
            return answer;
        }
        Answer answer{Side::inside, deepest.depth, NearestSearch::kInfinity, point.position, deepest.way_out};
        out.node = deepest.node;
        leave(point, answer, out);
        return answer;
    }

    // Walks out of the union along answer.gradient. Each step leaves at least one ellipsoid for good, for a line meets
    // a convex body once.
    void leave(const PlacedPoint& point, Answer& answer, SignedDistance& out) {
        const double least_step = kSeparationMargin * (point.reach + reach_);
        double way = 0;
        for (;;) {
            const PlacedPoint at{point.position + way * answer.gradient, point.reach + way};
            DepthSearch search(tree_, at, context_, tests_left(max_tests_, out.stats.tests()));
            search.limit = 0, search.direction = &answer.gradient;
            traverse(search);
            add(out.stats, search.stats);
            if (search.open < NearestSearch::kInfinity) return; // no budget: no upper bound
            if (!(search.exit > least_step)) break;
            way += search.exit, out.node = search.node;
        }
        answer.upper = way + 4 * least_step;
        answer.nearest = point.position + way * answer.gradient;
    }

    static void add(QueryStats& to, const QueryStats& more) {
        to.pair_tests += more.pair_tests, to.block_tests += more.block_tests, to.triangle_tests += more.triangle_tests;
    }

    void tell(const Answer& answer, SignedDistance& out) const {
        out.lower = answer.side == Side::outside ? answer.lower : surface_mode_ ? 0 : -answer.upper;
        out.upper = answer.side == Side::inside ? -answer.lower : answer.upper;
        if (answer.side != Side::unknown)
            out.verdict = answer.side == Side::outside ? Verdict::separated : Verdict::overlapping;
        out.point = to_float(to_world_.rotation * answer.nearest + to_world_.translation);
        out.gradient = to_float(to_world_.rotation * answer.gradient);
    }

    const TreeView& tree_;
    const RelativePose to_tree_, to_world_;
    Scratch context_;
    const uint64_t max_tests_;
    const double max_distance_, radius_;
    const bool ellipsoids_, surface_mode_, has_room_;
    const double reach_; // of the body
    Known known_;
};

} // namespace
} // namespace prolate::query

namespace prolate {

SignedDistance signed_distance(const TreeView& tree, const Pose& pose, const Vec3& point, Scratch context,
                               const PointOptions& options) noexcept {
    return query::PointBatch(tree, pose, context, options).signed_distance(point);
}

void signed_distance(const TreeView& tree, const Pose& pose, std::span<const Vec3> points,
                     std::span<SignedDistance> out, Scratch context, const PointOptions& options) noexcept {
    query::PointBatch batch(tree, pose, context, options);
    for (size_t i = 0; i < std::min(points.size(), out.size()); ++i) out[i] = batch.signed_distance(points[i]);
}

Verdict contains(const TreeView& tree, const Pose& pose, const Vec3& point, Scratch context) noexcept {
    return query::PointBatch(tree, pose, context, {}).contains(point);
}

void contains(const TreeView& tree, const Pose& pose, std::span<const Vec3> points, std::span<Verdict> out,
              Scratch context) noexcept {
    query::PointBatch batch(tree, pose, context, {});
    for (size_t i = 0; i < std::min(points.size(), out.size()); ++i) out[i] = batch.contains(points[i]);
}

} // namespace prolate
