// Content hashes (XXH3-64).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace prolate {

/// XXH3-64 of `bytes`; chain several spans by passing the previous hash as `seed`.
uint64_t hash_bytes(std::span<const std::byte> bytes, uint64_t seed = 0) noexcept;

} // namespace prolate
