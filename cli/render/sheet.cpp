#include "cli/render/sheet.hpp"
#include "cli/grouped.hpp"

#include "cli/render/heat.hpp"
#include "cli/render/palette.hpp"
#include "cli/render/panel.hpp"
#include "cli/render/scene_cut.hpp"
#include "cli/render/scene_inner.hpp"
#include "cli/render/scene_mesh.hpp"
#include "cli/render/solid.hpp"

#include <prolate/tools.hpp>

#include <algorithm>
#include <cmath>
#include <list>
#include <memory>
#include <string>

#include <fmt/format.h>
#include <tbb/task_arena.h>

namespace prolate::cli {
namespace {

using glm::dvec3;

constexpr double kMargin = 0.07;       // around what is shown, of its own size
constexpr uint32_t kSmallestCell = 96; // pixels: narrower captions could not be read
constexpr uint32_t kSmallestText = 5;  // pixels

constexpr double kHeatRelief = 0.4; // so that light and shadow leave colours that the legend explains

// How far a cut sticks out of the mesh, percent of the mesh's diagonal.
struct Figures {
    double max = 0, mean = 0, p99 = 0;
};

struct Panel {
    PanelContent content;
    std::string caption;
};

// All that is drawn, and what it is drawn from.
struct Stage {
    Frame frame;
    Box box;                              // of the mesh, or if there is none, of what is shown
    std::list<std::vector<float>> growth; // of each tree, node_growth()
    std::unique_ptr<Solid> solid;         // if needed
    std::unique_ptr<MeshScene> mesh;      // if shown
    std::list<CutScene> cuts;             // of the levels to show
    std::list<InnerScene> inner;          // the mesh with the inner cover at each of them, in sections
    std::list<MeshScene> surfaces;        // of covers that are no tree
    std::vector<dvec3> colours;           // by slots
    std::optional<HeatScale> heat;
    std::vector<Panel> panels;
};

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

std::string caption_of(const TreeView& tree, uint32_t level, size_t nodes) {
    const char* shape = tree.bake_info().primitive == Primitive::sphere ? "sphere" : "ellipsoid";
    return fmt::format("level {}: {} {}{}", level, grouped(nodes), shape, nodes == 1 ? "" : "s");
}

std::string caption_of(MeshView mesh) {
    return fmt::format("mesh, {} triangles", grouped(mesh.triangles.size()));
}

std::string ratio_of(const TreeView& tree, uint32_t level) {
    const double ratio = tree.level(level).outside_ratio;
    return std::isfinite(ratio) ? fmt::format(", outside ratio {:.{}f}", ratio, ratio < 0.1 ? 3 : 2) : "";
}

// Of an open mesh, the largest distance would be that of points deep inside, where nobody sees them.
std::string words_of(const Figures& f, bool closed) {
    const auto percent = [](double value) { return fmt::format("{:.{}f} %", value, value < 0.995 ? 2 : 1); };
    return closed ? fmt::format(", max {}, mean {}", percent(f.max), percent(f.mean))
                  : fmt::format(", 99 % within {}, mean {}", percent(f.p99), percent(f.mean));
}

// As the file has them; or measured, if it says nothing, or speaks of another mesh.
Figures figures_of(const TreeView& tree, uint32_t level, const CleanMesh& mesh, const Solid& solid) {
    const LevelInfo info = tree.level(level);
    const BakeInfo bake = tree.bake_info();
    if (std::isfinite(info.hausdorff_max) && bake.source_hash == hash(mesh.mesh.view()) && bake.diagonal > 0) {
        const double percent = 100 / bake.diagonal;
        return {info.hausdorff_max * percent, info.hausdorff_mean * percent, info.hausdorff_p99 * percent};
    }
    std::vector<Ellipsoid> cut;
    tree.for_each_in_cut(level, [&](uint32_t node) { cut.push_back(tree.ellipsoid(node)); });
    const Solid::Closeness found = solid.closeness(cut);
    const double percent = 100 / solid.diagonal();
    return {found.max * percent, found.mean * percent, found.p99 * percent};
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
    return {};
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

Paint plain_paint(const Stage& stage) {
    return [&stage, neutral = to_linear_rgb(kNeutral), inner = to_linear_rgb(kInner)](const Hit& hit, const dvec3&) {
        return hit.id == kMeshId ? neutral : hit.id == kInnerId ? inner : stage.colours[hit.id];
    };
}

// Of a `surface`, there is no mesh that is to be neutral.
Paint heat_paint(const Stage& stage, bool surface = false) {
    return [&stage, surface, neutral = to_linear_rgb(kNeutral), inner = to_linear_rgb(kInner),
            percent = 100 / stage.solid->diagonal()](const Hit& hit, const dvec3& at) {
        if (hit.id == kMeshId && !surface) return neutral;
        if (hit.id == kInnerId) return inner;
        return stage.heat->colour(stage.solid->outside_distance(at / stage.frame.scale + stage.frame.center) * percent);
    };
}

void add_growth(Stage& stage, const TreeView& tree) {
    node_growth(tree, stage.growth.emplace_back(tree.slot_count()));
}

// What a section shows in the cut at a level: the mesh, if there is one, and in it the inner cover at that level.
const Scene* mesh_of(Stage& stage, const TreeView& tree, uint32_t level, bool section) {
    const auto inner = tree.inner();
    if (!section || !inner) return stage.mesh.get();
    add_growth(stage, *inner);
    stage.cuts.emplace_back(*inner, std::min(level, inner->level_count() - 1), stage.growth.back(), stage.frame);
    return &stage.inner.emplace_back(stage.cuts.back(), stage.mesh.get());
}

PanelContent& add_panel(Stage& stage, const Scene& scene, std::string caption, const Paint& paint) {
    Panel& panel = stage.panels.emplace_back();
    panel.caption = std::move(caption);
    panel.content.scene = &scene;
    panel.content.paint = paint;
    return panel.content;
}

std::unique_ptr<Stage> make_stage(const TreeView& tree, const CleanMesh* mesh, const SheetOptions& o) {
    auto stage = std::make_unique<Stage>(); // its address stays
    Box shown;
    for (const uint32_t level : o.levels)
        tree.for_each_in_cut(level, [&](uint32_t node) { shown.add(tree.ellipsoid(node)); });
    stage->box = shown;
    const bool mesh_shown = mesh && o.mesh_style != MeshStyle::hidden;
    if (mesh) {
        stage->box = {};
        stage->box.add(mesh->mesh.view());
        if (mesh_shown) shown.add(stage->box.low, stage->box.high);
        if (o.heat || o.section) stage->solid = std::make_unique<Solid>(mesh->mesh.view(), mesh->report.closed);
    }
    stage->frame = shown.frame();
    add_growth(*stage, tree);
    const std::vector<float>& growth = stage->growth.back();
    if (mesh_shown) stage->mesh = std::make_unique<MeshScene>(mesh->mesh.view(), stage->frame, stage->solid.get());
    for (const Oklch& colour : node_colours(tree)) stage->colours.push_back(to_linear_rgb(colour));

    const Paint paint = o.heat ? heat_paint(*stage) : plain_paint(*stage);
    if (mesh_shown && o.mesh_style == MeshStyle::beside)
        add_panel(*stage, *stage->mesh, caption_of(mesh->mesh.view()), paint);
    double most = 0;
    for (const uint32_t level : o.levels) {
        const CutScene& cut = stage->cuts.emplace_back(tree, level, growth, stage->frame);
        std::string caption = caption_of(tree, level, cut.size());
        if (o.heat) {
            const Figures figures = figures_of(tree, level, *mesh, *stage->solid);
            most = std::max(most, mesh->report.closed ? figures.max : figures.p99);
            caption += words_of(figures, mesh->report.closed);
        } else {
            caption += ratio_of(tree, level);
        }
        PanelContent& content = add_panel(*stage, cut, std::move(caption), paint);
        if (o.heat) content.relief = kHeatRelief;
        content.see_through = o.mesh_style == MeshStyle::overlay;
        if (content.see_through || o.section) content.mesh = mesh_of(*stage, tree, level, o.section.has_value());
    }
    if (o.heat) {
        const double top = o.heat_top > 0 ? o.heat_top : HeatScale::round_up(most);
        stage->heat = {top, !mesh->report.closed || most > top};
    }
    return stage;
}

// The mesh, and the leaves of each tree and each surface.
std::unique_ptr<Stage> make_stage(std::span<const CoverPanel> covers, const CleanMesh& mesh, const SheetOptions& o) {
    auto stage = std::make_unique<Stage>();
    stage->solid = std::make_unique<Solid>(mesh.mesh.view(), mesh.report.closed);
    stage->box.add(mesh.mesh.view());
    Box shown = stage->box;
    double most = 0;
    std::vector<Ellipsoid> leaves;
    const auto leaf_level = [](const CoverPanel& cover) { return cover.tree.level_count() - 1; };
    for (const CoverPanel& cover : covers) {
        shown.add(cover.surface);
        if (!cover.surface.triangles.empty()) continue;
        cover.tree.for_each_in_cut(leaf_level(cover), [&](uint32_t node) { shown.add(cover.tree.ellipsoid(node)); });
        const LevelInfo level = cover.tree.level(leaf_level(cover));
        most = std::max(most, 100 * (mesh.report.closed ? level.hausdorff_max : level.hausdorff_p99) /
                                  stage->solid->diagonal());
    }
    stage->frame = shown.frame();
    stage->heat = {o.heat_top > 0 ? o.heat_top : HeatScale::round_up(most), !mesh.report.closed};
    stage->mesh = std::make_unique<MeshScene>(mesh.mesh.view(), stage->frame);
    add_panel(*stage, *stage->mesh, caption_of(mesh.mesh.view()), heat_paint(*stage));
    for (const CoverPanel& cover : covers) {
        const bool surface = !cover.surface.triangles.empty();
        const Scene* scene = nullptr;
        if (surface) {
            scene = &stage->surfaces.emplace_back(cover.surface, stage->frame);
        } else {
            add_growth(*stage, cover.tree);
            scene = &stage->cuts.emplace_back(cover.tree, leaf_level(cover), stage->growth.back(), stage->frame);
        }
        add_panel(*stage, *scene, cover.caption, heat_paint(*stage, surface)).relief = kHeatRelief;
    }
    return stage;
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
