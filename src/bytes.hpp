// Little-endian loads and stores at any alignment, on any host.
#pragma once

#include "src/host.hpp"

#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>

namespace prolate {

template <class T> struct BitsOf { using type = std::make_unsigned_t<T>; };
template <> struct BitsOf<float> { using type = uint32_t; };
template <> struct BitsOf<double> { using type = uint64_t; };

template <class T> T load_le(const std::byte* from) noexcept {
    using Bits = typename BitsOf<T>::type;
    Bits bits = 0;
    if constexpr (std::endian::native == std::endian::little) {
        std::memcpy(&bits, from, sizeof bits);
    } else {
        for (size_t i = 0; i < sizeof bits; ++i)
            bits = static_cast<Bits>(bits | (static_cast<Bits>(from[i]) << (8 * i)));
    }
    return std::bit_cast<T>(bits);
}

/// kCount numbers in a row.
template <class T, size_t kCount> void load_le(const std::byte* from, T (&to)[kCount]) noexcept {
    if constexpr (std::endian::native == std::endian::little) {
        std::memcpy(to, from, sizeof to);
    } else {
        for (size_t i = 0; i < kCount; ++i) to[i] = load_le<T>(from + sizeof(T) * i);
    }
}

template <class T> void store_le(std::byte* to, T value) noexcept {
    using Bits = typename BitsOf<T>::type;
    const Bits bits = std::bit_cast<Bits>(value);
    for (size_t i = 0; i < sizeof bits; ++i) to[i] = static_cast<std::byte>(bits >> (8 * i));
}

} // namespace prolate
