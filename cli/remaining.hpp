// How long a piece of work will take from here.
#pragma once

#include <optional>
#include <string>

namespace prolate::cli {

/// Estimates the remaining time from the fractions done so far. Speeds differ from stage to stage, so it takes the mean
/// of the speed so far and the speed of late (about the second half of the time). It says nothing before there is a
/// basis for it, and nothing while the work stands still for so long that the past is none.
class RemainingTime {
public:
    /// `seconds` since the start and `fraction` done, 0 ... 1; neither ever decreases. Returns the remaining seconds.
    std::optional<double> after(double seconds, double fraction);

private:
    double last_seconds_ = 0, last_fraction_ = 0, moved_seconds_ = 0;
    double speed_ = 0; // fractions a second, recently
    int moves_ = 0;
};

/// "8 s", "40 s", "3 min", "1.5 h": no digit that an estimate cannot promise.
std::string rounded_time(double seconds);

} // namespace prolate::cli
