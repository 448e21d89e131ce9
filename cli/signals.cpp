#include "cli/signals.hpp"

#include "cli/failure.hpp"

#include <fmt/format.h>

#include <atomic>
#include <csignal>
#include <iterator>
#include <string>

#include <unistd.h>

namespace prolate::cli {
namespace {

constexpr int kSignals[] = {SIGINT, SIGTERM, SIGHUP};

std::atomic<int> signal_number{0}, graceful{0}, json_file{-1};
static_assert(std::atomic<int>::is_always_lock_free, "a signal handler may touch only lock-free atomics");

// What the handler says, as text and as JSON, by signal: made before it may run, and never destroyed.
struct LastWords {
    std::string line, json[std::size(kSignals)];
};
const LastWords* last_words = nullptr;

void write_all(int file, const std::string& text) {
    for (size_t done = 0; done < text.size();) {
        const ssize_t n = ::write(file, text.data() + done, text.size() - done);
        if (n <= 0) return; // nobody listens
        done += static_cast<size_t>(n);
    }
}

extern "C" void on_signal(int number) {
    int none = 0;
    if (graceful.load() > 0 && signal_number.compare_exchange_strong(none, number)) return;
    if (none == 0) { // the first one says so
        write_all(STDERR_FILENO, last_words->line);
        for (size_t i = 0; i < std::size(kSignals); ++i)
            if (kSignals[i] == number && json_file.load() >= 0) write_all(json_file.load(), last_words->json[i]);
    }
    ::_exit(128 + number);
}

} // namespace

void catch_signals(const char* command) {
    auto* const words = new LastWords{fmt::format("prolate: {}: interrupted; nothing was written\n", command), {}};
    for (size_t i = 0; i < std::size(kSignals); ++i)
        words->json[i] = as_json(Failure{128 + kSignals[i], command, "interrupted", "nothing was written"});
    last_words = words;
    struct sigaction action {};
    action.sa_handler = on_signal;
    action.sa_flags = SA_RESTART;
    for (const int number : kSignals) {
        struct sigaction inherited {};
        if (::sigaction(number, nullptr, &inherited) == 0 && inherited.sa_handler != SIG_IGN)
            ::sigaction(number, &action, nullptr);
    }
    // write() says EFBIG and EPIPE instead, so that temporary files are removed and work is not lost.
    ::signal(SIGXFSZ, SIG_IGN);
    ::signal(SIGPIPE, SIG_IGN);
}

void interruption_as_json(int file) noexcept {
    json_file.store(file);
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
