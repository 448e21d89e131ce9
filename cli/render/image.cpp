#include "cli/render/image.hpp"

#include <png.h>

#include <cstddef>
#include <span>

namespace prolate::cli {
namespace {

// A chunk that names the program: length 16, tEXt, keyword and text, and their CRC. libpng's simple interface writes
// none. It goes behind the first chunk, IHDR, whose size is fixed.
constexpr char kSoftware[] = "\0\0\0\x10"
                             "tEXtSoftware\0prolate"
                             "\x4a\x80\xe5\xea";
constexpr std::ptrdiff_t kAfterHeader = 8 + 12 + 13;

} // namespace

void draw_line(Sheet& sheet, const TextImage& line, uint32_t x0, uint32_t y0) {
    for (uint32_t y = 0; y < line.height && y0 + y < sheet.height; ++y)
        for (uint32_t x = 0; x < line.width && x0 + x < sheet.width; ++x) {
            const uint32_t ink = line.coverage[size_t{line.width} * y + x];
            for (size_t channel = 0; channel < 3; ++channel) {
                uint8_t& value = sheet.rgb[(size_t{sheet.width} * (y0 + y) + x0 + x) * 3 + channel];
                value = static_cast<uint8_t>((value * (255 - ink) + 32 * ink + 127) / 255);
            }
        }
}

Result<std::vector<std::byte>> encode_png(const Sheet& sheet) {
    png_image image = {};
    image.version = PNG_IMAGE_VERSION;
    image.width = sheet.width;
    image.height = sheet.height;
    image.format = PNG_FORMAT_RGB;
    std::vector<std::byte> bytes;
    // The first call only asks for the size.
    png_alloc_size_t size = 0;
    if (png_image_write_to_memory(&image, nullptr, &size, 0, sheet.rgb.data(), 0, nullptr)) {
        bytes.resize(size);
        if (png_image_write_to_memory(&image, bytes.data(), &size, 0, sheet.rgb.data(), 0, nullptr)) {
            bytes.resize(size);
            const auto software = std::as_bytes(std::span(kSoftware)).first(sizeof kSoftware - 1);
            bytes.insert(bytes.begin() + kAfterHeader, software.begin(), software.end());
            return bytes;
        }
    }
    return Error{ErrorCode::internal, "libpng could not encode the picture"};
}

} // namespace prolate::cli
