#include "cli/threads.hpp"

#include "cli/console.hpp"

#include <fmt/format.h>

#include <latch>
#include <system_error>
#include <thread>
#include <vector>

#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/info.h>

namespace prolate::cli {
namespace {

// This thread, and as many as can be started beside it at once, up to the number that parallel work would use.
size_t count_threads() {
    const auto wanted = static_cast<size_t>(tbb::info::default_concurrency());
    std::latch counted(1);
    std::vector<std::jthread> started;
    try {
        while (started.size() + 1 < wanted) started.emplace_back([&counted] { counted.wait(); });
    } catch (const std::system_error&) {
        note("threads",
             fmt::format("the system gives {} instead of {}: the work takes longer", started.size() + 1, wanted));
    }
    const size_t count = started.size() + 1;
    counted.count_down();
    return count;
}

} // namespace

void use_available_threads() {
    // It stays to the end: when it goes, oneTBB at once starts the threads that were held back.
    static const auto* const limit =
        new tbb::global_control(tbb::global_control::max_allowed_parallelism, count_threads());
    static_cast<void>(limit);
}

} // namespace prolate::cli
