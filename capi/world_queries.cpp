// Queries of worlds of the C interface: structs that are laid out as those of C++ are worked on where they are, others
// are filled in ranges of a few at a time.
#include "capi/handles.hpp"
#include "capi/world.hpp"

#include <prolate/prolate.h>
#include <prolate/world_queries.hpp>

#include <algorithm>
#include <cstddef>
#include <optional>
#include <span>

using namespace prolate;
using namespace prolate::capi;

namespace {

// What every query of a world takes, checked.
template <class Given> struct WorldCall {
    Given given = fresh<Given>();
    Workers workers;
    prolate_status status = PROLATE_OK;

    WorldCall(const prolate_world* world, const prolate_workers* by, const Given* options) {
        const Jobs jobs = by != nullptr ? jobs_of(by->jobs) : Jobs{};
        QueryContext* const contexts =
            by != nullptr ? contexts_of(by->scratch, by->scratch_size, jobs.workers) : nullptr;
        if (world == nullptr || contexts == nullptr) {
            status = PROLATE_BAD_ARGUMENT;
            return;
        }
        workers = {.contexts = {contexts, jobs.workers}, .jobs = jobs};
        if (!read(options, given)) status = PROLATE_BAD_STRUCT;
    }
};

bool sound(const void* from, size_t count, const void* to) {
    return count <= UINT32_MAX && (count == 0 || (from != nullptr && to != nullptr));
}
std::span<const BodyPair> pairs_of(const prolate_body_pair* pairs, size_t count) {
    return {reinterpret_cast<const BodyPair*>(pairs), count};
}

// Do all bodies that pairs name exist?
bool all_exist(const World& world, std::span<const BodyPair> pairs) {
    return std::ranges::all_of(pairs, [&](const BodyPair& p) { return world.find(p.a) && world.find(p.b); });
}

// Answers of some questions at a time, in room of our own: ask(first, count, span) fills the span.
constexpr size_t kAtOnce = 64;
template <class Answer, class Ask, class Take> prolate_status by_parts(size_t count, Ask&& ask, Take&& take) {
    Answer some[kAtOnce];
    for (size_t i = 0; i < count; i += kAtOnce) {
        const size_t now = std::min(kAtOnce, count - i);
        const Result<void> done = ask(i, now, std::span(some, now));
        if (!done) return status_of(done);
        for (size_t k = 0; k < now; ++k) take(i + k, some[k]);
    }
    return PROLATE_OK;
}

// None of a half-space, of which overlap() does not ask.
std::optional<Probe> probe_of(const prolate_shape& shape) {
    switch (shape.kind) {
    case PROLATE_SPHERE:
        return Sphere{same<Vec3>(shape.a), shape.radius};
    case PROLATE_CAPSULE:
        return Capsule{same<Vec3>(shape.a), same<Vec3>(shape.b), shape.radius};
    case PROLATE_BOX:
        return Box{{same<Vec3>(shape.a), same<Quat>(shape.rotation)}, same<Vec3>(shape.half)};
    default:
        return std::nullopt;
    }
}

static_assert(sizeof(prolate_pair_contacts) == sizeof(PairContacts) &&
              offsetof(prolate_pair_contacts, verdict) == offsetof(PairContacts, result) &&
              offsetof(prolate_pair_contacts, found) ==
                  offsetof(PairContacts, result) + offsetof(ContactResult, found) &&
              offsetof(prolate_pair_contacts, stats) ==
                  offsetof(PairContacts, result) + offsetof(ContactResult, stats) &&
              offsetof(prolate_pair_contacts, touching) == offsetof(PairContacts, touching) &&
              offsetof(prolate_pair_contacts, manifolds) == offsetof(PairContacts, manifolds));
static_assert(sizeof(prolate_contact_event) == sizeof(ContactEvent) &&
              offsetof(prolate_contact_event, kind) == offsetof(ContactEvent, kind));
static_assert(sizeof(prolate_ray) == sizeof(Ray));

} // namespace

prolate_status prolate_world_collide(const prolate_world* world, const prolate_body_pair* pairs, size_t count,
                                     const prolate_workers* workers, const prolate_query_options* options,
                                     prolate_verdict* verdicts) {
    const WorldCall call(world, workers, options);
    if (call.status != PROLATE_OK) return call.status;
    if (!sound(pairs, count, verdicts)) return PROLATE_BAD_ARGUMENT;
    static_assert(sizeof(Verdict) == sizeof(prolate_verdict));
    return status_of(collide(*world->world, pairs_of(pairs, count),
                             std::span(reinterpret_cast<Verdict*>(verdicts), count), call.workers,
                             options_of(call.given)));
}

prolate_status prolate_world_collide_solids(const prolate_world* world, const prolate_body_pair* pairs, size_t count,
                                            const prolate_workers* workers, const prolate_query_options* options,
                                            prolate_verdict* verdicts) {
    const WorldCall call(world, workers, options);
    if (call.status != PROLATE_OK) return call.status;
    if (!sound(pairs, count, verdicts)) return PROLATE_BAD_ARGUMENT;
    if (!all_exist(*world->world, pairs_of(pairs, count))) return PROLATE_BAD_ID;
    const QueryOptions limits = options_of(call.given);
    return by_parts<SolidsResult>(
        count,
        [&](size_t first, size_t now, std::span<SolidsResult> out) {
            return collide(*world->world, pairs_of(pairs + first, now), out, call.workers,
                           SolidsOptions{.max_pair_tests = limits.max_pair_tests, .margin = limits.margin});
        },
        [&](size_t i, const SolidsResult& r) { verdicts[i] = verdict_of(r.verdict); });
}

prolate_status prolate_world_distance(const prolate_world* world, const prolate_body_pair* pairs, size_t count,
                                      const prolate_workers* workers, const prolate_distance_options* options,
                                      prolate_distance_answer* answers) {
    const WorldCall call(world, workers, options);
    if (call.status != PROLATE_OK) return call.status;
    if (!sound(pairs, count, answers)) return PROLATE_BAD_ARGUMENT;
    if (!all_exist(*world->world, pairs_of(pairs, count))) return PROLATE_BAD_ID;
    return by_parts<DistanceResult>(
        count,
        [&](size_t first, size_t now, std::span<DistanceResult> out) {
            return distance(*world->world, pairs_of(pairs + first, now), out, call.workers, options_of(call.given));
        },
        [&](size_t i, const DistanceResult& r) {
            answers[i] = {r.lower,
                          r.upper,
                          same<prolate_vec3>(r.point_a),
                          same<prolate_vec3>(r.point_b),
                          same<prolate_vec3>(r.normal),
                          verdict_of(r.verdict),
                          r.enclosed};
        });
}

prolate_status prolate_world_contacts(const prolate_world* world, const prolate_body_pair* pairs, size_t count,
                                      const prolate_workers* workers, const prolate_query_options* options,
                                      prolate_pair_contacts* records, size_t record_count) {
    const WorldCall call(world, workers, options);
    if (call.status != PROLATE_OK) return call.status;
    if (!sound(pairs, count, records) || (records == nullptr && record_count > 0)) return PROLATE_BAD_ARGUMENT;
    return status_of(contacts(*world->world, pairs_of(pairs, count),
                              {reinterpret_cast<PairContacts*>(records), record_count}, call.workers,
                              options_of(call.given)));
}

prolate_status prolate_world_contact_events(const prolate_world* world, prolate_pair_contacts* records,
                                            size_t record_count, prolate_contact_event* events, size_t capacity,
                                            size_t* count) {
    if (world == nullptr || count == nullptr || (records == nullptr && record_count > 0) ||
        (events == nullptr && capacity > 0))
        return PROLATE_BAD_ARGUMENT;
    const auto found = contact_events(*world->world, {reinterpret_cast<PairContacts*>(records), record_count},
                                      {reinterpret_cast<ContactEvent*>(events), capacity});
    if (found) *count = *found;
    return status_of(found);
}

prolate_status prolate_world_raycast(const prolate_world* world, const prolate_ray* rays, size_t count, uint32_t mask,
                                     const prolate_workers* workers, const prolate_query_options* options,
                                     prolate_ray_hit* hits) {
    const WorldCall call(world, workers, options);
    if (call.status != PROLATE_OK) return call.status;
    if (!sound(rays, count, hits)) return PROLATE_BAD_ARGUMENT;
    return by_parts<RayHit>(
        count,
        [&](size_t first, size_t now, std::span<RayHit> out) {
            return raycast(*world->world, {reinterpret_cast<const Ray*>(rays) + first, now}, out, call.workers,
                           options_of(call.given), mask);
        },
        [&](size_t i, const RayHit& hit) {
            const RaycastResult& r = hit.result;
            hits[i] = {same<prolate_body_id>(hit.body), verdict_of(r.verdict),        r.t,    r.clear,
                       same<prolate_vec3>(r.point),     same<prolate_vec3>(r.normal), r.node, r.triangle};
        });
}

prolate_status prolate_world_overlap(const prolate_world* world, const prolate_shape* shapes, size_t count,
                                     uint32_t mask, const prolate_workers* workers,
                                     const prolate_query_options* options, prolate_body_id* ids, size_t most,
                                     uint32_t* found) {
    const WorldCall call(world, workers, options);
    if (call.status != PROLATE_OK) return call.status;
    if (!sound(shapes, count, found) || (ids == nullptr && most > 0)) return PROLATE_BAD_ARGUMENT;
    if (!std::all_of(shapes, shapes + count, [](const prolate_shape& s) { return probe_of(s).has_value(); }))
        return PROLATE_BAD_OPTIONS;
    return by_parts<uint32_t>(
        count,
        [&](size_t first, size_t now, std::span<uint32_t> out) {
            Probe probes[kAtOnce];
            for (size_t i = 0; i < now; ++i) probes[i] = *probe_of(shapes[first + i]);
            return overlap(*world->world, {probes, now}, {reinterpret_cast<BodyId*>(ids) + first * most, now * most},
                           out, call.workers, options_of(call.given), mask);
        },
        [&](size_t i, uint32_t number) { found[i] = number; });
}

prolate_status prolate_world_sweep(const prolate_world* world, const prolate_tree* tree, prolate_motion motion,
                                   uint32_t mask, const prolate_workers* workers, const prolate_sweep_options* options,
                                   prolate_body_id* body, prolate_sweep_result* result) {
    const WorldCall call(world, workers, options);
    if (call.status != PROLATE_OK) return call.status;
    const TreeView* const view = view_of(tree);
    if (view == nullptr || body == nullptr || result == nullptr) return PROLATE_BAD_ARGUMENT;
    if (!is_sound(result)) return PROLATE_BAD_STRUCT;
    const MovingTree moving{*view, same<Motion>(motion)};
    SweepHit hit;
    const auto done = sweep(*world->world, {&moving, 1}, {&hit, 1}, call.workers, options_of(call.given), mask);
    if (!done) return status_of(done);
    *body = same<prolate_body_id>(hit.body);
    write(result_of(hit.result), result);
    return PROLATE_OK;
}
