// The one place that says how many times faster prolate is.
#pragma once

#include "bench/peers/comparison.hpp"

#include <string>
#include <utility>
#include <vector>

namespace prolate::bench::peers {

using Results = std::vector<std::pair<std::string, std::vector<Outcome>>>; ///< by name of the subject

/// Medians in microseconds, one line for each subject, peers also as multiples of prolate's; then the work done.
std::string table(const Results& results);

/// What the models take, one line for each.
std::string table(const std::vector<Memory>& memory);

} // namespace prolate::bench::peers
