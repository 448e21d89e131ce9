// sweep() of a body and a half-space: conservative advancement (B. Mirtich 1996) of the whole body, which its lowest
// point suffices for.
//
// A point of the body with the lever r from the point it turns about comes nearer to the plane, of normal n, at the
// speed
//     -n.(v + w x r) = -n.v - (n x w).r  <=  -n.v + |n x w| R,        R >= |r|,
// which never changes, for n, v and w are constant. A gap g > 0 therefore lasts for the time g / speed. It is cut down
// to half of the tolerance before, so that each step gains at least the other half: the search ends. For that the
// tolerance must be above four times what a height may be wrong by, less than 2^-41 (1 + the angle turned by) of all
// lengths.
//
// Rounding, in the terms of query/sweep/motion.hpp: the half-space stands in the body's frame with the normal R^T n and
// the offset that R^T n.(what lies between) adds to; a height is wrong by no more than Instant::slack times all
// lengths, besides what lowest.hpp accounts for.
#include <prolate/half_space.hpp>

#include "query/half_space/lowest.hpp"
#include "query/node/scratch.hpp"
#include "query/sweep/motion.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace prolate {
namespace query {
namespace {

using glm::dvec3;

constexpr double kLeastTolerance = 0x1p-38;
constexpr double kRoundDown = 1 - 0x1p-40; // of times: far above what rounds in them

SweepOptions sound(SweepOptions options) {
    options.margin = sound_length(options.margin), options.tolerance = sound_tolerance(options.tolerance);
    return options;
}

Motion at_rest(const Vec3& translation) {
    Motion out;
    out.start.translation = translation;
    return out;
}

class Fall {
public:
    Fall(const TreeView& tree, const Motion& motion, const HalfSpace& half_space, Scratch context,
         const SweepOptions& options)
        : tree_(tree), context_(context), options_(sound(options)), start_(to_double(motion.start.translation)),
          motion_(motion, at_rest(motion.start.translation)),
          ground_(place(half_space, {motion.start.translation, {}}, 0)) {
        const PlacedEllipsoid bound = place(tree.bound(0), tree.scale());
        const MovingBody& body = motion_.a();
        reach_ = bound.reach + ground_.reach + motion_.at(1).b_to_a.distance;
        const double asked = options_.tolerance > 0
                                 ? options_.tolerance
                                 : kSweepTolerance * (place(tree.root(), tree.scale()).size + tree.radius());
        const double tolerance = std::max(asked, kLeastTolerance * (1 + body.speed()) * reach_);
        target_ = options_.margin + tolerance / 2, reached_ = options_.margin + tolerance;
        const double lever = glm::distance(bound.center, body.center()) + bound.size;
        const dvec3 turn = glm::cross(ground_.normal, to_double(motion.angular));
        speed_ = -glm::dot(ground_.normal, body.linear()) + glm::length(turn) * lever +
                 2 * kSeparationMargin * (glm::length(body.linear()) + body.speed() * (lever + reach_));
    }

    SweepResult run() {
        SweepResult out;
        if (!motion_.finite() || !is_finite(ground_) || !std::isfinite(motion_.at(0).b_to_a.distance)) return out;
        for (double t = 0;;) {
            out.time_lower = t;
            if (!look(t)) break;
            if (high_ <= reached_) {
                out.verdict = Verdict::overlapping;
                fill(t, out);
                break;
            }
            const double gap = low_ - target_;
            if (!(gap > 0)) break; // out of tests, or all is too large for its tolerance
            const double until = speed_ > 0 ? t + gap / speed_ * kRoundDown : HUGE_VAL;
            if (until >= 1) {
                out.verdict = Verdict::separated, out.time_lower = 1;
                break;
            }
            if (!(until > t)) break;
            t = until;
        }
        out.stats = stats_;
        return out;
    }

private:
    // Finds the lowest point at this time. False if the budget does not suffice for anything.
    bool look(double t) {
        const Instant now = motion_.at(t);
        PlacedHalfSpace here = ground_;
        here.normal = now.b_to_a.rotation * ground_.normal;
        here.offset = ground_.offset + glm::dot(here.normal, now.b_to_a.translation);
        here.reach = ground_.reach + now.b_to_a.distance;
        HeightSearch search(
            tree_, here, context_,
            {.max_level = options_.max_level, .max_pair_tests = tests_left(options_.max_pair_tests, stats_.tests())});
        Lowest lowest(search);
        traverse(search);
        stats_.pair_tests += search.stats.pair_tests, stats_.block_tests += search.stats.block_tests;
        stats_.triangle_tests += search.stats.triangle_tests;
        stats_.deepest_level = std::max(stats_.deepest_level, search.side.deepest_level());
        if (!(lowest.height < HUGE_VAL)) return false;
        const double slack = now.slack * reach_;
        low_ = std::min(lowest.lower, search.open) - slack;
        high_ = lowest.height + lowest.slack + slack;
        point_ = lowest.point, pair_ = lowest.pair, height_ = lowest.meets ? 0 : lowest.height;
        return true;
    }

    void fill(double t, SweepResult& out) const {
        const MovingBody& body = motion_.a();
        const dvec3 at = body.rotation(t) * (point_ - body.center()) + body.center_at(t) + start_;
        out.time_upper = t, out.distance = height_ > 0 ? std::max(0.0, high_) : 0, out.pair = pair_;
        out.point_a = to_float(at), out.point_b = to_float(at - height_ * ground_.normal);
        if (height_ > 0) out.normal = to_float(-ground_.normal);
    }

    const TreeView& tree_;
    Scratch context_;
    const SweepOptions options_;
    const dvec3 start_; // the body's translation
    const PairMotion motion_;
    const PlacedHalfSpace ground_; // seen from the body's starting translation
    double reach_, target_, reached_, speed_;
    QueryStats stats_;

    double low_ = 0, high_ = 0, height_ = 0; // of the lowest point now
    dvec3 point_{0, 0, 0};
    MeetingPair pair_{};
};

} // namespace
} // namespace query

SweepResult sweep(const TreeView& tree, const Motion& motion, const HalfSpace& half_space, Scratch context,
                  const SweepOptions& options) noexcept {
    if (!query::suffices(context, tree)) return {};
    SweepOptions of_core = options;
    of_core.margin = query::with_radius(query::sound_length(options.margin), tree.radius());
    SweepResult out = query::Fall(tree, motion, half_space, context, of_core).run();
    if (tree.radius() > 0) query::round_sweep(out, tree.radius(), 0);
    return out;
}

} // namespace prolate
