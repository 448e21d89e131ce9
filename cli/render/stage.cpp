#include "cli/render/stage.hpp"

#include "cli/grouped.hpp"
#include "cli/render/palette.hpp"

#include <prolate/tools.hpp>

#include <algorithm>
#include <cmath>

#include <fmt/ranges.h>

namespace prolate::cli {
namespace {

using glm::dvec3;

constexpr double kHeatRelief = 0.4; // so that light and shadow leave colours that the legend explains

// How far a cut sticks out of the mesh, percent of the mesh's diagonal.
struct Figures {
    double max = 0, mean = 0, p99 = 0;
};

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

// `covers`: the outer cover has one colour, as the inner one has.
Paint plain_paint(const Stage& stage, bool covers) {
    return [&stage, covers, neutral = to_linear_rgb(kNeutral), inner = to_linear_rgb(kInner),
            outer = to_linear_rgb(kOuter)](const Hit& hit, const dvec3&) {
        if (hit.id == kMeshId) return neutral;
        if (hit.id == kInnerId) return inner;
        return covers ? outer : stage.colours[hit.id];
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

// Each vertex at x + sum of q times its displacements.
std::vector<Vec3> moved_vertices(std::span<const Vec3> vertices, std::span<const float> displacements,
                                 std::span<const float> q) {
    std::vector<Vec3> out(vertices.begin(), vertices.end());
    for (size_t m = 0; m < q.size(); ++m)
        for (size_t v = 0; v < out.size(); ++v) {
            const float* u = &displacements[3 * (m * out.size() + v)];
            out[v].x += q[m] * u[0], out[v].y += q[m] * u[1], out[v].z += q[m] * u[2];
        }
    return out;
}

// A panel for each of the coordinates, with the mesh as it moves, if that is known.
void add_moved(Stage& stage, const TreeView& tree, uint32_t level, const CleanMesh* mesh, const SheetOptions& o,
               const Paint& paint) {
    for (const std::vector<float>& q : o.at) {
        const Scene& scene = stage.moved.emplace_back(tree, level, q, stage.frame);
        PanelContent& content =
            add_panel(stage, scene, fmt::format("level {} at {:g}", level, fmt::join(q, ", ")), paint);
        content.see_through = o.mesh_style == MeshStyle::overlay;
        if (!stage.mesh || o.displacements.empty() || !(content.see_through || o.section)) continue;
        const std::vector<Vec3> vertices = moved_vertices(mesh->mesh.vertices, o.displacements, q);
        const MeshView moved{vertices, mesh->mesh.triangles, {}};
        if (o.section) stage.solids.emplace_back(moved, mesh->report.closed);
        content.mesh = &stage.surfaces.emplace_back(moved, stage.frame, o.section ? &stage.solids.back() : nullptr);
    }
}

} // namespace

std::unique_ptr<Stage> make_stage(const TreeView& tree, const CleanMesh* mesh, const SheetOptions& o) {
    auto stage = std::make_unique<Stage>(); // its address stays
    Box shown;
    for (const uint32_t level : o.levels) {
        tree.for_each_in_cut(level, [&](uint32_t node) { shown.add(tree.ellipsoid(node)); });
        for (const std::vector<float>& q : o.at)
            tree.for_each_in_cut(level, [&](uint32_t node) { shown.add(moved_ellipsoid(tree, node, q)); });
    }
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

    const Paint paint = o.heat ? heat_paint(*stage) : plain_paint(*stage, o.section && tree.inner());
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
        add_moved(*stage, tree, level, mesh, o, paint);
    }
    if (o.heat) {
        const double top = o.heat_top > 0 ? o.heat_top : HeatScale::round_up(most);
        stage->heat = {top, !mesh->report.closed || most > top};
    }
    return stage;
}

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

} // namespace prolate::cli
