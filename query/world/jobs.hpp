// Jobs::run for functions and lambdas.
#pragma once

#include <prolate/jobs.hpp>

#include <cassert>
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

} // namespace prolate::query
