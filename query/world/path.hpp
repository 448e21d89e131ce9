// The way of a ray or box through the boxes of bodies.
#pragma once

#include <prolate/bounds.hpp>
#include <prolate/types.hpp>

namespace prolate::query {

/// A box on its way: seen from a body's box, it is a ray against the sum of both boxes. Differences and quotients of
/// floats, in double, are wrong by 2 u of themselves, u = 2^-53; so are the times t at which the ray enters and leaves.
/// Signs are right. Comparisons let a NaN pass.
class Path {
public:
    Path(const Bounds& box, const Vec3& direction) : box_(box), direction_(direction) {}

    bool meets(const Bounds& other, float until) const {
        double enters = 0, leaves = until;
        const auto pass = [&](float own_lower, float own_upper, float lower, float upper, double d) {
            const double below = double{lower} - own_upper, above = double{upper} - own_lower;
            if (d == 0) return !(below > 0 || above < 0);
            const double first = (d > 0 ? below : above) / d, last = (d > 0 ? above : below) / d;
            if (first > enters) enters = first;
            if (last < leaves) leaves = last;
            return true;
        };
        return pass(box_.lower.x, box_.upper.x, other.lower.x, other.upper.x, direction_.x) &&
               pass(box_.lower.y, box_.upper.y, other.lower.y, other.upper.y, direction_.y) &&
               pass(box_.lower.z, box_.upper.z, other.lower.z, other.upper.z, direction_.z) &&
               !(enters > leaves * (1 + 0x1p-50));
    }
    /// Does the second box lie nearer to the start?
    bool second_first(const Bounds& first, const Bounds& second) const { return along(second) < along(first); }

private:
    double along(const Bounds& b) const {
        return (double{b.lower.x} + b.upper.x) * direction_.x + (double{b.lower.y} + b.upper.y) * direction_.y +
               (double{b.lower.z} + b.upper.z) * direction_.z;
    }
    Bounds box_;
    Vec3 direction_;
};

} // namespace prolate::query
