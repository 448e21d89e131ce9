// prolate render: a picture of a tree, level by level.
#include "cli/common.hpp"
#include "cli/mesh_options.hpp"
#include "cli/outputs.hpp"
#include "cli/progress_line.hpp"
#include "cli/render/sheet.hpp"
#include "cli/threads.hpp"
#include "cli/view_option.hpp"

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <iterator>
#include <memory>

namespace prolate::cli {
namespace {

constexpr const char* kFooter = R"(
Examples:
  prolate render horse.etree horse.obj -o horse.png
  prolate render horse.etree horse.obj -o horse.png --levels 3 --view 120,30 --size 800x800
  prolate render horse.etree horse.obj -o heat.png --heat --mesh none
  prolate render horse.etree horse.obj -o cut.png --section z,0.4
  prolate render horse.etree -o - --up z | display)";

constexpr const char* kMeshStyles[] = {"beside", "overlay", "none"}; // in the order of MeshStyle

struct RenderArguments {
    std::string tree, mesh, output;
    MeshOptions mesh_options;
    std::string size = "1600x1200";
    ViewWords view;
    Outputs outputs;
    std::vector<uint32_t> levels;
    std::string mesh_style = "beside", section;
    bool no_shadow = false, heat = false;
    double heat_top = 0;
    uint32_t samples = SheetOptions{}.samples, threads = 0;
};

// "1600x1200"
bool parse_size(const std::string& text, uint32_t& width, uint32_t& height) {
    const char* const end = text.data() + text.size();
    const auto [cross, first] = std::from_chars(text.data(), end, width);
    if (first != std::errc() || cross == end || *cross != 'x') return false;
    const auto [rest, second] = std::from_chars(cross + 1, end, height);
    return second == std::errc() && rest == end;
}

// "z" or "z,0.4"
bool parse_section(const std::string& text, std::optional<SectionPlane>& section) {
    if (text.empty()) return true;
    if (text[0] < 'x' || text[0] > 'z') return false;
    SectionPlane plane{static_cast<uint32_t>(text[0] - 'x'), SectionPlane{}.at};
    if (text.size() > 1) {
        const char* const end = text.data() + text.size();
        const auto [rest, error] = std::from_chars(text.data() + 2, end, plane.at);
        if (text[1] != ',' || error != std::errc() || rest != end) return false;
    }
    section = plane;
    return true;
}

template <size_t kCount> size_t index_of(const char* const (&words)[kCount], const std::string& word) {
    return static_cast<size_t>(std::find(std::begin(words), std::end(words), word) - std::begin(words));
}

template <size_t kCount> CLI::IsMember one_of(const char* const (&words)[kCount]) {
    return CLI::IsMember(std::vector<std::string>(std::begin(words), std::end(words)));
}

int run(RenderArguments& a) {
    use_available_threads();
    SheetOptions options;
    if (!parse_size(a.size, options.width, options.height))
        return complain(kUsage, "--size", "not a size in pixels", "write it as 1600x1200");
    if (const std::string kind = extension(a.output); !kind.empty() && kind != "png")
        return complain(kUsage, a.output, "render writes PNG files only", "end the name in .png");
    if (!parse_section(a.section, options.section))
        return complain(kUsage, "--section", "not a plane across an axis",
                        "write it as x, y or z, or with a part of the extent, as z,0.4");
    options.heat = a.heat || a.heat_top > 0;
    options.heat_top = a.heat_top;
    if (a.mesh.empty() && (options.heat || a.mesh_style == "overlay"))
        return complain(kUsage, options.heat ? "--heat" : "--mesh overlay", "there is no mesh",
                        "name the mesh after the tree");
    if (options.heat && a.mesh_style == "overlay")
        return complain(kUsage, "--heat", "colours cannot be told when the mesh shines through",
                        "leave out --mesh overlay, or try --section");
    int code = kDone;
    const auto viewer = view_of(a.view, code);
    if (!viewer) return code;
    a.outputs.reads(a.tree, "the tree");
    a.outputs.reads(a.mesh, "the mesh");
    if (code = a.outputs.claim(a.output, "the picture", "png"); code != kDone) return code;
    const auto tree = read_tree(a.tree, code);
    if (!tree) return code;
    const TreeView view = tree->view();

    std::optional<CleanMesh> mesh;
    if (!a.mesh.empty()) {
        const BakeInfo info = view.bake_info();
        const auto import = import_options(a.mesh_options, code, info.placement);
        if (!import) return code;
        const auto raw = read_mesh(a.mesh, code, *import);
        if (!raw) return code;
        auto cleaned = clean(raw->view(), info.weld);
        if (!cleaned) return complain(a.mesh, cleaned.error());
        mesh = std::move(*cleaned);
        if (hash(mesh->mesh.view()) != view.bake_info().source_hash)
            note(a.mesh, fmt::format("not the mesh that {} was baked from{}", a.tree,
                                     options.heat ? ": the colours tell how far the tree sticks out of another" : ""));
    }

    options.levels = a.levels;
    // The root is by far the largest, so it would make all else small: it is shown only if asked for.
    if (options.levels.empty())
        for (uint32_t level = std::min(1u, view.level_count() - 1); level < std::min(4u, view.level_count()); ++level)
            options.levels.push_back(level);
    options.view = *viewer;
    options.mesh_style = static_cast<MeshStyle>(index_of(kMeshStyles, a.mesh_style));
    options.samples = a.samples;
    options.threads = a.threads;
    options.floor_shadow = !a.no_shadow;
    const auto rendered = [&] {
        ProgressLine line;
        options.progress = [&line](double fraction) { return line.show("rendering", fraction); };
        return render_sheet(view, mesh ? &*mesh : nullptr, options);
    }();
    if (!rendered) return complain("render", rendered.error());
    const auto png = encode_png(*rendered);
    if (!png) return complain(a.output, png.error());
    return a.outputs.write(a.output, *png, Outputs::Effort::long_);
}

} // namespace

void add_render(CLI::App& app, Work& chosen) {
    auto a = std::make_shared<RenderArguments>();
    CLI::App* command = app.add_subcommand("render", "Picture the levels of a tree beside its mesh, as a PNG file");
    command->add_option("tree", a->tree, "the .etree file, or - for standard input")->required();
    command->add_option("mesh", a->mesh, "the mesh that it was baked from");
    command->add_option("-o,--output", a->output, "the PNG file to write, or - for standard output")->required();
    declare_mesh_options(*command, a->mesh_options, true);
    command->add_option("--size", a->size, "width and height of the picture, pixels")->capture_default_str();
    command->add_option("--levels", a->levels, "levels to show, as 0,1,2 (default: 1, 2 and 3, as far as they exist)")
        ->delimiter(',')
        ->allow_extra_args(false); // or it would swallow the file names that follow
    declare_view(*command, a->view);
    command
        ->add_option("--mesh", a->mesh_style,
                     "the mesh: in a panel beside, as an overlay seen through the ellipsoids, or none")
        ->check(one_of(kMeshStyles))
        ->capture_default_str();
    command->add_option(
        "--section", a->section,
        "cut away the viewer's side of a plane across x, y or z, halfway or as z,0.4 says, and show the "
        "mesh's section in the tree's");
    command->add_flag("--heat", a->heat,
                      "colour by how far the tree sticks out of the mesh, and give the mean and the maximum, or of "
                      "open meshes what 99 % stay within");
    command
        ->add_option("--heat-top", a->heat_top,
                     "the same, with the legend's end at so many % of the diagonal (default: as needed)")
        ->check(CLI::PositiveNumber);
    command->add_option("--samples", a->samples, "light samples a pixel, 16 ... 1024")->capture_default_str();
    command->add_option("-j,--threads", a->threads, "0 = all cores")->capture_default_str();
    command->add_flag("--no-shadow", a->no_shadow, "leave out the shadow on the floor");
    a->outputs.declare(*command);
    command->footer(kFooter);
    command->callback([&chosen, a] { chosen = [a] { return run(*a); }; });
}

} // namespace prolate::cli
