// Numbers of binary files.
#pragma once

#include <bit>
#include <cstdint>
#include <string>

namespace prolate::cli {

/// Adds the bytes of a float or an integer of 2 or 4 bytes, the lowest first.
template <class T> void append_little_endian(std::string& out, T value) {
    static_assert(sizeof(T) == 2 || sizeof(T) == 4);
    uint32_t bits = 0;
    if constexpr (sizeof(T) == 4)
        bits = std::bit_cast<uint32_t>(value);
    else
        bits = static_cast<uint16_t>(value);
    for (unsigned shift = 0; shift < 8 * sizeof(T); shift += 8) out += static_cast<char>(bits >> shift & 0xff);
}

} // namespace prolate::cli
