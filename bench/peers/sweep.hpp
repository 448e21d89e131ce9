// Times queries pose by pose, in sweeps over all poses.
//
// Why so: a query repeated on the spot trains the branch predictor and the caches on its pose, and comes out up to
// twice too fast. So each pose is visited once a sweep, after hundreds of others. All libraries of a comparison take
// turns, sweep by sweep, so that a change of the machine's speed hits them alike: ratios hold on a busy machine.
//
// Which clock? CLOCK_THREAD_CPUTIME_ID does not count the time of others, but is a system call: 0.2 to 1 us, far too
// coarse for one short query. The monotonic clock costs 20 to 30 ns, but goes on while others run. Hence
//  - queries of more than kLongQuery on average: the thread's CPU time of each;
//  - shorter ones: the monotonic clock around each. Somebody else gets the processor for milliseconds at a time, so a
//    query of microseconds is hit once in hundreds, and a pose's time is its median over at least 5 sweeps: that a pose
//    is hit in 3 of 5 is out of the question;
//  - `batch`, for poses that take a fraction of a microsecond each: the thread's CPU time of a whole sweep, divided by
//    the poses. There is one number for all poses then.
// What reading the clock costs is measured in the same way and subtracted. Mean and 99th percentile are those of the
// poses' medians: how much poses differ, not how much the machine is disturbed.
#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <vector>

namespace prolate::bench::peers {

/// Of one query, in nanoseconds.
struct Timing {
    double median = 0, mean = 0, p99 = 0;
    size_t sweeps = 0;
};

struct SweepOptions {
    bool batch = false;
    double seconds = 0.5; ///< of CPU time for each of the queries, at least; 5 sweeps at least, 101 at most
};

/// Times `queries` in turns, each at 0 ... `poses` - 1.
std::vector<Timing> time_in_sweeps(std::span<const std::function<void(size_t)>> queries, size_t poses,
                                   const SweepOptions& options);

} // namespace prolate::bench::peers
