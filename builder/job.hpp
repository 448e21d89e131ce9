// A call that its caller may stop: what it runs asks now and then whether it is to go on.
//
// Whoever works for the call passes through checkpoint(): in loops, at least every few milliseconds. There the caller's
// callback is asked every kInterval, by whichever thread comes by, and once it has said no, every checkpoint throws
// Cancelled: the work unwinds from wherever it is, and nothing half-made is looked at. A thread knows the job that it
// works for by itself; parallel_for() tells the threads that help.
#pragma once

#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>
#include <tbb/task_arena.h>

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <mutex>
#include <utility>

namespace prolate {

/// What checkpoint() throws; Job::run() lets it out.
struct Cancelled {};

class Job {
public:
    static constexpr std::chrono::milliseconds kInterval{50}; ///< between two questions

    /// `go_on` is asked from one thread at a time; empty: nobody asks. `threads`: 0 = all cores.
    Job(uint32_t threads, std::function<bool()> go_on);

    /// Runs `work` in the job's threads.
    template <class Work> auto run(Work&& work) {
        return arena_.execute([&] {
            const Member member(this);
            return work();
        });
    }

    /// For the time of its life, this thread works for `job`, which may be null.
    class Member {
    public:
        explicit Member(Job* job) : before_(std::exchange(current_, job)) {}
        ~Member() { current_ = before_; }
        Member(const Member&) = delete;
        Member& operator=(const Member&) = delete;

    private:
        Job* const before_;
    };
    /// The one that this thread works for; null outside of jobs.
    static Job* current() { return current_; }

    /// Asks whether to go on, unless it was asked less than kInterval ago; throws Cancelled if not.
    void check();
    /// Asks at once.
    void ask();

private:
    using Clock = std::chrono::steady_clock;

    void ask_locked();

    static thread_local Job* current_;
    tbb::task_arena arena_;
    const std::function<bool()> go_on_;
    std::mutex asking_;
    std::atomic<bool> stopped_ = false;
    std::atomic<Clock::rep> next_;
};

/// Throws Cancelled if the job is to stop. Costs some 30 ns.
inline void checkpoint() {
    if (Job* const job = Job::current()) job->check();
}

/// In loops whose turns take less than a microsecond.
class Checkpoints {
public:
    void operator()() {
        if (++turn_ % kTurns == 0) checkpoint();
    }

private:
    static constexpr uint32_t kTurns = 64;
    uint32_t turn_ = 0;
};

/// tbb::parallel_for over first ... last - 1, with a checkpoint before each call of body(index).
template <class Index, class Body> void parallel_for(Index first, Index last, const Body& body) {
    Job* const job = Job::current();
    tbb::parallel_for(first, last, [&, job](Index i) {
        const Job::Member member(job);
        checkpoint();
        body(i);
    });
}

/// tbb::parallel_invoke in the same way.
template <class F, class G> void parallel_invoke(const F& f, const G& g) {
    Job* const job = Job::current();
    const auto as_member = [job](const auto& work) {
        return [&work, job] {
            const Job::Member member(job);
            checkpoint();
            work();
        };
    };
    tbb::parallel_invoke(as_member(f), as_member(g));
}

} // namespace prolate
