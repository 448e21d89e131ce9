#include "builder/job.hpp"

namespace prolate {

thread_local Job* Job::current_ = nullptr;

Job::Job(uint32_t threads, std::function<bool()> go_on)
    : arena_(threads ? static_cast<int>(threads) : tbb::task_arena::automatic), go_on_(std::move(go_on)),
      next_((Clock::now() + kInterval).time_since_epoch().count()) {}

void Job::check() {
    if (stopped_.load(std::memory_order_relaxed)) throw Cancelled();
    if (!go_on_) return;
    if (Clock::now().time_since_epoch().count() < next_.load(std::memory_order_relaxed)) return;
    if (const std::unique_lock lock(asking_, std::try_to_lock); lock) ask_locked(); // else another thread is asking
}

void Job::ask() {
    const std::lock_guard lock(asking_);
    ask_locked();
}

void Job::ask_locked() {
    if (stopped_.load(std::memory_order_relaxed)) throw Cancelled();
    if (!go_on_) return;
    const bool go_on = go_on_();
    next_.store((Clock::now() + kInterval).time_since_epoch().count(), std::memory_order_relaxed);
    if (go_on) return;
    stopped_.store(true, std::memory_order_relaxed);
    throw Cancelled();
}

} // namespace prolate
