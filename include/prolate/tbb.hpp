// Jobs on oneTBB, inline, for programs that use it. prolate itself does not link it.
#pragma once

#include <prolate/jobs.hpp>

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

#include <cstddef>

namespace prolate {

/// Jobs that run in `arena`, which must outlive them. Any thread may use them, several at the same time too, provided
/// that each call brings scratch of its own. Throws what arena.max_concurrency() throws if it cannot start the arena.
inline Jobs tbb_jobs(oneapi::tbb::task_arena& arena) {
    const auto run = [](void* user, uint32_t count, uint32_t grain, Jobs::Body body, void* job) {
        static_cast<oneapi::tbb::task_arena*>(user)->execute([&] {
            // Ranges are cut as the scheduler likes. A thread's index is its own while it is in the arena, and body
            // never waits, so that no other call can come between on the same thread.
            oneapi::tbb::parallel_for(oneapi::tbb::blocked_range<uint32_t>(0, count, grain > 0 ? grain : 1),
                                      [&](const oneapi::tbb::blocked_range<uint32_t>& range) {
                                          const int worker = oneapi::tbb::this_task_arena::current_thread_index();
                                          body(job, range.begin(), range.end(), static_cast<uint32_t>(worker));
                                      });
        });
    };
    return {run, &arena, static_cast<uint32_t>(arena.max_concurrency())};
}

} // namespace prolate
