// The page that `prolate view` writes: the viewer's own text (folder viewer/, compiled into the command) with a scene
// in it. Whatever the scene's names hold, they stay text.
#pragma once

#include <nlohmann/json.hpp>

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

namespace prolate::cli {

/// Arrays of numbers that travel in the page as one block of base64, little-endian as they lie in memory.
class NumberBlock {
public:
    /// Adds an array; returns what the page's script needs to find it: {"type", "at" (byte), "count"}.
    template <class T> nlohmann::ordered_json add(std::span<const T> numbers) {
        return add_bytes(name_of<T>(), std::as_bytes(numbers), numbers.size());
    }
    template <class T> nlohmann::ordered_json add(const std::vector<T>& numbers) {
        return add(std::span<const T>(numbers));
    }
    std::span<const std::byte> bytes() const { return bytes_; }

private:
    template <class T> static const char* name_of() {
        if constexpr (std::is_same_v<T, float>)
            return "f32";
        else if constexpr (std::is_same_v<T, uint32_t>)
            return "u32";
        else if constexpr (std::is_same_v<T, uint16_t>)
            return "u16";
        else {
            static_assert(sizeof(T) == 1);
            return "u8";
        }
    }
    nlohmann::ordered_json add_bytes(const char* type, std::span<const std::byte> bytes, size_t count);
    std::vector<std::byte> bytes_;
};

/// The page, for the scene's description and the numbers that it refers to. `with_queries`: the runtime, compiled to
/// WebAssembly, goes along; has_query_module() must hold.
std::string view_page(const nlohmann::ordered_json& scene, const NumberBlock& numbers, bool with_queries);

/// Was the command built with the runtime as WebAssembly?
bool has_query_module() noexcept;

} // namespace prolate::cli
