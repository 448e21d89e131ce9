// Many collide() at once: the pairs of a World, and two trees at many poses. Jobs share them out; each result goes to
// its own place, so nothing depends on who computed it.
#include "query/world/jobs.hpp"
#include "query/world/state.hpp"

#include <algorithm>

namespace prolate {
namespace {

constexpr uint32_t kGrain = 8; // a query takes a fraction of a microsecond to some

constexpr Error kTooFewContexts{ErrorCode::bad_options, "each worker needs a context", 0};

} // namespace

Result<void> World::collide(std::span<const BodyPair> pairs, std::span<CollideResult> out,
                            std::span<QueryContext> contexts, const Jobs& jobs,
                            const QueryOptions& options) const noexcept {
    const State& s = *state_;
    if (out.size() < pairs.size()) return Error{ErrorCode::bad_options, "each pair needs a result", out.size()};
    if (contexts.size() < std::max(1u, jobs.workers)) return kTooFewContexts;
    for (size_t i = 0; i < pairs.size(); ++i)
        if (!s.names(pairs[i].a) || !s.names(pairs[i].b))
            return Error{ErrorCode::bad_id, "a body of this pair has been removed", i};
    query::for_ranges(jobs, static_cast<uint32_t>(pairs.size()), kGrain,
                      [&](uint32_t begin, uint32_t end, uint32_t worker) {
                          for (uint32_t i = begin; i < end; ++i) {
                              const Body& a = s.entries[pairs[i].a.index].body;
                              const Body& b = s.entries[pairs[i].b.index].body;
                              out[i] = prolate::collide(a.tree, a.pose, b.tree, b.pose, contexts[worker], options);
                          }
                      });
    return {};
}

Result<void> collide_poses(const TreeView& a, std::span<const Pose> poses_a, const TreeView& b,
                           std::span<const Pose> poses_b, std::span<CollideResult> out,
                           std::span<QueryContext> contexts, const Jobs& jobs, const QueryOptions& options) noexcept {
    const size_t count = poses_a.size() == 1 ? poses_b.size() : poses_a.size();
    if ((poses_b.size() != count && poses_b.size() != 1) || out.size() != count || count > UINT32_MAX)
        return Error{ErrorCode::bad_options, "the numbers of poses and results differ", count};
    if (contexts.size() < std::max(1u, jobs.workers)) return kTooFewContexts;
    const auto at = [](std::span<const Pose> poses, uint32_t i) -> const Pose& {
        return poses[poses.size() == 1 ? 0 : i];
    };
    query::for_ranges(jobs, static_cast<uint32_t>(count), kGrain, [&](uint32_t begin, uint32_t end, uint32_t worker) {
        for (uint32_t i = begin; i < end; ++i)
            out[i] = collide(a, at(poses_a, i), b, at(poses_b, i), contexts[worker], options);
    });
    return {};
}

} // namespace prolate
