// Pairs of ellipsoids a known gap apart, and the truth about them: what hunts for wrong verdicts are made of.
//
// Pairs are made around a known normal n: with r = Q1 n / a + Q2 n / b + gap n, a = |L1^T n|, b = |L2^T n|, the bodies
// are exactly `gap` apart, or touch from inside. Truth is then proved in long double for the floats that are really
// tested: a gap along n above 0 separates them, a point with radial coordinates of at most 1 in both is common to them.
// Where neither holds (floats that round to contact) the slow reference decides.
//
// PROLATE_SOAK sets how long hunts last: so many pairs, or seconds if an "s" follows. ./run soak sets it.
#pragma once

#include "tests/reference.hpp"
#include "tests/scenes.hpp"

#include <prolate/types.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <limits>

namespace prolate::hunt {

using reference::Real;
using reference::Vector;
using scenes::Point;
using scenes::Random;

#ifdef PROLATE_SANITIZED
inline constexpr uint64_t kPairs = 50'000; // the sanitizers look for errors of another kind
#else
inline constexpr uint64_t kPairs = 1'000'000;
#endif

/// How long to go on.
class Length {
public:
    Length() {
        const char* const text = std::getenv("PROLATE_SOAK");
        if (text == nullptr) return;
        char* end = nullptr;
        const uint64_t number = std::strtoull(text, &end, 10);
        if (*end == 's')
            pairs_ = std::numeric_limits<uint64_t>::max(), until_ += std::chrono::seconds(number);
        else
            pairs_ = number;
    }
    bool more(uint64_t pairs_so_far) const {
        return pairs_so_far < pairs_ &&
               (pairs_ != std::numeric_limits<uint64_t>::max() || std::chrono::steady_clock::now() < until_);
    }

private:
    uint64_t pairs_ = kPairs;
    std::chrono::steady_clock::time_point until_ = std::chrono::steady_clock::now();
};

inline Real length(const Vector& v) {
    return std::sqrt(reference::dot(v, v));
}

/// Radii with the largest 1: needles, discs and anything between, up to twice the axis ratio that bakes keep.
inline constexpr double kLargestRatio = 32768;
inline Point radii(Random& random, double most = kLargestRatio) {
    const double thin = 1 / random.log_in(1, most);
    Point r{};
    switch (random.below(3)) {
    case 0:
        r = {1, thin, thin * random.in(1, 1.5)};
        break;
    case 1:
        r = {1, random.in(0.5, 1), thin};
        break;
    default:
        r = scenes::radii(random, random.log_in(1, most));
        break;
    }
    for (double& x : r) x = std::clamp(x, 1 / most, 1.0);
    std::swap(r[0], r[random.below(3)]);
    return r;
}

/// Ends of the bodies along n, seen from A's center: A's farthest along it, B's farthest against it.
struct Ends {
    Vector of_a, of_b;
};
inline Ends ends(const reference::Pair& pair, const Vector& n) {
    using reference::operator*;
    const Vector wa = reference::transposed(pair.l1) * n, wb = reference::transposed(pair.l2) * n;
    const Vector qa = pair.l1 * wa, qb = pair.l2 * wb;
    const Real a = length(wa), b = length(wb);
    Ends out;
    for (size_t i = 0; i < 3; ++i) out.of_a[i] = qa[i] / a, out.of_b[i] = pair.r[i] - qb[i] / b;
    return out;
}

/// Moves B so that the bodies are `gap` apart along the unit normal n.
inline void part(const Ellipsoid& a, const Pose& pose_a, const Ellipsoid& b, Pose& pose_b, const Vector& n, Real gap) {
    const Ends at = ends({a, pose_a, b, pose_b}, n);
    float* const t[3] = {&pose_b.translation.x, &pose_b.translation.y, &pose_b.translation.z};
    for (size_t i = 0; i < 3; ++i) *t[i] = static_cast<float>(*t[i] + at.of_a[i] - at.of_b[i] + gap * n[i]);
}

inline Real gap_along(const reference::Pair& pair, const Vector& n) {
    using reference::operator*;
    return (reference::dot(n, pair.r) - length(reference::transposed(pair.l1) * n) -
            length(reference::transposed(pair.l2) * n)) /
           length(n);
}

/// Do the bodies share a point? `n`: about the normal of contact.
inline bool overlap(const reference::Pair& pair, const Vector& n) {
    using reference::operator*;
    using reference::operator-;
    if (gap_along(pair, n) > 0) return false;
    const Ends at = ends(pair, n);
    Vector middle;
    for (size_t i = 0; i < 3; ++i) middle[i] = (at.of_a[i] + at.of_b[i]) / 2;
    if (length(reference::inverse(pair.l1) * middle) <= 1 &&
        length(reference::inverse(pair.l2) * (middle - pair.r)) <= 1)
        return true;
    return reference::contact(pair) <= 1;
}

/// Is it certain that the bodies are not farther apart than `margin`? For margins above 0 the two ends along n tell.
inline bool within(const reference::Pair& pair, const Vector& n, Real margin) {
    if (margin == 0) return overlap(pair, n);
    const Ends at = ends(pair, n);
    return length({at.of_b[0] - at.of_a[0], at.of_b[1] - at.of_a[1], at.of_b[2] - at.of_a[2]}) <= margin;
}

} // namespace prolate::hunt
