// Balls around points, and numbers rounded so that they hold.
#pragma once

#include "builder/eigen.hpp"

#include <cmath>
#include <span>

namespace prolate {

/// The middle of a ball around the points, of which there is one at least: not far from that of the smallest. (The
/// iteration of Badoiu and Clarkson, "Smaller core-sets for balls", SODA 2003.) An inexact one costs tightness only.
Vec middle_of(std::span<const Vec> points);

/// A float above x, or 0.
inline float round_up(double x) {
    return x > 0 ? std::nextafter(static_cast<float>(x), HUGE_VALF) : 0.0f;
}

} // namespace prolate
