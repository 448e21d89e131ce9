#include "cli/render_sheet.hpp"
#include "cli/grouped.hpp"

#include "cli/render_palette.hpp"
#include "cli/render_text.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include <fmt/format.h>
#include <png.h>
#include <tbb/task_arena.h>

namespace prolate::cli {
namespace {

using glm::dvec3;

constexpr double kMargin = 0.07;       // around what is shown, of its own size
constexpr uint32_t kSmallestCell = 96; // pixels: narrower captions could not be read

struct Panel {
    Scene scene;
    std::vector<dvec3> colours;
    std::string caption;
};

struct Layout {
    uint32_t columns = 0, rows = 0;
    uint32_t cell_width = 0, cell_height = 0; ///< of a panel with its caption
    uint32_t text = 0;                        ///< size of the captions
    uint32_t caption = 0;                     ///< height of the strip below a picture
    double scale = 0;                         ///< pixels per slope
};

// The grid in which the pictures get largest.
Layout choose_layout(uint32_t panels, const SheetOptions& o, const Window& shown) {
    Layout best;
    double best_merit = 0;
    for (uint32_t columns = 1; columns <= panels; ++columns) {
        Layout l;
        l.columns = columns;
        l.rows = (panels + columns - 1) / columns;
        l.cell_width = o.width / l.columns;
        l.cell_height = o.height / l.rows;
        if (std::min(l.cell_width, l.cell_height) < kSmallestCell) continue;
        l.text = std::clamp(std::min(l.cell_width / 23, l.cell_height / 22), 8u, 64u);
        l.caption = l.text * 2 + 4;
        l.scale = std::min(l.cell_width / (shown.u1 - shown.u0), (l.cell_height - l.caption) / (shown.v1 - shown.v0));
        // No more height than the picture needs, so that its caption stays near.
        const auto needed = static_cast<uint32_t>(std::ceil(l.scale * (shown.v1 - shown.v0)));
        l.cell_height = std::min(l.cell_height, needed + l.caption);
        // An empty cell in the last row is a smaller fault than a small picture.
        const double merit = l.scale * std::sqrt(static_cast<double>(panels) / (l.columns * l.rows));
        if (merit > best_merit) {
            best = l;
            best_merit = merit;
        }
    }
    return best;
}

std::string caption_of(const TreeView& tree, uint32_t level, size_t nodes) {
    const char* shape = tree.bake_info().primitive == Primitive::sphere ? "sphere" : "ellipsoid";
    std::string text = fmt::format("level {}: {} {}{}", level, grouped(nodes), shape, nodes == 1 ? "" : "s");
    const double ratio = tree.level(level).outside_ratio;
    if (std::isfinite(ratio)) text += fmt::format(", outside ratio {:.{}f}", ratio, ratio < 0.1 ? 3 : 2);
    return text;
}

// Draws `line` in dark grey with its upper left corner at (x0, y0).
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

// Draws `text` centered in the strip, in letters of `size` if they fit, else smaller, else in two lines.
void draw_caption(Sheet& sheet, const Font& font, const std::string& text, uint32_t size, uint32_t left, uint32_t width,
                  uint32_t top, uint32_t height) {
    const auto lines_of = [&](const std::vector<std::string>& texts, uint32_t largest, uint32_t smallest) {
        std::vector<TextImage> lines;
        for (uint32_t pixels = largest; pixels >= smallest; --pixels) {
            lines.clear();
            for (const std::string& t : texts) lines.push_back(font.draw(t, pixels));
            const bool fits = std::all_of(lines.begin(), lines.end(), [&](const TextImage& line) {
                return line.width <= width && line.height * lines.size() <= height;
            });
            if (fits) return lines;
        }
        return std::vector<TextImage>{};
    };
    auto lines = lines_of({text}, size, std::min(size, 10u));
    const size_t comma = text.find(", ");
    if (lines.empty() && comma != std::string::npos)
        lines = lines_of({text.substr(0, comma + 1), text.substr(comma + 2)}, size, 5);
    uint32_t y = top + (height - static_cast<uint32_t>(lines.size()) * (lines.empty() ? 0 : lines[0].height)) / 2;
    for (const TextImage& line : lines) {
        draw_line(sheet, line, left + (width - line.width) / 2, y);
        y += line.height;
    }
}

void paste(Sheet& sheet, const PanelImage& image, uint32_t left, uint32_t top) {
    for (uint32_t y = 0; y < image.height; ++y)
        for (uint32_t x = 0; x < image.width; ++x) {
            const glm::vec3& colour = image.colour[size_t{image.width} * y + x];
            uint8_t* to = &sheet.rgb[(size_t{sheet.width} * (top + y) + left + x) * 3];
            for (int channel = 0; channel < 3; ++channel)
                to[channel] =
                    static_cast<uint8_t>(std::lround(255 * srgb_encode(static_cast<double>(colour[channel]))));
        }
}

Result<void> check(const TreeView& tree, const SheetOptions& o) {
    const auto bad = [](const char* what, uint64_t where) { return Error{ErrorCode::bad_options, what, where}; };
    for (const uint32_t side : {o.width, o.height})
        if (side < kSmallestCell || side > 8192) return bad("a picture's side is not 96 ... 8192 pixels", side);
    if (o.samples < 16 || o.samples > 1024) return bad("samples a pixel are not 16 ... 1024", o.samples);
    if (o.levels.empty()) return bad("no level to show", 0);
    for (const uint32_t level : o.levels)
        if (level >= tree.level_count()) return bad("the tree has no such level", level);
    if (!(std::abs(o.view.elevation) <= 89)) return bad("the elevation is not -89 ... 89 degrees", 0);
    if (!(std::abs(o.view.azimuth) <= 3600)) return bad("the azimuth is not -3600 ... 3600 degrees", 0);
    return {};
}

std::vector<Panel> make_panels(const TreeView& tree, std::optional<MeshView> mesh, const SheetOptions& o) {
    Box box;
    if (mesh) box.add(*mesh);
    std::vector<std::vector<uint32_t>> cuts;
    for (const uint32_t level : o.levels) {
        auto& cut = cuts.emplace_back();
        tree.for_each_in_cut(level, [&](uint32_t node) {
            cut.push_back(node);
            box.add(tree.ellipsoid(node));
        });
    }
    const Frame frame = box.frame();
    std::vector<Panel> panels;
    if (mesh)
        panels.push_back({Scene(*mesh, frame),
                          {to_linear_rgb(kNeutral)},
                          fmt::format("mesh, {} triangles", grouped(mesh->triangles.size()))});
    const std::vector<Oklch> palette = node_colours(tree);
    for (size_t i = 0; i < cuts.size(); ++i) {
        std::vector<dvec3> colours;
        for (const uint32_t node : cuts[i]) colours.push_back(to_linear_rgb(palette[node]));
        panels.push_back(
            {Scene(tree, cuts[i], frame), std::move(colours), caption_of(tree, o.levels[i], cuts[i].size())});
    }
    return panels;
}

} // namespace

Result<Sheet> render_sheet(const TreeView& tree, std::optional<MeshView> mesh, const SheetOptions& o) {
    if (auto checked = check(tree, o); !checked) return checked.error();
    const auto font = Font::open();
    if (!font) return font.error();
    const std::vector<Panel> panels = make_panels(tree, mesh, o);

    PanelSettings s;
    s.camera = make_camera(o.view);
    s.up = up_vector(o.view.up);
    s.floor_shadow = o.floor_shadow;
    for (s.grid = 4; s.grid * s.grid < o.samples;) ++s.grid;
    Window shown;
    for (const Panel& panel : panels) shown.add(panel.scene.window(s.camera));
    const double margin = kMargin * std::max(shown.u1 - shown.u0, shown.v1 - shown.v0);
    shown = {shown.u0 - margin, shown.u1 + margin, shown.v0 - margin, shown.v1 + margin};

    const auto count = static_cast<uint32_t>(panels.size());
    const Layout layout = choose_layout(count, o, shown);
    if (layout.columns == 0) return Error{ErrorCode::bad_options, "the picture is too small for its panels", count};
    s.width = layout.cell_width;
    s.height = layout.cell_height - layout.caption;
    s.line_width = std::max(0.5, std::min(s.width, s.height) / 700.0);
    const double half_u = s.width / layout.scale / 2, half_v = s.height / layout.scale / 2;
    const double u = (shown.u0 + shown.u1) / 2, v = (shown.v0 + shown.v1) / 2;
    s.window = {u - half_u, u + half_u, v - half_v, v + half_v};

    Sheet sheet{o.width, o.height, std::vector<uint8_t>(size_t{o.width} * o.height * 3, 255)};
    const int cores = tbb::this_task_arena::max_concurrency();
    tbb::task_arena arena(o.threads == 0 ? cores : static_cast<int>(std::min<uint32_t>(o.threads, cores)));
    for (uint32_t i = 0; i < count; ++i) {
        const uint32_t row = i / layout.columns, column = i % layout.columns;
        const uint32_t in_row = std::min(layout.columns, count - row * layout.columns); // a short last row is centered
        const uint32_t left = (o.width - in_row * layout.cell_width) / 2 + column * layout.cell_width;
        const uint32_t top = (o.height - layout.rows * layout.cell_height) / 2 + row * layout.cell_height;
        const auto progress = [&](double fraction) { return !o.progress || o.progress((i + fraction) / count); };
        PanelImage image;
        bool finished = false;
        arena.execute([&] { finished = render_panel(panels[i].scene, panels[i].colours, s, progress, image); });
        if (!finished) return Error{ErrorCode::cancelled, "cancelled"};
        paste(sheet, image, left, top);
        draw_caption(sheet, *font, panels[i].caption, layout.text, left, layout.cell_width, top + s.height,
                     layout.caption);
    }
    return sheet;
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
            return bytes;
        }
    }
    return Error{ErrorCode::internal, "libpng could not encode the picture"};
}

} // namespace prolate::cli
