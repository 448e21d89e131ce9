// How calls that work on many things at once borrow the host's threads. The library starts none of its own.
#pragma once

#include <cstdint>

namespace prolate {

/// The host's scheduler. Jobs{} works serially, on the calling thread; tbb.hpp has one for oneTBB.
///
/// run(user, count, grain, body, job) must cut 0 ... count - 1 into ranges, call body(job, begin, end, worker) once for
/// each, and return when all calls have returned. The ranges may go to any threads in any order, the calling thread
/// included. `worker` < `workers` selects the scratch that a call uses, so two concurrent calls must have different
/// ones. `grain` is a hint: shorter ranges are not worth their overhead. body never throws and never waits.
///
/// No result, and no order of results, depends on how the ranges are cut or who works on them.
struct Jobs {
    using Body = void (*)(void* job, uint32_t begin, uint32_t end, uint32_t worker);

    void (*run)(void* user, uint32_t count, uint32_t grain, Body body, void* job) = nullptr; ///< null: serial
    void* user = nullptr;                                                                    ///< handed to run
    uint32_t workers = 1; ///< how many calls of body may run at the same time, at least 1
};

} // namespace prolate
