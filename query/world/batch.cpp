// collide() for many pairs of a World. Jobs share them out; each result goes to its own place, so nothing depends on
// who computed it.
#include "query/world/jobs.hpp"
#include "query/world/state.hpp"

namespace prolate {

Result<void> World::collide(std::span<const BodyPair> pairs, std::span<CollideResult> out,
                            std::span<QueryContext> contexts, const Jobs& jobs,
                            const QueryOptions& options) const noexcept {
    const State& s = *state_;
    if (out.size() < pairs.size()) return Error{ErrorCode::bad_options, "each pair needs a result", out.size()};
    if (!query::has_context_each(jobs, contexts)) return query::kTooFewContexts;
    for (size_t i = 0; i < pairs.size(); ++i)
        if (!s.names(pairs[i].a) || !s.names(pairs[i].b))
            return Error{ErrorCode::bad_id, "a body of this pair has been removed", i};
    query::for_ranges(jobs, static_cast<uint32_t>(pairs.size()), query::kQueryGrain,
                      [&](uint32_t begin, uint32_t end, uint32_t worker) {
                          for (uint32_t i = begin; i < end; ++i) {
                              const Body& a = s.entries[pairs[i].a.index].body;
                              const Body& b = s.entries[pairs[i].b.index].body;
                              out[i] = prolate::collide(a.tree, a.pose, b.tree, b.pose, contexts[worker], options);
                          }
                      });
    return {};
}

} // namespace prolate
