// Lines of text, drawn with FreeType in the sans-serif font that fontconfig finds.
#pragma once

#include <prolate/error.hpp>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace prolate::cli {

/// A line of text as coverage, 0 ... 255, row by row from the top. All lines of one size have the same height.
struct TextImage {
    uint32_t width = 0, height = 0;
    std::vector<uint8_t> coverage;
};

/// An opened font. Not for use by several threads at once.
class Font {
public:
    /// Fails with io if there is no scalable font.
    static Result<Font> open();
    /// `text` in ASCII, letters `pixels` high from one line to the next.
    TextImage draw(const std::string& text, uint32_t pixels) const;

private:
    struct Face;
    Font();

public:
    Font(Font&&) noexcept;
    Font& operator=(Font&&) noexcept;
    ~Font();

private:
    std::unique_ptr<Face> face_;
};

} // namespace prolate::cli
