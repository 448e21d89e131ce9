# cmake -D PAGE=<file> -D QUERY_MODULE=<file or nothing> -D OUTPUT=<.cpp> -P embed.cmake
#
# Writes the definitions of cli/view/assets.hpp: files as arrays of bytes.
cmake_minimum_required(VERSION 3.25)

function(append_bytes text name file)
  set(bytes "")
  if(file)
    file(READ "${file}" hex HEX)
    string(REGEX REPLACE "(................................)" "\\1\n    " hex "${hex}") # lines of 16
    string(REGEX REPLACE "([0-9a-f][0-9a-f])" "0x\\1," bytes "${hex}")
  endif()
  set(${text} "${${text}}constexpr unsigned char ${name}[] = {\n    ${bytes}0};\n" PARENT_SCOPE)
endfunction()

set(arrays "")
append_bytes(arrays kPage "${PAGE}")
append_bytes(arrays kQueryModule "${QUERY_MODULE}")
file(WRITE "${OUTPUT}" "// Made by viewer/embed.cmake.
#include \"cli/view/assets.hpp\"

namespace prolate::cli::assets {
namespace {

// A zero ends each: an array cannot be empty.
${arrays}
} // namespace

std::string_view page() noexcept {
    return {reinterpret_cast<const char*>(kPage), sizeof kPage - 1};
}
std::span<const std::byte> query_module() noexcept {
    return std::as_bytes(std::span(kQueryModule, sizeof kQueryModule - 1));
}

} // namespace prolate::cli::assets
")
