// A tree's lattice in metres, as queries see it: TreeView::scale() included.
#pragma once

#include "src/power_of_two.hpp"

#include <prolate/detail/tree_bytes.hpp>

namespace prolate {

/// Metres a step: exact, as the scale is a float.
inline double step_of(const LatticeInfo& lattice) {
    return power_of_two(lattice.step_exponent) * double{lattice.scale};
}
/// Steps a metre: a power of two, or with a scale that is none wrong by 2^-53 of itself, which is one rounding of a
/// coordinate more. Those in double precision are paid for by margins of 512 such.
inline double steps_per_metre(const LatticeInfo& lattice) {
    return power_of_two(-lattice.step_exponent) / double{lattice.scale};
}

} // namespace prolate
