#include "cli/remaining.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace prolate::cli {

std::optional<double> RemainingTime::after(double seconds, double fraction) {
    constexpr double kLeastSeconds = 2, kLeastFraction = 0.02, kLongestStandstill = 0.25;
    constexpr int kLeastMoves = 5;
    if (seconds > last_seconds_) {
        const double step = seconds - last_seconds_;
        const double weight = 1 - std::exp(-2 * step / seconds);
        speed_ += weight * ((fraction - last_fraction_) / step - speed_);
        if (fraction > last_fraction_) moved_seconds_ = seconds, ++moves_;
        last_seconds_ = seconds;
        last_fraction_ = fraction;
    }
    const double still = seconds - moved_seconds_;
    if (seconds < kLeastSeconds || fraction < kLeastFraction || moves_ < kLeastMoves ||
        still > std::max(kLeastSeconds, kLongestStandstill * seconds))
        return {};
    return 2 * (1 - fraction) / (speed_ + fraction / seconds);
}

std::string rounded_time(double seconds) {
    if (seconds < 9.5) return fmt::format("{:.0f} s", std::max(1.0, seconds));
    if (seconds < 57.5) return fmt::format("{:.0f} s", 5 * std::round(seconds / 5));
    const double minutes = seconds / 60;
    if (minutes < 4.75) return fmt::format("{:g} min", 0.5 * std::round(2 * minutes));
    if (minutes < 57.5) return fmt::format("{:.0f} min", minutes);
    return fmt::format("{:.1f} h", minutes / 60);
}

} // namespace prolate::cli
