// Two threads write one number, unprotected, in a job on plain threads or on oneTBB's: what ThreadSanitizer has to
// find, or its silence about the rest means nothing.    planted_race plain|tbb
#include "tests/threads.hpp"

#include <prolate/tbb.hpp>

#include <chrono>
#include <cstdio>
#include <cstring>

namespace {

struct Shared {
    std::atomic<uint32_t> inside{0}; // relaxed: puts nothing in order
    uint64_t number = 0;
};

// Waits for the other thread, which may come late or, on a machine of one core, never.
void write_unprotected(void* user, uint32_t, uint32_t, uint32_t) {
    auto& shared = *static_cast<Shared*>(user);
    shared.inside.fetch_add(1, std::memory_order_relaxed);
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
    while (shared.inside.load(std::memory_order_relaxed) < 2 && std::chrono::steady_clock::now() < end) {
    }
    ++shared.number;
}

} // namespace

int main(int argc, char** argv) {
    if (argc != 2) return std::fputs("usage: planted_race plain|tbb\n", stderr), 2;
    oneapi::tbb::task_arena arena(2);
    const prolate::Jobs jobs = std::strcmp(argv[1], "tbb") == 0 ? prolate::tbb_jobs(arena) : prolate::thread_jobs(2);
    Shared shared;
    jobs.run(jobs.user, 2, 1, write_unprotected, &shared);
    std::printf("%llu\n", static_cast<unsigned long long>(shared.number));
    return 0;
}
