#include "cli/render/text.hpp"

#include <algorithm>

#include <fontconfig/fontconfig.h>
#include <freetype/freetype.h>

namespace prolate::cli {
namespace {

// The file of the best match for "DejaVu Sans, or any sans-serif"; "" if there is no scalable font.
std::string find_font() {
    const std::unique_ptr<FcConfig, decltype(&FcConfigDestroy)> config(FcInitLoadConfigAndFonts(), FcConfigDestroy);
    const std::unique_ptr<FcPattern, decltype(&FcPatternDestroy)> wanted(
        FcNameParse(reinterpret_cast<const FcChar8*>("DejaVu Sans,sans-serif:scalable=true")), FcPatternDestroy);
    if (!config || !wanted) return {};
    FcConfigSubstitute(config.get(), wanted.get(), FcMatchPattern);
    FcDefaultSubstitute(wanted.get());
    FcResult result = FcResultNoMatch;
    const std::unique_ptr<FcPattern, decltype(&FcPatternDestroy)> match(
        FcFontMatch(config.get(), wanted.get(), &result), FcPatternDestroy);
    FcChar8* file = nullptr; // owned by the match
    if (!match || FcPatternGetString(match.get(), FC_FILE, 0, &file) != FcResultMatch) return {};
    return reinterpret_cast<const char*>(file);
}

} // namespace

struct Font::Face {
    FT_Library library = nullptr;
    FT_Face face = nullptr;
    Face() = default;
    Face(const Face&) = delete;
    Face& operator=(const Face&) = delete;
    ~Face() {
        if (face) FT_Done_Face(face);
        if (library) FT_Done_FreeType(library);
    }
};

Font::Font() : face_(std::make_unique<Face>()) {}
Font::Font(Font&&) noexcept = default;
Font& Font::operator=(Font&&) noexcept = default;
Font::~Font() = default;

Result<Font> Font::open() {
    Font font;
    const std::string file = find_font();
    if (file.empty() || FT_Init_FreeType(&font.face_->library) != 0 ||
        FT_New_Face(font.face_->library, file.c_str(), 0, &font.face_->face) != 0 || !FT_IS_SCALABLE(font.face_->face))
        return Error{ErrorCode::io, "no font for the captions is installed (try the package fonts-dejavu-core)"};
    return font;
}

TextImage Font::draw(const std::string& text, uint32_t pixels) const {
    FT_Face face = face_->face;
    FT_Set_Pixel_Sizes(face, 0, pixels);
    const auto whole = [](FT_Pos f26_6) { return static_cast<int>((f26_6 + 63) >> 6); };
    const int ascent = whole(face->size->metrics.ascender), descent = whole(-face->size->metrics.descender);
    int width = 0;
    // Light hinting keeps the advances; the sum of them bounds the line but for a letter's overhang.
    constexpr FT_Int32 kFlags = FT_LOAD_RENDER | FT_LOAD_TARGET_LIGHT;
    for (const char c : text)
        if (FT_Load_Char(face, static_cast<unsigned char>(c), FT_LOAD_TARGET_LIGHT) == 0)
            width += whole(face->glyph->advance.x);
    TextImage image;
    image.width = static_cast<uint32_t>(width + 2);
    image.height = static_cast<uint32_t>(ascent + descent);
    image.coverage.assign(size_t{image.width} * image.height, 0);
    int pen = 1;
    for (const char c : text) {
        if (FT_Load_Char(face, static_cast<unsigned char>(c), kFlags) != 0) continue;
        const FT_GlyphSlot glyph = face->glyph;
        for (unsigned row = 0; row < glyph->bitmap.rows; ++row)
            for (unsigned column = 0; column < glyph->bitmap.width; ++column) {
                const int x = pen + glyph->bitmap_left + static_cast<int>(column);
                const int y = ascent - glyph->bitmap_top + static_cast<int>(row);
                if (x < 0 || y < 0 || x >= static_cast<int>(image.width) || y >= static_cast<int>(image.height))
                    continue;
                uint8_t& pixel = image.coverage[size_t{image.width} * y + x];
                pixel = std::max(
                    pixel,
                    glyph->bitmap.buffer[static_cast<int>(row) * glyph->bitmap.pitch + static_cast<int>(column)]);
            }
        pen += whole(glyph->advance.x);
    }
    return image;
}

} // namespace prolate::cli
