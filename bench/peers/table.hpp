// The one place that says how many times faster prolate is.
#pragma once

#include "bench/peers/comparison.hpp"

#include <string>
#include <utility>
#include <vector>

namespace prolate::bench::peers {

using Results = std::vector<std::pair<std::string, std::vector<Outcome>>>; ///< by Subject::name()

/// Medians in microseconds, one line for each subject, peers also as multiples of prolate's; then the work done.
std::string table(const Results& results);

} // namespace prolate::bench::peers
