#include "bench/peers/sweep.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <ctime>
#include <numeric>

namespace prolate::bench::peers {
namespace {

constexpr double kLongQuery = 40'000; // ns
constexpr size_t kFewestSweeps = 5, kMostSweeps = 101;

double thread_ns() {
    timespec now;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return 1e9 * static_cast<double>(now.tv_sec) + static_cast<double>(now.tv_nsec);
}
double steady_ns() {
    return static_cast<double>(std::chrono::nanoseconds(std::chrono::steady_clock::now().time_since_epoch()).count());
}

double quantile(std::vector<double>& values, double share) {
    const auto at = std::min(values.size() - 1, static_cast<size_t>(share * static_cast<double>(values.size())));
    std::ranges::nth_element(values, values.begin() + static_cast<std::ptrdiff_t>(at));
    return values[at];
}

// What two readings of a clock show if nothing happens in between.
template <class Clock> double cost_of(Clock clock) {
    std::vector<double> costs(1001);
    for (double& cost : costs) {
        const double before = clock();
        cost = clock() - before;
    }
    return quantile(costs, 0.5);
}

// One query at all poses, sweep after sweep.
class Sweeps {
public:
    Sweeps(const std::function<void(size_t)>& query, size_t poses, bool batch)
        : query_(query), poses_(poses), batch_(batch), thread_cost_(cost_of(thread_ns)),
          steady_cost_(cost_of(steady_ns)) {
        const double before = thread_ns(); // a first sweep, which also warms up
        for (size_t i = 0; i < poses; ++i) query_(i);
        long_ = thread_ns() - before > kLongQuery * static_cast<double>(poses);
        if (!batch_) times_.resize(poses);
    }
    void sweep() {
        const double before = thread_ns();
        if (batch_)
            for (size_t i = 0; i < poses_; ++i) query_(i);
        else if (long_)
            each(thread_ns, thread_cost_);
        else
            each(steady_ns, steady_cost_);
        const double all = std::max(0.0, thread_ns() - before - thread_cost_);
        totals_.push_back(all / static_cast<double>(poses_));
        spent_ += all;
    }
    double spent() const { return spent_; } // ns
    size_t count() const { return totals_.size(); }

    Timing result() {
        Timing out;
        out.sweeps = totals_.size();
        if (batch_) {
            out.median = quantile(totals_, 0.5), out.p99 = quantile(totals_, 0.99);
            out.mean = std::accumulate(totals_.begin(), totals_.end(), 0.0) / static_cast<double>(out.sweeps);
            return out;
        }
        std::vector<double> poses;
        for (std::vector<double>& pose : times_) poses.push_back(quantile(pose, 0.5));
        out.median = quantile(poses, 0.5), out.p99 = quantile(poses, 0.99);
        out.mean = std::accumulate(poses.begin(), poses.end(), 0.0) / static_cast<double>(poses_);
        return out;
    }

private:
    template <class Clock> void each(Clock clock, double cost) {
        for (size_t i = 0; i < poses_; ++i) {
            const double before = clock();
            query_(i);
            times_[i].push_back(std::max(0.0, clock() - before - cost));
        }
    }

    const std::function<void(size_t)>& query_;
    size_t poses_;
    bool batch_, long_ = false;
    double thread_cost_, steady_cost_, spent_ = 0;
    std::vector<std::vector<double>> times_; // of each pose, ns
    std::vector<double> totals_;             // of each sweep, ns a query
};

} // namespace

std::vector<Timing> time_in_sweeps(std::span<const std::function<void(size_t)>> queries, size_t poses,
                                   const SweepOptions& options) {
    std::vector<Sweeps> all;
    for (const auto& query : queries) all.emplace_back(query, poses, options.batch);
    for (bool more = true; more;) {
        more = false;
        for (Sweeps& one : all) {
            const bool enough = one.count() >= kFewestSweeps && one.spent() >= 1e9 * options.seconds;
            if (enough || one.count() >= kMostSweeps) continue;
            one.sweep();
            more = true;
        }
    }
    std::vector<Timing> out;
    for (Sweeps& one : all) out.push_back(one.result());
    return out;
}

} // namespace prolate::bench::peers
