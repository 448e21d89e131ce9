#include "cli/words.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <numeric>
#include <utility>

namespace prolate::cli {
namespace {

// Bytes of the UTF-8 character that `text` begins with, and the character; 0 bytes if it is none.
std::pair<size_t, char32_t> decode(std::string_view text) {
    const auto byte = [text](size_t i) { return static_cast<unsigned char>(text[i]); };
    const size_t length = byte(0) < 0x80   ? 1
                          : byte(0) < 0xc2 ? 0
                          : byte(0) < 0xe0 ? 2
                          : byte(0) < 0xf0 ? 3
                          : byte(0) < 0xf5 ? 4
                                           : 0;
    if (length == 0 || length > text.size()) return {0, 0};
    char32_t c = length == 1 ? byte(0) : byte(0) & (0x7fu >> length);
    for (size_t i = 1; i < length; ++i) {
        if ((byte(i) & 0xc0) != 0x80) return {0, 0};
        c = c << 6 | (byte(i) & 0x3fu);
    }
    return {length, c};
}

} // namespace

std::string visible(std::string_view text) {
    std::string out;
    while (!text.empty()) {
        const auto [length, c] = decode(text);
        const bool control = c < 0x20 || (c >= 0x7f && c < 0xa0);
        const bool turns = (c >= 0x200e && c <= 0x200f) || (c >= 0x2028 && c <= 0x202e) || (c >= 0x2066 && c <= 0x2069);
        const size_t bytes = std::max<size_t>(length, 1);
        if (length == 0 || control || turns)
            for (const char byte : text.substr(0, bytes))
                out += fmt::format("\\x{:02x}", static_cast<unsigned char>(byte));
        else
            out += text.substr(0, bytes);
        text.remove_prefix(bytes);
    }
    return out;
}

std::string nearest_word(std::string_view word, const std::vector<std::string>& known) {
    // Levenshtein distance: how many letters to insert, delete or change.
    const auto distance = [word](std::string_view other) {
        std::vector<size_t> row(other.size() + 1);
        std::iota(row.begin(), row.end(), size_t{0});
        for (size_t i = 0; i < word.size(); ++i) {
            size_t diagonal = std::exchange(row[0], i + 1);
            for (size_t j = 0; j < other.size(); ++j)
                diagonal =
                    std::exchange(row[j + 1], std::min({row[j + 1] + 1, row[j] + 1, diagonal + (word[i] != other[j])}));
        }
        return row.back();
    };
    const auto nearest = std::min_element(known.begin(), known.end(),
                                          [&](const auto& a, const auto& b) { return distance(a) < distance(b); });
    return nearest != known.end() && distance(*nearest) <= 1 + word.size() / 4 ? *nearest : "";
}

std::string extension(const std::string& path) {
    std::string out = std::filesystem::path(path).extension().string();
    if (!out.empty()) out.erase(0, 1);
    for (char& c : out)
        if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
    return out;
}

} // namespace prolate::cli
