// How far the work is, for people who wait.
#pragma once

#include "cli/remaining.hpp"
#include "cli/signals.hpp"

#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>

namespace prolate::cli {

/// `text` in at most `width` columns of a terminal, its end left out if need be. Characters beyond ASCII may be wide
/// and count as two.
std::string fitted(std::string_view text, size_t width);

/// One line on stderr, redrawn about ten times a second: stage, percent, nodes, elapsed and remaining time. It never
/// wraps: on narrow terminals the label goes first. Silent if quiet, or if stderr is no terminal that knows escape
/// sequences. The destructor wipes the line. While it lives, signals let the work end gracefully.
class ProgressLine {
public:
    /// `label` stands at the line's beginning.
    explicit ProgressLine(std::string_view label = "");
    ~ProgressLine();
    ProgressLine(const ProgressLine&) = delete;
    ProgressLine& operator=(const ProgressLine&) = delete;
    /// `fraction` in 0 ... 1; `nodes` is left out if 0. Returns false once the user has interrupted.
    bool show(std::string_view stage, double fraction, uint32_t nodes = 0);

private:
    using Clock = std::chrono::steady_clock;
    const GracefulStop graceful_;
    std::string label_;
    RemainingTime remaining_;
    Clock::time_point start_ = Clock::now(), drawn_{};
    bool shown_ = false, dirty_ = false;
};

} // namespace prolate::cli
