// What Debian 12's emscripten, whose C++ library is of 2021, lacks of C++20; included before all else in that build
// alone.
#pragma once

#include <array>
#include <bit>
#include <compare>
#include <cstddef>
#include <type_traits>

#ifndef __cpp_lib_bit_cast
namespace std {
template <class To, class From>
requires(sizeof(To) == sizeof(From) && is_trivially_copyable_v<To> && is_trivially_copyable_v<From>) constexpr To
    bit_cast(const From& from) noexcept {
    return __builtin_bit_cast(To, from);
}
} // namespace std
#endif

#ifndef __cpp_lib_three_way_comparison
namespace std {
template <class T, size_t N> constexpr auto operator<=>(const array<T, N>& x, const array<T, N>& y) {
    for (size_t i = 0; i < N; ++i)
        if (const auto order = x[i] <=> y[i]; order != 0) return order;
    return strong_ordering::equal;
}
} // namespace std
#endif
