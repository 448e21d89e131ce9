// What the readers of texts share: words, lines, numbers, and what they say of damage.
#pragma once

#include "builder/job.hpp"
#include "builder/polygons.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>
#include <string>
#include <string_view>

namespace prolate {

/// Lines and words of a text. A backslash at a line's end joins the next one (OBJ), '#' begins a comment.
class Text {
public:
    explicit Text(std::string_view bytes, size_t start = 0) : bytes_(bytes), at_(start) {}

    /// The next word of this line, or "" at its end.
    std::string_view word() {
        checkpoint_();
        for (;;) {
            while (at_ < bytes_.size() && is_blank(bytes_[at_])) ++at_;
            if (at_ >= bytes_.size() || bytes_[at_] != '\\') break;
            size_t next = at_ + 1;
            if (next < bytes_.size() && bytes_[next] == '\r') ++next;
            if (next >= bytes_.size() || bytes_[next] != '\n') break;
            at_ = next + 1;
            ++line_;
        }
        word_at_ = at_;
        if (at_ < bytes_.size() && bytes_[at_] == '#') return {};
        while (at_ < bytes_.size() && !is_blank(bytes_[at_]) && !is_line_end(bytes_[at_])) ++at_;
        return bytes_.substr(word_at_, at_ - word_at_);
    }
    /// Goes to the start of the next line; false at the end of the text.
    bool next_line() {
        checkpoint_();
        while (at_ < bytes_.size() && !is_line_end(bytes_[at_])) ++at_;
        if (at_ < bytes_.size()) {
            if (bytes_[at_] == '\r' && at_ + 1 < bytes_.size() && bytes_[at_ + 1] == '\n') ++at_;
            ++at_, ++line_;
        }
        return at_ < bytes_.size();
    }
    /// The first word of the next line that has one; "" at the end of the text.
    std::string_view first_word() {
        for (;;) {
            if (const auto found = word(); !found.empty()) return found;
            if (!next_line()) return {};
        }
    }
    size_t word_at() const { return std::min(word_at_, bytes_.size()); }
    size_t at() const { return at_; }
    uint64_t line() const { return line_; } // counted from 1

private:
    static bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\v' || c == '\f'; }
    static bool is_line_end(char c) { return c == '\n' || c == '\r'; }
    std::string_view bytes_;
    size_t at_ = 0, word_at_ = 0;
    uint64_t line_ = 1;
    Checkpoints checkpoint_;
};

/// The whole word as a number, or nothing.
template <class T> std::optional<T> number(std::string_view word) {
    if (word.starts_with('+')) word.remove_prefix(1);
    T value{};
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (error != std::errc() || end != word.data() + word.size()) return {};
    return value;
}

/// The next three words of the line, if they are finite numbers.
inline std::optional<Point> three_coordinates(Text& text) {
    Point p{};
    for (double& coordinate : p) {
        const auto value = number<double>(text.word());
        if (!value || !std::isfinite(*value)) return {};
        coordinate = *value;
    }
    return p;
}

/// An error in the line that `text` is at.
inline Error bad_line(const Text& text, const char* what, std::string& detail) {
    detail = "line " + std::to_string(text.line());
    return {ErrorCode::bad_file, what, text.word_at()};
}

inline constexpr const char* kBadVertex = "a vertex without three finite numbers (is the file cut short?)";
inline constexpr const char* kBadFace = "a face without its corners (is the file cut short?)";
inline constexpr const char* kBadIndex = "a face names a vertex that does not exist";
inline constexpr const char* kTooShort = "the file is cut short";

inline constexpr const char* kTooMany = "too many vertices or corners (2^32 or more)";

/// "3 lines and points are left out"
inline void note_left_out(Polygons& out, uint64_t count) {
    if (count > 0) out.notes.push_back(std::to_string(count) + " lines or points are left out");
}

} // namespace prolate
