#include "cli/view/page.hpp"

#include "cli/view/assets.hpp"

#include <algorithm>
#include <bit>
#include <string_view>

namespace prolate::cli {
namespace {

static_assert(std::endian::native == std::endian::little, "pages hold little-endian numbers");

std::string base64(std::span<const std::byte> bytes) {
    static constexpr char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string out;
    out.reserve((bytes.size() + 2) / 3 * 4);
    for (size_t i = 0; i < bytes.size(); i += 3) {
        const size_t count = std::min<size_t>(3, bytes.size() - i);
        uint32_t group = 0;
        for (size_t k = 0; k < 3; ++k) group = group << 8 | (k < count ? std::to_integer<uint32_t>(bytes[i + k]) : 0);
        for (size_t k = 0; k < 4; ++k) out += k <= count ? kDigits[group >> (18 - 6 * k) & 63] : '=';
    }
    return out;
}

// JSON that may stand in a <script> element: no end tag, no comment can begin in it.
std::string json_for_html(const nlohmann::ordered_json& json) {
    std::string out;
    for (const char c : json.dump(-1, ' ', true, nlohmann::ordered_json::error_handler_t::replace))
        if (c == '<')
            out += "\\u003c";
        else
            out += c;
    return out;
}

} // namespace

nlohmann::ordered_json NumberBlock::add_bytes(const char* type, std::span<const std::byte> bytes, size_t count) {
    bytes_.resize((bytes_.size() + 3) / 4 * 4); // typed arrays want their alignment
    nlohmann::ordered_json out{{"type", type}, {"at", bytes_.size()}, {"count", count}};
    bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
    return out;
}

bool has_query_module() noexcept {
    return !assets::query_module().empty();
}

std::string view_page(const nlohmann::ordered_json& scene, const NumberBlock& numbers, bool with_queries) {
    // The template's marks stand on lines of their own; one pass, so that what is put in is never searched.
    std::string out;
    const std::string_view page = assets::page();
    for (size_t at = 0; at < page.size();) {
        const size_t end = std::min(page.find('\n', at), page.size() - 1) + 1;
        const std::string_view line = page.substr(at, end - at);
        if (line == "@SCENE@\n")
            out += json_for_html(scene);
        else if (line == "@NUMBERS@\n")
            out += base64(numbers.bytes());
        else if (line == "@QUERIES@\n")
            out += with_queries ? base64(assets::query_module()) : "";
        else
            out += line;
        at = end;
    }
    return out;
}

} // namespace prolate::cli
