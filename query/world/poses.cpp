#include <prolate/poses.hpp>

#include "query/node/limits.hpp"
#include "query/world/jobs.hpp"
#include "query/world/root_bounds.hpp"

#include <algorithm>

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
    const float margin = query::with_radius(query::sound(options).margin, double{a.radius()} + b.radius());
    const query::RootBounds roots = query::root_bounds(a, b, margin);
    const bool may_test = options.max_pair_tests > 0;
    const CollideResult by_roots{.verdict = Verdict::separated, .pair = {}, .stats = {.pair_tests = 1}};
    const auto some = [&](uint32_t first, uint32_t n, uint32_t worker) {
        const uint32_t apart = may_test ? query::roots_apart(roots, poses_a, poses_b, first, n) : 0;
        for (uint32_t i = first; i < first + n; ++i)
            out[i] = take((apart >> (i - first) & 1) != 0
                              ? by_roots
                              : collide(a, at(poses_a, i), b, at(poses_b, i), contexts[worker], options));
    };
    query::for_ranges(jobs, static_cast<uint32_t>(count), query::kQueryGrain,
                      [&](uint32_t begin, uint32_t end, uint32_t worker) {
                          for (uint32_t i = begin; i < end; i += query::kPosesAtOnce)
                              some(i, std::min(query::kPosesAtOnce, end - i), worker);
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
