// What queries make of their options: of numbers that no length can be, as query.hpp has it, and of their budget.
#pragma once

#include <prolate/query.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

namespace prolate::query {

/// A length that only widens what is claimed: negative counts as 0, NaN as infinite.
template <class Float> Float sound_length(Float x) noexcept {
    return x >= 0 ? x : x < 0 ? Float{0} : std::numeric_limits<Float>::infinity();
}
/// One that a caller asks for, and may leave out: negative and NaN count as 0.
inline double sound_tolerance(double x) noexcept {
    return x > 0 ? x : 0;
}

inline QueryOptions sound(QueryOptions options) noexcept {
    options.margin = sound_length(options.margin);
    return options;
}

/// A margin of cores, for one of the bodies that are these cores and all within a radius of them: rounded up.
inline float with_radius(float margin, double radius) noexcept {
    if (!(radius > 0)) return margin;
    return std::nextafter(static_cast<float>(double{margin} + radius), std::numeric_limits<float>::infinity());
}

/// Adds what another part of a query did.
inline void add(const QueryStats& from, QueryStats& to) noexcept {
    to.pair_tests += from.pair_tests, to.block_tests += from.block_tests, to.triangle_tests += from.triangle_tests;
    to.deepest_level = std::max(to.deepest_level, from.deepest_level);
}

/// Tests left of a budget.
inline uint64_t tests_left(uint64_t budget, uint64_t used) noexcept {
    return budget - std::min(used, budget);
}

} // namespace prolate::query
