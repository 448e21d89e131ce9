// Does one ellipsoid hold another?
#pragma once

#include <prolate/types.hpp>

namespace prolate {

/// An ellipsoid, prepared to be asked what it holds.
class Outer {
public:
    explicit Outer(const Ellipsoid& ellipsoid) noexcept;

    /// The factor by which it must grow about its center to hold `inner`, certainly: rounded up, and right within 1e-7
    /// for axis ratios up to 10^4. At most 1: it holds it. A NaN if a number is not finite.
    double growth_to_hold(const Ellipsoid& inner) const noexcept;

private:
    void to_ball(double (&v)[3]) const noexcept;
    double center_[3], diagonal_[3], l21_, l31_, l32_;
    double rounding_; // of radial coordinates, relative
};

} // namespace prolate
