// Queries of a World from outside: each goes through the bodies whose boxes it may meet.
#include "query/node/limits.hpp"
#include "query/world/bounds.hpp"
#include "query/world/jobs.hpp"
#include "query/world/rays.hpp"
#include "query/world/two_bodies.hpp"

#include <prolate/world_queries.hpp>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace prolate {
namespace {

using glm::dvec3;

constexpr uint32_t kGrain = 2;                           // questions, each to many bodies
constexpr uint32_t kRayGrain = query::kRaysUnderWay / 2; // rays share what they come to

Result<void> check(size_t questions, size_t room, const Workers& workers) {
    if (room < questions || questions > UINT32_MAX) return query::kSpanTooShort;
    if (!query::has_context_each(workers.jobs, workers.contexts)) return query::kTooFewContexts;
    return {};
}

// The float above: whatever is hit at t is hit before it.
float above(double t) {
    return std::nextafter(static_cast<float>(t), std::numeric_limits<float>::infinity());
}

// Ids in ascending order in the room there is: the lowest of them.
struct LowestIds {
    std::span<BodyId> room;
    uint32_t count = 0;

    void add(BodyId id) {
        const size_t held = std::min<size_t>(count++, room.size());
        const auto end = room.begin() + static_cast<std::ptrdiff_t>(held);
        const auto at = std::upper_bound(room.begin(), end, id, [](BodyId x, BodyId y) { return x.index < y.index; });
        if (at == room.end()) return;
        std::move_backward(at, held == room.size() ? end - 1 : end, held == room.size() ? end : end + 1);
        *at = id;
    }
};

// A box around all places of a body that turns about its center, as it begins.
Bounds about_center(const MovingTree& moving, const SweepOptions& options) {
    const query::RelativePose at = query::relative_pose({}, moving.motion.start);
    const query::PlacedEllipsoid root = query::place(moving.tree.root_bound(), moving.tree.scale());
    const dvec3 pivot = query::to_double(moving.motion.center), center = at.rotation * pivot + at.translation;
    // Within the tolerance two bodies may be said to meet: by default, 1e-4 of the smaller one's size.
    const double tolerance = query::sound_tolerance(options.tolerance) + 1e-4 * (root.size + moving.tree.radius());
    const double lengths = root.reach + glm::length(pivot) + at.distance + moving.tree.radius();
    const double radius = glm::distance(root.center, pivot) + root.size + moving.tree.radius() +
                          query::sound_length(double{options.margin}) + tolerance + query::kSeparationMargin * lengths;
    return {
        {query::round_down(center.x - radius), query::round_down(center.y - radius),
         query::round_down(center.z - radius)},
        {query::round_up(center.x + radius), query::round_up(center.y + radius), query::round_up(center.z + radius)}};
}

SweepHit first_hit(const World& world, const MovingTree& moving, Scratch context, const SweepOptions& options,
                   uint32_t mask) {
    SweepHit out;
    const Body body{.shape = moving.tree, .pose = {}};
    double lower = 1;
    bool undecided = false;
    QueryStats stats;
    world.cast(
        about_center(moving, options), moving.motion.linear, 1,
        [&](BodyId id, float until) {
            const Body& other = *world.find(id);
            Motion rest;
            rest.start = other.pose;
            const SweepResult r = query::sweep(body, moving.motion, other, rest, context, options);
            query::add(r.stats, stats);
            lower = std::min(lower, r.time_lower), undecided = undecided || r.verdict == Verdict::undecided;
            const bool first = out.body == BodyId{} || r.time_upper < out.result.time_upper ||
                               (r.time_upper == out.result.time_upper && id.index < out.body.index);
            if (!(r.time_upper <= 1) || !first) return until;
            out = {.body = id, .result = r};
            return std::min(until, above(r.time_upper));
        },
        mask);
    out.result.verdict = undecided && lower < out.result.time_upper ? Verdict::undecided
                         : out.body == BodyId{}                     ? Verdict::separated
                                                                    : Verdict::overlapping;
    out.result.time_lower = std::min(lower, out.result.time_upper), out.result.stats = stats;
    return out;
}

} // namespace

Result<void> raycast(const World& world, std::span<const Ray> rays, std::span<RayHit> out, const Workers& workers,
                     const QueryOptions& query_options, uint32_t mask) noexcept {
    if (const auto good = check(rays.size(), out.size(), workers); !good) return good;
    query::for_ranges(workers.jobs, static_cast<uint32_t>(rays.size()), kRayGrain,
                      [&](uint32_t begin, uint32_t end, uint32_t worker) {
                          query::cast_rays(world, rays.subspan(begin, end - begin), out.subspan(begin, end - begin),
                                           workers.contexts[worker], query::sound(query_options), mask);
                      });
    return {};
}

Result<void> overlap(const World& world, std::span<const Probe> probes, std::span<BodyId> found,
                     std::span<uint32_t> counts, const Workers& workers, const QueryOptions& query_options,
                     uint32_t mask) noexcept {
    if (const auto good = check(probes.size(), counts.size(), workers); !good) return good;
    const QueryOptions options = query::sound(query_options);
    const size_t most = probes.empty() ? 0 : found.size() / probes.size();
    query::for_ranges(workers.jobs, static_cast<uint32_t>(probes.size()), kGrain,
                      [&](uint32_t begin, uint32_t end, uint32_t worker) {
                          for (uint32_t i = begin; i < end; ++i) {
                              LowestIds ids{found.subspan(i * most, most)};
                              world.visit(
                                  query::bounds_of(probes[i], options.margin),
                                  [&](BodyId id) {
                                      const Verdict verdict =
                                          query::overlap(*world.find(id), probes[i], workers.contexts[worker], options);
                                      if (verdict != Verdict::separated) ids.add(id);
                                      return true;
                                  },
                                  mask);
                              counts[i] = ids.count;
                          }
                      });
    return {};
}

Result<void> sweep(const World& world, std::span<const MovingTree> moving, std::span<SweepHit> out,
                   const Workers& workers, const SweepOptions& options, uint32_t mask) noexcept {
    if (const auto good = check(moving.size(), out.size(), workers); !good) return good;
    query::for_ranges(workers.jobs, static_cast<uint32_t>(moving.size()), kGrain,
                      [&](uint32_t begin, uint32_t end, uint32_t worker) {
                          for (uint32_t i = begin; i < end; ++i)
                              out[i] = first_hit(world, moving[i], workers.contexts[worker], options, mask);
                      });
    return {};
}

} // namespace prolate
