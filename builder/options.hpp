// What options ask of a mesh of a given size.
#pragma once

#include "builder/eigen.hpp"

#include <prolate/build.hpp>

namespace prolate {

/// The leaves' largest distance from the solid that is asked for, metres; HUGE_VAL: none is.
double most_distance(const BuildOptions& options, double diagonal) noexcept;

/// Are the lengths that are asked for in range, for a mesh whose box has these sides?
Result<void> check_lengths(const BuildOptions& options, const Vec& sides);

} // namespace prolate
