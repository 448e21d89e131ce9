#include "cli/signals.hpp"

#include <algorithm>
#include <atomic>
#include <csignal>
#include <cstdio>

#include <unistd.h>

namespace prolate::cli {
namespace {

std::atomic<int> signal_number{0}, graceful{0};
static_assert(std::atomic<int>::is_always_lock_free, "a signal handler may touch only lock-free atomics");
char last_words[128];
int last_words_length = 0;

extern "C" void on_signal(int number) {
    int none = 0;
    if (graceful.load() > 0 && signal_number.compare_exchange_strong(none, number)) return;
    // The first one says so; if nobody listens, nobody does.
    if (none == 0 && ::write(STDERR_FILENO, last_words, static_cast<size_t>(last_words_length)) < 0)
        last_words_length = 0;
    ::_exit(128 + number);
}

} // namespace

void catch_signals(const char* command) {
    const int length =
        std::snprintf(last_words, sizeof last_words, "prolate: %s: interrupted; nothing was written\n", command);
    last_words_length = std::min(length, static_cast<int>(sizeof last_words) - 1);
    struct sigaction action {};
    action.sa_handler = on_signal;
    action.sa_flags = SA_RESTART;
    for (const int number : {SIGINT, SIGTERM, SIGHUP}) {
        struct sigaction inherited {};
        if (::sigaction(number, nullptr, &inherited) == 0 && inherited.sa_handler != SIG_IGN)
            ::sigaction(number, &action, nullptr);
    }
    // write() says EFBIG and EPIPE instead, so that temporary files are removed and work is not lost.
    ::signal(SIGXFSZ, SIG_IGN);
    ::signal(SIGPIPE, SIG_IGN);
}

int interrupted() noexcept {
    return signal_number.load();
}

GracefulStop::GracefulStop() noexcept {
    graceful.fetch_add(1);
}
GracefulStop::~GracefulStop() {
    graceful.fetch_sub(1);
}

} // namespace prolate::cli
