// How calls that work on many things at once borrow the host's threads. The library starts none of its own.
#pragma once

#include <cstdint>

namespace prolate {

/// The host's scheduler, as the functions that take it see it. A default one works serially, on the calling thread.
///
/// What run(user, count, grain, body, job) must do: cut 0 ... count - 1 into ranges, call body(job, begin, end, worker)
/// once for each, and return when all calls have returned. Ranges may go to any threads in any order, the calling one
/// included. `worker` < `workers` names who works, to find its scratch: two calls at the same time must not have the
/// same. `grain` is a hint: shorter ranges are not worth their overhead. body never throws and never waits.
///
/// prolate/tbb.hpp has one for oneTBB. The results of no function depend on how the ranges are cut or who works on
/// them, nor does the order of results.
struct Jobs {
    using Body = void (*)(void* job, uint32_t begin, uint32_t end, uint32_t worker);

    void (*run)(void* user, uint32_t count, uint32_t grain, Body body, void* job) = nullptr; ///< null: serial
    void* user = nullptr;                                                                    ///< handed to run
    uint32_t workers = 1; ///< how many may work at the same time, at least 1
};

} // namespace prolate
