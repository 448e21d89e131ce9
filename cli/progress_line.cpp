#include "cli/progress_line.hpp"

#include "cli/console.hpp"
#include "cli/grouped.hpp"
#include "cli/words.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>

#include <sys/ioctl.h>
#include <unistd.h>

namespace prolate::cli {
namespace {

bool knows_escapes() {
    const char* const terminal = std::getenv("TERM");
    return ::isatty(STDERR_FILENO) == 1 && terminal && *terminal != '\0' && std::string_view(terminal) != "dumb";
}

// Columns of the terminal, as of now.
size_t terminal_width() {
    struct winsize size {};
    return ::ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : 80;
}

bool continues_character(char c) {
    return (static_cast<unsigned char>(c) & 0xc0) == 0x80;
}

size_t columns_of(char first) {
    return continues_character(first) ? 0 : static_cast<unsigned char>(first) < 0x80 ? 1 : 2;
}

size_t columns_of(std::string_view text) {
    size_t columns = 0;
    for (const char c : text) columns += columns_of(c);
    return columns;
}

} // namespace

std::string fitted(std::string_view text, size_t width) {
    if (columns_of(text) <= width) return std::string(text);
    constexpr std::string_view kCut = "...";
    if (width < kCut.size()) return std::string(width, '.');
    size_t columns = kCut.size(), bytes = 0;
    while (bytes < text.size() && columns + columns_of(text[bytes]) <= width) columns += columns_of(text[bytes++]);
    return std::string(text.substr(0, bytes)) + std::string(kCut);
}

ProgressLine::ProgressLine(std::string_view label) : label_(visible(label)), shown_(!is_quiet() && knows_escapes()) {}

ProgressLine::~ProgressLine() {
    if (dirty_) std::fputs("\r\x1b[K", stderr);
}

bool ProgressLine::show(std::string_view stage, double fraction, uint32_t nodes) {
    const Clock::time_point now = Clock::now();
    if (shown_ && (!dirty_ || now - drawn_ > std::chrono::milliseconds(100))) {
        const double seconds = std::chrono::duration<double>(now - start_).count();
        const std::string count = nodes > 0 ? fmt::format("  {} nodes", grouped(nodes)) : "";
        const auto left = remaining_.after(seconds, fraction);
        const std::string text = fmt::format("{:<12} {:3.0f} %{}  {:.0f} s{}", stage, 100 * fraction, count, seconds,
                                             left ? fmt::format(", about {} left", rounded_time(*left)) : "");
        // A line that fills the last column wraps on some terminals.
        const size_t width = terminal_width() - 1;
        const std::string label = text.size() < width ? fitted(label_, width - text.size()) : "";
        fmt::print(stderr, "\r\x1b[K{}", fitted(label + text, width));
        std::fflush(stderr);
        drawn_ = now;
        dirty_ = true;
    }
    return interrupted() == 0;
}

} // namespace prolate::cli
