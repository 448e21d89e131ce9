#include "cli/render/sheet.hpp"

#include "cli/render/palette.hpp"
#include "cli/render/stage.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>

#include <tbb/task_arena.h>

namespace prolate::cli {
namespace {

using glm::dvec3;

constexpr double kMargin = 0.07;       // around what is shown, of its own size
constexpr uint32_t kSmallestCell = 96; // pixels: narrower captions could not be read
constexpr uint32_t kSmallestText = 5;  // pixels

struct Layout {
    uint32_t columns = 0, rows = 0;
    uint32_t cell_width = 0, cell_height = 0; ///< of a panel with its caption
    uint32_t text = 0;                        ///< size of the captions
    uint32_t caption = 0;                     ///< height of the strip below a picture
    double scale = 0;                         ///< pixels per slope
};

// The grid in which the pictures get largest.
Layout choose_layout(uint32_t panels, uint32_t width, uint32_t height, const Window& shown) {
    Layout best;
    double best_merit = 0;
    for (uint32_t columns = 1; columns <= panels; ++columns) {
        Layout l;
        l.columns = columns;
        l.rows = (panels + columns - 1) / columns;
        l.cell_width = width / l.columns;
        l.cell_height = height / l.rows;
        if (std::min(l.cell_width, l.cell_height) < kSmallestCell) continue;
        l.text = std::clamp(std::min(l.cell_width / 19, l.cell_height / 22), 8u, 64u);
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

// How the captions are set: alike in all panels.
struct Setting {
    uint32_t size = 0; ///< 0: they do not fit
    bool split = false;
};

std::vector<std::string> lines_of(const std::string& caption, bool split) {
    const size_t comma = caption.find(", ");
    if (!split || comma == std::string::npos) return {caption};
    return {caption.substr(0, comma + 1), caption.substr(comma + 2)};
}

// In one line if that does not make the letters much smaller than they may be, else in two, after the first comma.
Setting choose_setting(const Font& font, const std::vector<Panel>& panels, const Layout& layout) {
    const auto largest = [&](bool split) {
        for (uint32_t size = layout.text; size >= kSmallestText; --size) {
            const bool fits = std::all_of(panels.begin(), panels.end(), [&](const Panel& panel) {
                const auto lines = lines_of(panel.caption, split);
                return std::all_of(lines.begin(), lines.end(), [&](const std::string& line) {
                    const TextImage image = font.draw(line, size);
                    return image.width + size <= layout.cell_width && image.height * lines.size() <= layout.caption;
                });
            });
            if (fits) return size;
        }
        return 0u;
    };
    const uint32_t one_line = largest(false);
    if (one_line * 5 >= layout.text * 4) return {one_line, false};
    const uint32_t two_lines = largest(true);
    return two_lines > one_line ? Setting{two_lines, true} : Setting{one_line, false};
}

// Draws `caption` centered in the strip.
void draw_caption(Sheet& sheet, const Font& font, const std::string& caption, const Setting& setting, uint32_t left,
                  uint32_t top, const Layout& layout) {
    if (setting.size == 0) return;
    const auto lines = lines_of(caption, setting.split);
    const uint32_t height = font.draw(caption, setting.size).height;
    uint32_t y = top + (layout.caption - height * static_cast<uint32_t>(lines.size())) / 2;
    for (const std::string& line : lines) {
        const TextImage image = font.draw(line, setting.size);
        draw_line(sheet, image, left + (layout.cell_width - image.width) / 2, y);
        y += height;
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

Error bad(const char* what, uint64_t where) {
    return {ErrorCode::bad_options, what, where};
}

// What any sheet needs.
Result<void> check_picture(const SheetOptions& o) {
    for (const uint32_t side : {o.width, o.height})
        if (side < kSmallestCell || side > 8192) return bad("a picture's side is not 96 ... 8192 pixels", side);
    if (o.samples < 16 || o.samples > 1024) return bad("samples a pixel are not 16 ... 1024", o.samples);
    if (!(std::abs(o.view.elevation) <= 89)) return bad("the elevation is not -89 ... 89 degrees", 0);
    if (!(std::abs(o.view.azimuth) <= 3600)) return bad("the azimuth is not -3600 ... 3600 degrees", 0);
    return {};
}

// What a tree that deforms is to be shown at.
Result<void> check_coordinates(const TreeView& tree, const CleanMesh* mesh, const SheetOptions& o) {
    const auto modes = tree.deformation();
    if (!o.at.empty() && !modes) return bad("a tree that does not deform has no coordinates", 0);
    if (!o.at.empty() && o.heat) return bad("distances from the mesh are known at rest only", 0);
    for (const std::vector<float>& q : o.at) {
        if (q.size() != modes->mode_count()) return bad("there must be a coordinate for each mode", q.size());
        for (uint32_t m = 0; m < q.size(); ++m)
            if (!(std::abs(q[m]) <= modes->range(m))) return bad("a coordinate is out of its range", m);
    }
    const size_t wanted = mesh && modes ? 3 * size_t{modes->mode_count()} * mesh->mesh.vertices.size() : 0;
    if (!o.displacements.empty() && o.displacements.size() != wanted)
        return bad("there must be a displacement for each vertex and mode", o.displacements.size());
    return {};
}

Result<void> check(const TreeView& tree, const CleanMesh* mesh, const SheetOptions& o) {
    if (auto checked = check_picture(o); !checked) return checked;
    if (o.levels.empty()) return bad("no level to show", 0);
    for (const uint32_t level : o.levels)
        if (level >= tree.level_count()) return bad("the tree has no such level", level);
    if (o.section && o.section->axis > 2) return bad("a section's axis is not 0, 1 or 2", o.section->axis);
    if (o.section && !(o.section->at >= 0 && o.section->at <= 1)) return bad("a section is not at 0 ... 1", 0);
    if (!(o.heat_top >= 0 && o.heat_top <= 1e6)) return bad("the top of the heat scale is not 0 ... 1e6 percent", 0);
    if (o.heat && !mesh) return bad("without a mesh, nothing tells how far the tree sticks out of it", 0);
    if (o.heat && o.mesh_style == MeshStyle::overlay)
        return bad("a mesh that is seen through the ellipsoids would change the colours of the heat scale", 0);
    if (o.mesh_style == MeshStyle::overlay && !mesh) return bad("there is no mesh to lay over the ellipsoids", 0);
    return check_coordinates(tree, mesh, o);
}

// Of the axis' two sides, the viewer's is cut away.
HalfSpace half_space(const SectionPlane& plane, const Stage& stage, const dvec3& eye) {
    const auto axis = static_cast<glm::length_t>(plane.axis);
    const double model = glm::mix(stage.box.low[axis], stage.box.high[axis], plane.at);
    const double offset = (model - stage.frame.center[axis]) * stage.frame.scale;
    HalfSpace out;
    out.normal[axis] = eye[axis] < offset ? -1 : 1;
    out.offset = out.normal[axis] * offset;
    return out;
}

Result<Sheet> draw(const std::unique_ptr<Stage>& stage, const SheetOptions& o) {
    const auto font = Font::open();
    if (!font) return font.error();
    PanelSettings s;
    s.camera = make_camera(o.view);
    s.up = up_vector(o.view.up);
    s.floor_shadow = o.floor_shadow;
    if (o.section) s.section = half_space(*o.section, *stage, s.camera.eye);
    for (s.grid = 4; s.grid * s.grid < o.samples;) ++s.grid;
    Window shown;
    for (const Panel& panel : stage->panels) shown.add(panel.content.scene->window(s.camera));
    const double margin = kMargin * std::max(shown.u1 - shown.u0, shown.v1 - shown.v0);
    shown = {shown.u0 - margin, shown.u1 + margin, shown.v0 - margin, shown.v1 + margin};

    const auto count = static_cast<uint32_t>(stage->panels.size());
    const uint32_t legend_text = std::clamp(std::min(o.width / 62, o.height / 38), 7u, 64u);
    const uint32_t legend = stage->heat ? std::min(legend_height(legend_text), o.height) : 0;
    const Layout layout = choose_layout(count, o.width, o.height - legend, shown);
    if (layout.columns == 0) return Error{ErrorCode::bad_options, "the picture is too small for its panels", count};
    const Setting setting = choose_setting(*font, stage->panels, layout);
    s.width = layout.cell_width;
    s.height = layout.cell_height - layout.caption;
    s.line_width = std::max(0.5, std::min(s.width, s.height) / 700.0);
    const double half_u = s.width / layout.scale / 2, half_v = s.height / layout.scale / 2;
    const double u = (shown.u0 + shown.u1) / 2, v = (shown.v0 + shown.v1) / 2;
    s.window = {u - half_u, u + half_u, v - half_v, v + half_v};

    Sheet sheet{o.width, o.height, std::vector<uint8_t>(size_t{o.width} * o.height * 3, 255)};
    const int cores = tbb::this_task_arena::max_concurrency();
    tbb::task_arena arena(o.threads == 0 ? cores : static_cast<int>(std::min<uint32_t>(o.threads, cores)));
    const uint32_t upper = (o.height - legend - layout.rows * layout.cell_height) / 2;
    for (uint32_t i = 0; i < count; ++i) {
        const Panel& panel = stage->panels[i];
        const uint32_t row = i / layout.columns, column = i % layout.columns;
        const uint32_t in_row = std::min(layout.columns, count - row * layout.columns); // a short last row is centered
        const uint32_t left = (o.width - in_row * layout.cell_width) / 2 + column * layout.cell_width;
        const uint32_t top = upper + row * layout.cell_height;
        const auto progress = [&](double fraction) { return !o.progress || o.progress((i + fraction) / count); };
        PanelImage image;
        bool finished = false;
        arena.execute([&] { finished = render_panel(panel.content, s, progress, image); });
        if (!finished) return Error{ErrorCode::cancelled, "cancelled"};
        paste(sheet, image, left, top);
        draw_caption(sheet, *font, panel.caption, setting, left, top + s.height, layout);
    }
    if (stage->heat) draw_legend(sheet, *font, *stage->heat, legend_text, upper + layout.rows * layout.cell_height);
    return sheet;
}

} // namespace

Result<Sheet> render_sheet(const TreeView& tree, const CleanMesh* mesh, const SheetOptions& options) {
    if (auto checked = check(tree, mesh, options); !checked) return checked.error();
    return draw(make_stage(tree, mesh, options), options);
}

Result<Sheet> render_covers(std::span<const CoverPanel> covers, const CleanMesh& mesh, const SheetOptions& options) {
    if (auto checked = check_picture(options); !checked) return checked.error();
    SheetOptions whole = options;
    whole.section.reset();
    return draw(make_stage(covers, mesh, whole), whole);
}

} // namespace prolate::cli
