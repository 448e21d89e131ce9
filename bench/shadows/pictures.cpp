#include "bench/shadows/pictures.hpp"

#include "cli/render/palette.hpp"
#include "cli/render/sheet.hpp"
#include "cli/render/text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <iterator>

namespace prolate::bench {
namespace {

using glm::dvec3;

constexpr uint32_t kWidth = 400, kHeight = 300, kCaption = 34, kText = 16; // of a picture, and of what stands below it
constexpr double kFocus = 2.6;   // the camera's distance from a picture one unit high
constexpr double kMargin = 1.06; // a picture's size over that of what is shown

std::string vector(const dvec3& v) {
    return fmt::format("<{:.14g}, {:.14g}, {:.14g}>", v.x, v.y, v.z);
}

// All but the camera and the object. The plane is a hair below the soles: a triangle in it would look lit.
std::string surroundings(const Stage& stage, const dvec3& eye) {
    const Lamp lamp = stage.lamp(0);
    return fmt::format("#version 3.7;\nglobal_settings {{ assumed_gamma 1 }}\nbackground {{ color rgb 1 }}\n"
                       "light_source {{ {} color rgb 1 area_light {}, {}, 9, 9 adaptive 2 jitter }}\n"
                       "light_source {{ {} color rgb 0.25 shadowless }}\n"
                       "plane {{ {}, {:.14g} pigment {{ color rgb 1 }} finish {{ ambient 0.28 diffuse 0.75 }} }}\n"
                       "#declare Only_Cover = true;\n",
                       vector(lamp.center), vector(lamp.side), vector(lamp.other_side), vector(eye), vector(stage.up()),
                       stage.ground_height() - 1e-4 * stage.radius());
}

dvec3 eye_of(const Stage& stage, const Extent& shown) {
    const double slope = 1 / (2 * kFocus * kMargin);
    return stage.eye(stage.ground(stage.radius()), shown, {slope * kWidth / kHeight, slope});
}

std::string scene_of_object(const Stage& stage, const Extent& shown, const Exhibit& exhibit) {
    const cli::Camera& c = stage.camera();
    const dvec3 eye = eye_of(stage, shown);
    return surroundings(stage, eye) + exhibit.scene +
           fmt::format("camera {{ location {} direction {} up {} right {} }}\nobject {{ Cover }}\n", vector(eye),
                       vector(c.forward * kFocus), vector(c.up), vector(c.right * (double{kWidth} / kHeight)));
}

std::string scene_of_ground(const Stage& stage, const Extent& shown, const Exhibit& exhibit) {
    const Ground ground = stage.ground(stage.radius());
    const dvec3 middle =
        ground.corner + (shown.x0 + shown.x1) / 2 * ground.right + (shown.y0 + shown.y1) / 2 * ground.down;
    const double wide = kMargin * std::max(shown.x1 - shown.x0, (shown.y1 - shown.y0) * kWidth / kHeight);
    return surroundings(stage, eye_of(stage, shown)) + exhibit.scene +
           fmt::format("camera {{ orthographic location {} direction {} up {} right {} }}\n"
                       "object {{ Cover no_image }}\n",
                       vector(middle + 4 * stage.radius() * stage.up()), vector(-stage.up()),
                       vector(-ground.down * (wide * kHeight / kWidth)), vector(ground.right * wide));
}

// POV-Ray's picture of `scene`, as a sheet of that size.
std::optional<cli::Sheet> trace(const std::string& scene, const std::string& povray, const std::string& stem) {
    std::ofstream(stem + ".pov") << scene;
    const std::string command = fmt::format("'{}' '+I{}.pov' '+O{}.ppm' +FP +W{} +H{} +A0.2 -D -GA >'{}.log' 2>&1",
                                            povray, stem, stem, kWidth, kHeight, stem);
    if (std::system(command.c_str()) != 0) {
        fmt::print(stderr, "{} failed; {}.log has its words\n", povray, stem);
        return std::nullopt;
    }
    cli::Sheet out;
    std::ifstream in(stem + ".ppm", std::ios::binary);
    const auto word = [&in] { // of the header, without its comments
        std::string text;
        while (in >> text && text.starts_with('#')) std::getline(in, text);
        return text;
    };
    const bool pixmap = word() == "P6";
    out.width = static_cast<uint32_t>(std::atoi(word().c_str()));
    out.height = static_cast<uint32_t>(std::atoi(word().c_str()));
    const bool bytes = word() == "255";
    in.get();
    out.rgb.assign(std::istreambuf_iterator<char>(in), {});
    if (!pixmap || !bytes || out.rgb.size() != size_t{3} * out.width * out.height) {
        fmt::print(stderr, "{}.ppm is no picture\n", stem);
        return std::nullopt;
    }
    return out;
}

void paste(cli::Sheet& sheet, const cli::Sheet& picture, uint32_t left, uint32_t top) {
    for (uint32_t y = 0; y < picture.height; ++y)
        std::copy_n(picture.rgb.begin() + ptrdiff_t{3} * y * picture.width, size_t{3} * picture.width,
                    sheet.rgb.begin() + ptrdiff_t{3} * ((top + y) * sheet.width + left));
}

// Draws `text` centered in the strip, in dark grey.
void draw_caption(cli::Sheet& sheet, const cli::Font& font, const std::string& text, uint32_t left, uint32_t top) {
    cli::TextImage line = font.draw(text, kText);
    for (uint32_t size = kText - 1; line.width > kWidth && size > 8; --size) line = font.draw(text, size);
    const uint32_t x0 = left + (kWidth - std::min(line.width, kWidth)) / 2, y0 = top + (kCaption - line.height) / 2;
    cli::draw_line(sheet, line, x0, y0);
}

} // namespace

std::string pov_mesh(MeshView mesh) {
    std::string out = fmt::format("#declare Cover = mesh2 {{\n  vertex_vectors {{ {}\n", mesh.vertices.size());
    const auto to = std::back_inserter(out);
    for (const Vec3& v : mesh.vertices) fmt::format_to(to, ", <{}, {}, {}>\n", v.x, v.y, v.z);
    fmt::format_to(to, "}}\n  face_indices {{ {}\n", mesh.triangles.size());
    for (const Triangle& t : mesh.triangles) fmt::format_to(to, ", <{}, {}, {}>\n", t[0], t[1], t[2]);
    fmt::format_to(to, "}}\n  pigment {{ color rgb {} }}\n  finish {{ ambient 0.10 diffuse 0.72 }}\n}}\n",
                   vector(cli::to_linear_rgb(cli::kNeutral)));
    return out;
}

bool write_shadow_sheet(const std::vector<ExhibitRow>& rows, const std::string& povray, const std::string& folder,
                        const std::string& png) {
    const auto font = cli::Font::open();
    if (!font) return fmt::print(stderr, "{}\n", font.error().what), false;
    constexpr uint32_t kRow = 2 * kHeight + kCaption;
    const auto columns = static_cast<uint32_t>(rows.at(0).exhibits.size());
    cli::Sheet sheet{columns * kWidth, static_cast<uint32_t>(rows.size()) * kRow, {}};
    sheet.rgb.assign(size_t{3} * sheet.width * sheet.height, 255);
    for (uint32_t row = 0; row < rows.size(); ++row)
        for (uint32_t column = 0; column < columns; ++column) {
            const ExhibitRow& r = rows[row];
            const Exhibit& exhibit = r.exhibits[column];
            const std::string stem = fmt::format("{}/picture-{}-{}", folder, row + 1, column + 1);
            const auto object = trace(scene_of_object(r.stage, r.shown, exhibit), povray, stem + "a");
            const auto ground = trace(scene_of_ground(r.stage, r.shown, exhibit), povray, stem + "b");
            if (!object || !ground) return false;
            const uint32_t left = column * kWidth, top = row * kRow;
            paste(sheet, *object, left, top);
            paste(sheet, *ground, left, top + kHeight);
            draw_caption(sheet, *font, exhibit.caption, left, top + 2 * kHeight);
        }
    const auto bytes = cli::encode_png(sheet);
    const auto saved = bytes ? save(png.c_str(), *bytes) : Result<void>(bytes.error());
    if (!saved) fmt::print(stderr, "{}: {}\n", png, saved.error().what);
    return static_cast<bool>(saved);
}

} // namespace prolate::bench
