// Two single ellipsoids, and two bodies at many poses, of the C interface.
#include "capi/handles.hpp"

#include <prolate/pairs.hpp>
#include <prolate/poses.hpp>
#include <prolate/prolate.h>

using namespace prolate;
using namespace prolate::capi;

prolate_status prolate_pair_collide(const prolate_ellipsoid* a, prolate_pose pose_a, const prolate_ellipsoid* b,
                                    prolate_pose pose_b, float margin, prolate_verdict* verdict) {
    if (a == nullptr || b == nullptr || verdict == nullptr) return PROLATE_BAD_ARGUMENT;
    *verdict =
        verdict_of(collide(same<Ellipsoid>(*a), same<Pose>(pose_a), same<Ellipsoid>(*b), same<Pose>(pose_b), margin));
    return PROLATE_OK;
}

prolate_status prolate_pair_distance_of(const prolate_ellipsoid* a, prolate_pose pose_a, const prolate_ellipsoid* b,
                                        prolate_pose pose_b, float tolerance, prolate_pair_distance* out) {
    if (a == nullptr || b == nullptr || out == nullptr) return PROLATE_BAD_ARGUMENT;
    *out = same<prolate_pair_distance>(
        distance(same<Ellipsoid>(*a), same<Pose>(pose_a), same<Ellipsoid>(*b), same<Pose>(pose_b), tolerance));
    return PROLATE_OK;
}

prolate_status prolate_collide_poses(const prolate_tree* a, const prolate_pose* poses_a, size_t count_a,
                                     const prolate_tree* b, const prolate_pose* poses_b, size_t count_b,
                                     const prolate_jobs* given_jobs, void* scratch, size_t size,
                                     const prolate_query_options* options, prolate_verdict* verdicts) {
    const TreeView *const x = view_of(a), *const y = view_of(b);
    const Jobs jobs = jobs_of(given_jobs);
    QueryContext* const contexts = contexts_of(scratch, size, jobs.workers);
    auto given = fresh<prolate_query_options>();
    if (x == nullptr || y == nullptr || contexts == nullptr || (poses_a == nullptr && count_a > 0) ||
        (poses_b == nullptr && count_b > 0) || (verdicts == nullptr && count_a > 0 && count_b > 0))
        return PROLATE_BAD_ARGUMENT;
    if (!read(options, given)) return PROLATE_BAD_STRUCT;
    static_assert(sizeof(Pose) == sizeof(prolate_pose) && sizeof(Verdict) == sizeof(prolate_verdict));
    const size_t count = count_a == 1 ? count_b : count_a;
    return status_of(collide_poses(
        *x, {reinterpret_cast<const Pose*>(poses_a), count_a}, *y, {reinterpret_cast<const Pose*>(poses_b), count_b},
        std::span(reinterpret_cast<Verdict*>(verdicts), count), {contexts, jobs.workers}, jobs, options_of(given)));
}
