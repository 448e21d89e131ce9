// Jobs::run for functions and lambdas, and what queries that share out collide() have in common.
#pragma once

#include <prolate/error.hpp>
#include <prolate/jobs.hpp>
#include <prolate/query.hpp>

#include <algorithm>
#include <cassert>
#include <span>
#include <type_traits>

namespace prolate::query {

/// Calls work(begin, end, worker) on ranges that make up 0 ... count - 1.
template <class Work> void for_ranges(const Jobs& jobs, uint32_t count, uint32_t grain, Work&& work) noexcept {
    if (count == 0) return;
    if (!jobs.run || jobs.workers <= 1 || count <= grain) return work(0u, count, 0u);
    struct Job {
        std::remove_reference_t<Work>* work;
        uint32_t count, workers;
    } job{&work, count, jobs.workers};
    jobs.run(
        jobs.user, count, grain,
        [](void* user, uint32_t begin, uint32_t end, uint32_t worker) {
            const Job& j = *static_cast<const Job*>(user);
            assert(begin <= end && end <= j.count && worker < j.workers && "Jobs::run does not do what it must");
            (*j.work)(begin, end, worker);
        },
        &job);
}

inline constexpr uint32_t kQueryGrain = 8; ///< queries in a range: each takes a fraction of a microsecond to some

inline constexpr Error kSpanTooShort{ErrorCode::bad_options, "a span is shorter than what it is for", 0};
inline constexpr Error kTooFewContexts{ErrorCode::bad_options, "each worker needs a context", 0};
inline bool has_context_each(const Jobs& jobs, std::span<const QueryContext> contexts) noexcept {
    return contexts.size() >= std::max(1u, jobs.workers);
}

} // namespace prolate::query
