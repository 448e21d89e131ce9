// Jobs on plain threads, for tests: ranges of odd lengths, taken by whoever comes first.
#pragma once

#include <prolate/jobs.hpp>

#include <algorithm>
#include <atomic>
#include <thread>
#include <vector>

namespace prolate {

inline Jobs thread_jobs(uint32_t workers) {
    static constexpr auto run = [](void* user, uint32_t count, uint32_t grain, Jobs::Body body, void* job) {
        std::atomic<uint32_t> next{0};
        const auto work = [&](uint32_t worker) {
            const uint32_t step = std::max(1u, grain / 2 + worker % 3);
            for (;;) {
                const uint32_t begin = next.fetch_add(step);
                if (begin >= count) return;
                body(job, begin, std::min(begin + step, count), worker);
            }
        };
        const auto threads = static_cast<uint32_t>(reinterpret_cast<uintptr_t>(user));
        std::vector<std::jthread> others;
        for (uint32_t worker = 1; worker < threads; ++worker) others.emplace_back(work, worker);
        work(0);
    };
    return {run, reinterpret_cast<void*>(uintptr_t{workers}), workers};
}

} // namespace prolate
