// What options ask of a mesh of a given size.
#pragma once

#include "builder/eigen.hpp"

#include <prolate/build.hpp>

namespace prolate {

/// The leaves' largest distance from the solid that is asked for, metres; HUGE_VAL: none is.
double most_distance(const BuildOptions& options, double diagonal) noexcept;

/// Are the lengths that are asked for in range, for a mesh whose box has these sides? And is it `closed`, or filled, if
/// an inner cover is asked for?
Result<void> check_asked(const BuildOptions& options, const Vec& sides, bool closed);

} // namespace prolate
