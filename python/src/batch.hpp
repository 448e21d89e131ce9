// N queries on some threads, without the interpreter's lock. Ctrl-C is looked for some ten times a second.
#pragma once

#include "python/src/arrays.hpp"

#include <prolate/query.hpp>

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/info.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <optional>

namespace prolate::python {

/// Scratch of queries on this thread.
inline QueryContext& thread_context() {
    thread_local const std::unique_ptr<QueryContext> context(new QueryContext);
    return *context;
}

/// 0 = all cores; a ValueError beyond 1024.
inline int thread_count(nb::handle threads) {
    const auto count = static_cast<int>(whole(threads, "threads", 0, 1024));
    return count == 0 ? oneapi::tbb::info::default_concurrency() : count;
}

/// Calls work(begin, end, context) for ranges that make up 0 ... count - 1; in any order, if there are several threads.
/// Holds the interpreter's lock before and after, and not in between. Throws what a signal handler raises; what was not
/// done then stays undone.
template <class Work> void for_ranges(size_t count, int threads, const Work& work) {
    using Clock = std::chrono::steady_clock;
    using namespace std::chrono_literals;
    std::optional<nb::gil_scoped_release> released(std::in_place);
    std::optional<oneapi::tbb::task_arena> arena;
    if (threads > 1 && count > 1) arena.emplace(threads);
    size_t slice = arena ? 4096 : 256;
    for (size_t begin = 0; begin < count;) {
        const size_t end = std::min(count, begin + slice);
        const auto start = Clock::now();
        if (arena)
            arena->execute([&] {
                oneapi::tbb::parallel_for(oneapi::tbb::blocked_range<size_t>(begin, end, 16), [&](const auto& range) {
                    work(range.begin(), range.end(), thread_context());
                });
            });
        else
            work(begin, end, thread_context());
        begin = end;
        const auto took = Clock::now() - start;
        if (took < 50ms) slice *= 2;
        if (took > 100ms) slice = std::max<size_t>(slice / 2, 1);
        if (took < 20ms || begin == count) continue;
        released.reset();
        if (PyErr_CheckSignals() != 0) throw nb::python_error();
        released.emplace();
    }
}

/// Calls query(i, context) for all i < count, as for_ranges() does.
template <class Query> void for_all(size_t count, int threads, const Query& query) {
    for_ranges(count, threads, [&query](size_t begin, size_t end, QueryContext& context) {
        for (size_t i = begin; i < end; ++i) query(i, context);
    });
}

} // namespace prolate::python
