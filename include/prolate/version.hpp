// Library and format versions.
#pragma once

#include <cstdint>

#define PROLATE_VERSION_MAJOR 0
#define PROLATE_VERSION_MINOR 1
#define PROLATE_VERSION_PATCH 0

namespace prolate {

/// The newest .etree format version that this library reads and writes (src/FORMAT.md).
inline constexpr uint16_t kFormatVersion = 9;
/// That of files without sections, which are the same in both: older readers take them, too.
inline constexpr uint16_t kPlainFormatVersion = 8;

/// major * 10000 + minor * 100 + patch, as the headers say it.
inline constexpr uint32_t kHeaderVersion =
    PROLATE_VERSION_MAJOR * 10000 + PROLATE_VERSION_MINOR * 100 + PROLATE_VERSION_PATCH;

/// The same, as the linked library says it. Compare with kHeaderVersion to find a header/library mismatch.
uint32_t library_version() noexcept;

} // namespace prolate
