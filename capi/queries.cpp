// Queries of the C interface: each checks what it is given, and calls the one of C++.
#include "capi/handles.hpp"

#include <prolate/bounds.hpp>
#include <prolate/collide.hpp>
#include <prolate/contacts.hpp>
#include <prolate/deform.hpp>
#include <prolate/distance.hpp>
#include <prolate/half_space.hpp>
#include <prolate/points.hpp>
#include <prolate/prolate.h>
#include <prolate/raycast.hpp>
#include <prolate/shapes.hpp>
#include <prolate/solids.hpp>
#include <prolate/sweep.hpp>

using namespace prolate;
using namespace prolate::capi;

namespace {

// What every query of one or two bodies takes, checked.
class Call {
public:
    template <class Options, class Result>
    Call(std::initializer_list<const prolate_tree*> trees, void* memory, size_t size, const Options* given,
         Options& options, const Result* result)
        : scratch(scratch_of(memory, size)) {
        if (result == nullptr) status = PROLATE_BAD_ARGUMENT;
        for (const prolate_tree* tree : trees) {
            views_[count_] = view_of(tree);
            if (views_[count_++] == nullptr) status = PROLATE_BAD_ARGUMENT;
        }
        if (status != PROLATE_OK) return;
        if (memory == nullptr || size < (count_ == 2 ? scratch_size(a(), b()) : scratch_size(a())))
            status = PROLATE_BAD_ARGUMENT;
        else if (!read(given, options) || !is_sound(result))
            status = PROLATE_BAD_STRUCT;
    }
    const TreeView& a() const { return *views_[0]; }
    const TreeView& b() const { return *views_[1]; }

    prolate_status status = PROLATE_OK;
    const Scratch scratch;

private:
    const TreeView* views_[2] = {};
    size_t count_ = 0;
};

prolate_collide_result result_of(const CollideResult& r) {
    auto out = fresh<prolate_collide_result>();
    out.verdict = verdict_of(r.verdict), out.enclosed = r.enclosed;
    out.pair = same<prolate_meeting_pair>(r.pair), out.stats = stats_of(r.stats);
    return out;
}

prolate_distance_result result_of(const DistanceResult& r) {
    auto out = fresh<prolate_distance_result>();
    out.verdict = verdict_of(r.verdict), out.enclosed = r.enclosed, out.lower = r.lower, out.upper = r.upper;
    out.point_a = same<prolate_vec3>(r.point_a), out.point_b = same<prolate_vec3>(r.point_b);
    out.normal = same<prolate_vec3>(r.normal);
    out.pair = same<prolate_meeting_pair>(r.pair), out.stats = stats_of(r.stats);
    return out;
}

prolate_raycast_result result_of(const RaycastResult& r) {
    auto out = fresh<prolate_raycast_result>();
    out.verdict = verdict_of(r.verdict), out.t = r.t, out.clear = r.clear;
    out.point = same<prolate_vec3>(r.point), out.normal = same<prolate_vec3>(r.normal);
    out.node = r.node, out.triangle = r.triangle, out.stats = stats_of(r.stats);
    return out;
}

bool has_coordinates(const prolate_deformed_body& body) {
    return (body.q != nullptr || body.q_count == 0) && (body.bones != nullptr || body.bone_count == 0);
}
static_assert(sizeof(BoneMatrix) == 12 * sizeof(float));
DeformedBody deformed(const TreeView& tree, const prolate_deformed_body& body) {
    return {tree,
            same<Pose>(body.body.pose),
            {body.q, body.q_count},
            {reinterpret_cast<const BoneMatrix*>(body.bones), body.bone_count}};
}
void write_reason(Undecided reason, prolate_undecided* to) {
    if (to != nullptr) *to = static_cast<prolate_undecided>(reason);
}

prolate_contact_result result_of(const ContactResult& r) {
    auto out = fresh<prolate_contact_result>();
    out.verdict = verdict_of(r.verdict), out.enclosed = r.enclosed, out.found = r.found, out.stats = stats_of(r.stats);
    return out;
}

// Manifolds are laid out alike, so they are worked on where they are.
static_assert(sizeof(prolate_manifolds) == sizeof(ContactManifolds) &&
              offsetof(prolate_manifold, points) == offsetof(Manifold, points) &&
              offsetof(prolate_contact_point, id) == offsetof(ContactPoint, id) &&
              offsetof(prolate_contact_point, impulse) == offsetof(ContactPoint, impulse));
template <class Query> auto with_manifolds(prolate_manifolds* manifolds, Query&& query) {
    ContactManifolds own;
    std::memcpy(static_cast<void*>(&own), manifolds, sizeof own);
    const auto out = query(own);
    std::memcpy(static_cast<void*>(manifolds), &own, sizeof own);
    return out;
}

bool sound_points(prolate_body body, const prolate_vec3* points, size_t count, const void* out) {
    return view_of(body.tree) != nullptr && (count == 0 || (points != nullptr && out != nullptr));
}

bool enough(const void* memory, size_t size, const prolate_tree* tree) {
    return memory != nullptr && size >= scratch_size(*view_of(tree));
}

Box box_of(const prolate_shape& s) {
    return {{same<Vec3>(s.a), same<Quat>(s.rotation)}, same<Vec3>(s.half)};
}

} // namespace

prolate_status prolate_collide(prolate_body a, prolate_body b, void* scratch, size_t scratch_size,
                               const prolate_query_options* options, prolate_pair_cache* cache,
                               prolate_collide_result* result) {
    auto given = fresh<prolate_query_options>();
    const Call call({a.tree, b.tree}, scratch, scratch_size, options, given, result);
    if (call.status != PROLATE_OK) return call.status;
    static_assert(sizeof(PairCache) == sizeof cache->opaque);
    PairCache own;
    if (cache != nullptr && cache->used == 1) std::memcpy(static_cast<void*>(&own), cache->opaque, sizeof own);
    const CollideResult r = collide(call.a(), same<Pose>(a.pose), call.b(), same<Pose>(b.pose), call.scratch,
                                    capi::options_of(given), cache != nullptr ? &own : nullptr);
    if (cache != nullptr) std::memcpy(cache->opaque, &own, sizeof own), cache->used = 1;
    write(result_of(r), result);
    return PROLATE_OK;
}

prolate_status prolate_collide_all(prolate_body a, prolate_body b, prolate_meeting_pair* pairs, size_t capacity,
                                   void* scratch, size_t scratch_size, const prolate_query_options* options,
                                   prolate_collide_all_result* result) {
    auto given = fresh<prolate_query_options>();
    const Call call({a.tree, b.tree}, scratch, scratch_size, options, given, result);
    if (call.status != PROLATE_OK) return call.status;
    if (pairs == nullptr && capacity > 0) return PROLATE_BAD_ARGUMENT;
    static_assert(sizeof(MeetingPair) == sizeof(prolate_meeting_pair));
    const CollideAllResult r =
        collide_all(call.a(), same<Pose>(a.pose), call.b(), same<Pose>(b.pose),
                    {reinterpret_cast<MeetingPair*>(pairs), capacity}, call.scratch, capi::options_of(given));
    auto out = fresh<prolate_collide_all_result>();
    out.verdict = verdict_of(r.verdict), out.enclosed = r.enclosed, out.found = r.found, out.stats = stats_of(r.stats);
    write(out, result);
    return PROLATE_OK;
}

prolate_status prolate_distance(prolate_body a, prolate_body b, void* scratch, size_t scratch_size,
                                const prolate_distance_options* options, prolate_distance_result* result) {
    auto given = fresh<prolate_distance_options>();
    const Call call({a.tree, b.tree}, scratch, scratch_size, options, given, result);
    if (call.status != PROLATE_OK) return call.status;
    write(result_of(distance(call.a(), same<Pose>(a.pose), call.b(), same<Pose>(b.pose), call.scratch,
                             capi::options_of(given))),
          result);
    return PROLATE_OK;
}

prolate_status prolate_collide_solids(prolate_body a, prolate_body b, void* scratch, size_t scratch_size,
                                      const prolate_query_options* options, prolate_solids_result* result) {
    auto given = fresh<prolate_query_options>();
    const Call call({a.tree, b.tree}, scratch, scratch_size, options, given, result);
    if (call.status != PROLATE_OK) return call.status;
    const QueryOptions limits = capi::options_of(given);
    const SolidsResult r =
        collide(Solid(call.a(), limits.max_level), same<Pose>(a.pose), Solid(call.b(), limits.max_level),
                same<Pose>(b.pose), call.scratch, {.max_pair_tests = limits.max_pair_tests, .margin = limits.margin});
    auto out = fresh<prolate_solids_result>();
    out.verdict = verdict_of(r.verdict), out.out_of_budget = r.out_of_budget, out.stats = stats_of(r.stats);
    write(out, result);
    return PROLATE_OK;
}

prolate_status prolate_distance_solids(prolate_body a, prolate_body b, void* scratch, size_t scratch_size,
                                       const prolate_distance_options* options, prolate_solids_distance* result) {
    auto given = fresh<prolate_distance_options>();
    const Call call({a.tree, b.tree}, scratch, scratch_size, options, given, result);
    if (call.status != PROLATE_OK) return call.status;
    const SolidsDistance r = distance(Solid(call.a()), same<Pose>(a.pose), Solid(call.b()), same<Pose>(b.pose),
                                      call.scratch, capi::options_of(given));
    auto out = fresh<prolate_solids_distance>();
    out.verdict = verdict_of(r.verdict), out.lower = r.lower, out.upper = r.upper, out.stats = stats_of(r.stats);
    out.point_a = same<prolate_vec3>(r.point_a), out.point_b = same<prolate_vec3>(r.point_b);
    write(out, result);
    return PROLATE_OK;
}

uint32_t prolate_mode_count(const prolate_tree* tree) {
    const TreeView* const view = view_of(tree);
    const auto modes = view != nullptr ? view->deformation() : std::nullopt;
    return modes ? modes->mode_count() : 0;
}

float prolate_mode_range(const prolate_tree* tree, uint32_t mode) {
    return mode < prolate_mode_count(tree) ? view_of(tree)->deformation()->range(mode) : 0;
}

uint32_t prolate_bone_count(const prolate_tree* tree) {
    const TreeView* const view = view_of(tree);
    const auto skin = view != nullptr ? view->skin() : std::nullopt;
    return skin ? skin->bone_count() : 0;
}

prolate_status prolate_collide_deformed(prolate_deformed_body a, prolate_deformed_body b, void* scratch,
                                        size_t scratch_size, const prolate_query_options* options,
                                        prolate_collide_result* result, prolate_undecided* reason) {
    auto given = fresh<prolate_query_options>();
    const Call call({a.body.tree, b.body.tree}, scratch, scratch_size, options, given, result);
    if (call.status != PROLATE_OK) return call.status;
    if (!has_coordinates(a) || !has_coordinates(b)) return PROLATE_BAD_ARGUMENT;
    const DeformedCollideResult r =
        collide(deformed(call.a(), a), deformed(call.b(), b), call.scratch, capi::options_of(given));
    write(result_of(r), result);
    write_reason(r.reason, reason);
    return PROLATE_OK;
}

prolate_status prolate_distance_deformed(prolate_deformed_body a, prolate_deformed_body b, void* scratch,
                                         size_t scratch_size, const prolate_distance_options* options,
                                         prolate_distance_result* result, prolate_undecided* reason) {
    auto given = fresh<prolate_distance_options>();
    const Call call({a.body.tree, b.body.tree}, scratch, scratch_size, options, given, result);
    if (call.status != PROLATE_OK) return call.status;
    if (!has_coordinates(a) || !has_coordinates(b)) return PROLATE_BAD_ARGUMENT;
    const DeformedDistanceResult r =
        distance(deformed(call.a(), a), deformed(call.b(), b), call.scratch, capi::options_of(given));
    write(result_of(r), result);
    write_reason(r.reason, reason);
    return PROLATE_OK;
}

prolate_status prolate_raycast_deformed(prolate_deformed_body body, prolate_ray ray, void* scratch, size_t scratch_size,
                                        const prolate_query_options* options, prolate_raycast_result* result,
                                        prolate_undecided* reason) {
    auto given = fresh<prolate_query_options>();
    const Call call({body.body.tree}, scratch, scratch_size, options, given, result);
    if (call.status != PROLATE_OK) return call.status;
    if (!has_coordinates(body)) return PROLATE_BAD_ARGUMENT;
    const DeformedRaycastResult r =
        raycast(deformed(call.a(), body), same<Ray>(ray), call.scratch, capi::options_of(given));
    write(result_of(r), result);
    write_reason(r.reason, reason);
    return PROLATE_OK;
}

prolate_status prolate_contacts(prolate_body a, prolate_body b, prolate_manifolds* manifolds, void* scratch,
                                size_t scratch_size, const prolate_query_options* options,
                                prolate_contact_result* result) {
    auto given = fresh<prolate_query_options>();
    const Call call({a.tree, b.tree}, scratch, scratch_size, options, given, result);
    if (call.status != PROLATE_OK) return call.status;
    if (manifolds == nullptr) return PROLATE_BAD_ARGUMENT;
    const ContactResult r = with_manifolds(manifolds, [&](ContactManifolds& own) {
        return contacts(call.a(), same<Pose>(a.pose), call.b(), same<Pose>(b.pose), own, call.scratch,
                        capi::options_of(given));
    });
    write(result_of(r), result);
    return PROLATE_OK;
}

prolate_status prolate_contacts_solids(prolate_body a, prolate_body b, prolate_manifolds* manifolds, void* scratch,
                                       size_t scratch_size, const prolate_query_options* options,
                                       prolate_solids_contacts* result) {
    auto given = fresh<prolate_query_options>();
    const Call call({a.tree, b.tree}, scratch, scratch_size, options, given, result);
    if (call.status != PROLATE_OK) return call.status;
    if (manifolds == nullptr) return PROLATE_BAD_ARGUMENT;
    const QueryOptions limits = capi::options_of(given);
    const SolidsContacts r = with_manifolds(manifolds, [&](ContactManifolds& own) {
        return contacts(Solid(call.a(), limits.max_level), same<Pose>(a.pose), Solid(call.b(), limits.max_level),
                        same<Pose>(b.pose), own, call.scratch,
                        {.max_pair_tests = limits.max_pair_tests, .margin = limits.margin});
    });
    auto out = fresh<prolate_solids_contacts>();
    out.verdict = verdict_of(r.verdict), out.depth_lower = r.depth_lower, out.depth_upper = r.depth_upper;
    out.way_out = same<prolate_vec3>(r.way_out), out.found = r.found, out.stats = stats_of(r.stats);
    write(out, result);
    return PROLATE_OK;
}

prolate_status prolate_sweep(const prolate_tree* a, prolate_motion motion_a, const prolate_tree* b,
                             prolate_motion motion_b, void* scratch, size_t scratch_size,
                             const prolate_sweep_options* options, prolate_sweep_result* result) {
    auto given = fresh<prolate_sweep_options>();
    const Call call({a, b}, scratch, scratch_size, options, given, result);
    if (call.status != PROLATE_OK) return call.status;
    const SweepResult r = sweep(call.a(), same<Motion>(motion_a), call.b(), same<Motion>(motion_b), call.scratch,
                                capi::options_of(given));
    write(capi::result_of(r), result);
    return PROLATE_OK;
}

prolate_status prolate_raycast(prolate_body body, prolate_ray ray, void* scratch, size_t scratch_size,
                               const prolate_query_options* options, prolate_raycast_result* result) {
    auto given = fresh<prolate_query_options>();
    const Call call({body.tree}, scratch, scratch_size, options, given, result);
    if (call.status != PROLATE_OK) return call.status;
    const RaycastResult r =
        raycast(call.a(), same<Pose>(body.pose), same<Ray>(ray), call.scratch, capi::options_of(given));
    write(result_of(r), result);
    return PROLATE_OK;
}

prolate_status prolate_raycasts(prolate_body body, const prolate_ray* rays, size_t count, void* scratch,
                                size_t scratch_size, const prolate_query_options* options, prolate_tree_hit* hits) {
    auto given = fresh<prolate_query_options>();
    if (view_of(body.tree) == nullptr || !enough(scratch, scratch_size, body.tree)) return PROLATE_BAD_ARGUMENT;
    if (!read(options, given)) return PROLATE_BAD_STRUCT;
    if (count > 0 && (rays == nullptr || hits == nullptr)) return PROLATE_BAD_ARGUMENT;
    constexpr size_t kAtOnce = 16; // on the stack
    RaycastResult some[kAtOnce];
    for (size_t i = 0; i < count; i += kAtOnce) {
        const size_t now = std::min(kAtOnce, count - i);
        raycast(*view_of(body.tree), same<Pose>(body.pose), {reinterpret_cast<const Ray*>(rays) + i, now}, {some, now},
                scratch_of(scratch, scratch_size), capi::options_of(given));
        for (size_t k = 0; k < now; ++k)
            hits[i + k] = {
                verdict_of(some[k].verdict),        some[k].t,    some[k].clear,   same<prolate_vec3>(some[k].point),
                same<prolate_vec3>(some[k].normal), some[k].node, some[k].triangle};
    }
    return PROLATE_OK;
}

prolate_status prolate_overlap(prolate_body body, const prolate_shape* shape, void* scratch, size_t scratch_size,
                               const prolate_query_options* options, prolate_overlap_result* result) {
    auto given = fresh<prolate_query_options>();
    const Call call({body.tree}, scratch, scratch_size, options, given, result);
    if (call.status != PROLATE_OK) return call.status;
    if (shape == nullptr) return PROLATE_BAD_ARGUMENT;
    const auto with = [&](const auto& s) {
        return overlap(call.a(), same<Pose>(body.pose), s, call.scratch, capi::options_of(given));
    };
    OverlapResult r;
    switch (shape->kind) {
    case PROLATE_SPHERE:
        r = with(Sphere{same<Vec3>(shape->a), shape->radius});
        break;
    case PROLATE_CAPSULE:
        r = with(Capsule{same<Vec3>(shape->a), same<Vec3>(shape->b), shape->radius});
        break;
    case PROLATE_BOX:
        r = with(box_of(*shape));
        break;
    case PROLATE_HALF_SPACE:
        r = with(HalfSpace{same<Vec3>(shape->a), shape->radius});
        break;
    default:
        return PROLATE_BAD_OPTIONS;
    }
    auto out = fresh<prolate_overlap_result>();
    out.verdict = verdict_of(r.verdict), out.enclosed = r.enclosed, out.node = r.node, out.triangle = r.triangle;
    out.stats = stats_of(r.stats);
    write(out, result);
    return PROLATE_OK;
}

prolate_status prolate_half_space_distance(prolate_body body, prolate_half_space half_space, void* scratch,
                                           size_t scratch_size, const prolate_distance_options* options,
                                           prolate_distance_result* result) {
    auto given = fresh<prolate_distance_options>();
    const Call call({body.tree}, scratch, scratch_size, options, given, result);
    if (call.status != PROLATE_OK) return call.status;
    write(result_of(distance(call.a(), same<Pose>(body.pose), same<HalfSpace>(half_space), call.scratch,
                             capi::options_of(given))),
          result);
    return PROLATE_OK;
}

prolate_status prolate_half_space_contacts(prolate_body body, prolate_half_space half_space,
                                           prolate_manifolds* manifolds, void* scratch, size_t scratch_size,
                                           const prolate_query_options* options, prolate_contact_result* result) {
    auto given = fresh<prolate_query_options>();
    const Call call({body.tree}, scratch, scratch_size, options, given, result);
    if (call.status != PROLATE_OK) return call.status;
    if (manifolds == nullptr) return PROLATE_BAD_ARGUMENT;
    const ContactResult r = with_manifolds(manifolds, [&](ContactManifolds& own) {
        return contacts(call.a(), same<Pose>(body.pose), same<HalfSpace>(half_space), own, call.scratch,
                        capi::options_of(given));
    });
    write(result_of(r), result);
    return PROLATE_OK;
}

prolate_status prolate_half_space_sweep(const prolate_tree* tree, prolate_motion motion, prolate_half_space half_space,
                                        void* scratch, size_t scratch_size, const prolate_sweep_options* options,
                                        prolate_sweep_result* result) {
    auto given = fresh<prolate_sweep_options>();
    const Call call({tree}, scratch, scratch_size, options, given, result);
    if (call.status != PROLATE_OK) return call.status;
    write(capi::result_of(sweep(call.a(), same<Motion>(motion), same<HalfSpace>(half_space), call.scratch,
                                capi::options_of(given))),
          result);
    return PROLATE_OK;
}

prolate_status prolate_signed_distances(prolate_body body, const prolate_vec3* points, size_t count,
                                        double max_distance, void* scratch, size_t scratch_size,
                                        prolate_signed_distance* results) {
    if (!sound_points(body, points, count, results) || !enough(scratch, scratch_size, body.tree))
        return PROLATE_BAD_ARGUMENT;
    PointOptions options;
    if (max_distance != 0) options.max_distance = max_distance;
    constexpr size_t kAtOnce = 32; // points of one batch follow each other closely
    SignedDistance some[kAtOnce];
    for (size_t i = 0; i < count; i += kAtOnce) {
        const size_t now = std::min(kAtOnce, count - i);
        signed_distance(*view_of(body.tree), same<Pose>(body.pose), {reinterpret_cast<const Vec3*>(points) + i, now},
                        {some, now}, scratch_of(scratch, scratch_size), options);
        for (size_t k = 0; k < now; ++k)
            results[i + k] = {some[k].lower,
                              some[k].upper,
                              same<prolate_vec3>(some[k].point),
                              same<prolate_vec3>(some[k].gradient),
                              some[k].node,
                              some[k].triangle,
                              verdict_of(some[k].verdict)};
    }
    return PROLATE_OK;
}

prolate_status prolate_contains(prolate_body body, const prolate_vec3* points, size_t count, void* scratch,
                                size_t scratch_size, prolate_verdict* sides) {
    if (!sound_points(body, points, count, sides) || !enough(scratch, scratch_size, body.tree))
        return PROLATE_BAD_ARGUMENT;
    static_assert(sizeof(Verdict) == sizeof *sides);
    contains(*view_of(body.tree), same<Pose>(body.pose), {reinterpret_cast<const Vec3*>(points), count},
             {reinterpret_cast<Verdict*>(sides), count}, scratch_of(scratch, scratch_size));
    return PROLATE_OK;
}

prolate_status prolate_bounds(prolate_body body, float margin, prolate_box3* box) {
    const TreeView* const view = view_of(body.tree);
    if (view == nullptr || box == nullptr) return PROLATE_BAD_ARGUMENT;
    *box = same<prolate_box3>(bounds(*view, same<Pose>(body.pose), margin));
    return PROLATE_OK;
}

prolate_status prolate_bounds_deformed(prolate_deformed_body body, float margin, prolate_box3* box) {
    const TreeView* const view = view_of(body.body.tree);
    if (view == nullptr || box == nullptr || !has_coordinates(body)) return PROLATE_BAD_ARGUMENT;
    *box = same<prolate_box3>(bounds(deformed(*view, body), margin));
    return PROLATE_OK;
}
