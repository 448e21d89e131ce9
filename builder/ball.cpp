#include "builder/ball.hpp"

namespace prolate {

Vec middle_of(std::span<const Vec> points) {
    constexpr int kSteps = 24;
    Box box;
    for (const Vec& p : points) box.add(p);
    Vec middle = box.center();
    for (int i = 1; i <= kSteps; ++i) {
        const auto nearer = [&](const Vec& p, const Vec& q) {
            return (p - middle).squaredNorm() < (q - middle).squaredNorm();
        };
        middle += (*std::max_element(points.begin(), points.end(), nearer) - middle) / (i + 1);
    }
    return middle;
}

} // namespace prolate
