#include <prolate/poses.hpp>

#include "query/world/jobs.hpp"

namespace prolate {

namespace {

template <class Out, class Take>
Result<void> collide_all_poses(const TreeView& a, std::span<const Pose> poses_a, const TreeView& b,
                               std::span<const Pose> poses_b, std::span<Out> out, std::span<QueryContext> contexts,
                               const Jobs& jobs, const QueryOptions& options, Take&& take) {
    const size_t count = poses_a.size() == 1 ? poses_b.size() : poses_a.size();
    if ((poses_b.size() != count && poses_b.size() != 1) || out.size() != count || count > UINT32_MAX)
        return Error{ErrorCode::bad_options, "the numbers of poses and results differ", count};
    if (!query::has_context_each(jobs, contexts)) return query::kTooFewContexts;
    const auto at = [](std::span<const Pose> poses, uint32_t i) -> const Pose& {
        return poses[poses.size() == 1 ? 0 : i];
    };
    query::for_ranges(jobs, static_cast<uint32_t>(count), query::kQueryGrain,
                      [&](uint32_t begin, uint32_t end, uint32_t worker) {
                          for (uint32_t i = begin; i < end; ++i)
                              out[i] = take(collide(a, at(poses_a, i), b, at(poses_b, i), contexts[worker], options));
                      });
    return {};
}

} // namespace

Result<void> collide_poses(const TreeView& a, std::span<const Pose> poses_a, const TreeView& b,
                           std::span<const Pose> poses_b, std::span<CollideResult> out,
                           std::span<QueryContext> contexts, const Jobs& jobs, const QueryOptions& options) noexcept {
    return collide_all_poses(a, poses_a, b, poses_b, out, contexts, jobs, options,
                             [](const CollideResult& r) { return r; });
}

Result<void> collide_poses(const TreeView& a, std::span<const Pose> poses_a, const TreeView& b,
                           std::span<const Pose> poses_b, std::span<Verdict> out, std::span<QueryContext> contexts,
                           const Jobs& jobs, const QueryOptions& options) noexcept {
    return collide_all_poses(a, poses_a, b, poses_b, out, contexts, jobs, options,
                             [](const CollideResult& r) { return r.verdict; });
}

} // namespace prolate
