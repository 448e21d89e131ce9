// One pair of bodies at many poses: for planners that check many configurations at once, and for sampling.
#pragma once

#include <prolate/collide.hpp>
#include <prolate/error.hpp>
#include <prolate/jobs.hpp>

#include <span>

namespace prolate {

/// out[i] = collide() of `a` at poses_a[i] and `b` at poses_b[i], for all i. A span of one pose stands for that pose at
/// all i. Several poses at a time are first told apart by the ellipsoids around the roots, so the counters are not
/// those of collide(), and where that test suffices, the verdict is *separated* though a budget or max_level would have
/// ended the search. The work is shared out among jobs.workers; each worker uses contexts[its number].
///
/// Fails with bad_options if the lengths do not fit: `out` must be as long as the longer span of poses, and `contexts`
/// at least as long as jobs.workers. The results do not depend on the jobs. Thread-safe on shared trees, allocates
/// nothing.
Result<void> collide_poses(const TreeView& a, std::span<const Pose> poses_a, const TreeView& b,
                           std::span<const Pose> poses_b, std::span<CollideResult> out,
                           std::span<QueryContext> contexts, const Jobs& jobs = {},
                           const QueryOptions& options = {}) noexcept;
/// The same, but only the verdicts: one byte a pose.
Result<void> collide_poses(const TreeView& a, std::span<const Pose> poses_a, const TreeView& b,
                           std::span<const Pose> poses_b, std::span<Verdict> out, std::span<QueryContext> contexts,
                           const Jobs& jobs = {}, const QueryOptions& options = {}) noexcept;

} // namespace prolate
