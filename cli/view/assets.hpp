// Files that are compiled into the command; viewer/CMakeLists.txt makes the definitions.
#pragma once

#include <cstddef>
#include <span>
#include <string_view>

namespace prolate::cli::assets {

/// viewer/index.html with its style and script in place, and marks where a scene goes.
std::string_view page() noexcept;
/// prolate::query as WebAssembly; empty if the command was built without.
std::span<const std::byte> query_module() noexcept;

} // namespace prolate::cli::assets
