// prolate render: a picture of a tree, level by level.
#include "cli/commands.hpp"
#include "cli/console.hpp"
#include "cli/inputs.hpp"
#include "cli/mesh_options.hpp"
#include "cli/outputs.hpp"
#include "cli/progress_line.hpp"
#include "cli/render/sheet.hpp"
#include "cli/shown_mesh.hpp"
#include "cli/threads.hpp"
#include "cli/view_option.hpp"
#include "cli/words.hpp"

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <iterator>
#include <memory>

namespace prolate::cli {
namespace {

constexpr const char* kRenderFooter = R"(
Examples:
  prolate render horse.etree horse.obj -o horse.png
  prolate render horse.etree horse.obj -o horse.png --levels 3 --view 120,30 --size 800x800
  prolate render horse.etree horse.obj -o heat.png --heat --mesh none
  prolate render horse.etree horse.obj -o cut.png --section z,0.4
  prolate render moving.etree horse.obj --modes modes.npz --mesh overlay --at 1,0 --at=-1,0.5 -o moving.png
  prolate render horse.etree -o - --up z | display)";

constexpr const char* kMeshStyles[] = {"beside", "overlay", "none"}; // in the order of MeshStyle

struct RenderArguments {
    std::string tree, mesh, output;
    MeshOptions mesh_options;
    std::string size = "1600x1200";
    ViewWords view;
    Outputs outputs;
    std::vector<uint32_t> levels;
    std::string mesh_style = "beside", section, modes;
    std::vector<std::string> at;
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

// "1,-0.5": coordinates of a tree that deforms.
Outcome<std::vector<float>> parse_coordinates(const std::string& text, const TreeView& tree) {
    const auto bad = [&text](std::string what, std::string advice) {
        return Failure{kUsage, "--at " + text, std::move(what), std::move(advice)};
    };
    const auto modes = tree.deformation();
    if (!modes) return bad("the tree has no modes", "bake it with --modes");
    std::vector<float> out;
    for (const char *at = text.data(), *const end = at + text.size();; ++at) {
        float number = 0;
        const auto [rest, error] = std::from_chars(at, end, number);
        if (error != std::errc() || (rest != end && *rest != ','))
            return bad("not numbers with commas between them", "write it as 1,-0.5");
        out.push_back(number);
        if ((at = rest) == end) break;
    }
    if (out.size() != modes->mode_count())
        return bad(fmt::format("{} coordinate{} for {} mode{}", out.size(), out.size() == 1 ? "" : "s",
                               modes->mode_count(), modes->mode_count() == 1 ? "" : "s"),
                   "give one for each");
    for (uint32_t m = 0; m < out.size(); ++m)
        if (!(std::abs(out[m]) <= modes->range(m)))
            return bad(fmt::format("mode {} goes from -{:g} to {:g}", m + 1, modes->range(m), modes->range(m)),
                       "stay within, or bake with a larger --range");
    return out;
}

template <size_t kCount> size_t index_of(const char* const (&words)[kCount], const std::string& word) {
    return static_cast<size_t>(std::find(std::begin(words), std::end(words), word) - std::begin(words));
}

template <size_t kCount> CLI::IsMember one_of(const char* const (&words)[kCount]) {
    return CLI::IsMember(std::vector<std::string>(std::begin(words), std::end(words)));
}

// All that the command line says of the picture; its levels, if none are given, are the tree's to say.
Outcome<SheetOptions> sheet_options(const RenderArguments& a) {
    SheetOptions out;
    if (!parse_size(a.size, out.width, out.height))
        return Failure{kUsage, "--size", "not a size in pixels", "write it as 1600x1200"};
    if (!parse_section(a.section, out.section))
        return Failure{kUsage, "--section", "not a plane across an axis",
                       "write it as x, y or z, or with a part of the extent, as z,0.4"};
    out.heat = a.heat || a.heat_top > 0;
    out.heat_top = a.heat_top;
    if (out.heat && !a.at.empty())
        return Failure{kUsage, "--heat", "distances are those of the body at rest", "leave out --at, or --heat"};
    if (a.mesh.empty() && a.at.empty() && (out.heat || a.mesh_style == "overlay"))
        return Failure{kUsage, out.heat ? "--heat" : "--mesh overlay", "there is no mesh",
                       "name the mesh after the tree"};
    if (out.heat && a.mesh_style == "overlay")
        return Failure{kUsage, "--heat", "colours cannot be read when the mesh shines through",
                       "leave out --mesh overlay, or try --section"};
    const auto view = view_of(a.view);
    if (!view) return view.error();
    out.view = *view;
    out.levels = a.levels;
    out.mesh_style = static_cast<MeshStyle>(index_of(kMeshStyles, a.mesh_style));
    out.samples = a.samples;
    out.threads = a.threads;
    out.floor_shadow = !a.no_shadow;
    return out;
}

Outcome<ExitCode> run(RenderArguments& a) {
    use_available_threads();
    if (const std::string kind = extension(a.output); !kind.empty() && kind != "png")
        return Failure{kUsage, a.output, "render writes PNG files only", "end the name in .png"};
    auto options = sheet_options(a);
    if (!options) return options.error();
    a.outputs.reads(a.tree, "the tree");
    a.outputs.reads_mesh(a.mesh, "the mesh");
    a.outputs.reads(a.modes, "the modes");
    if (const auto claimed = a.outputs.claim(a.output, "the picture", "png"); !claimed) return claimed.error();
    const auto tree = read_tree(a.tree);
    if (!tree) return tree.error();
    const TreeView view = tree->view();
    for (const std::string& text : a.at) {
        auto q = parse_coordinates(text, view);
        if (!q) return q.error();
        options->at.push_back(std::move(*q));
    }
    std::optional<CleanMesh> mesh;
    if (!a.mesh.empty() || !a.modes.empty() || !a.at.empty()) {
        auto read = read_shown_mesh(view, a.mesh, a.mesh_options, a.modes);
        if (!read) return read.error();
        if (!read->own)
            note(a.mesh,
                 fmt::format("not the mesh that {} was baked from{}", a.tree,
                             options->heat ? ": the colours show how far the tree sticks out of another one" : ""));
        mesh = std::move(read->mesh);
        options->displacements = std::move(read->displacements);
        if (options->mesh_style == MeshStyle::overlay && !a.at.empty() && options->displacements.empty())
            return Failure{kUsage, "--mesh overlay", "how the mesh moves is not known", "name it and its --modes"};
    }
    // Of a body that moves, all that there is.
    if (options->levels.empty() && !a.at.empty()) options->levels.push_back(view.level_count() - 1);
    // The root is by far the largest, so it would make all else small: it is shown only if asked for.
    if (options->levels.empty())
        for (uint32_t level = std::min(1u, view.level_count() - 1); level < std::min(4u, view.level_count()); ++level)
            options->levels.push_back(level);
    const auto rendered = [&] {
        ProgressLine line;
        options->progress = [&line](double fraction) { return line.show("rendering", fraction); };
        return render_sheet(view, mesh ? &*mesh : nullptr, *options);
    }();
    if (!rendered) return failure_of("render", rendered.error());
    const auto png = encode_png(*rendered);
    if (!png) return failure_of(a.output, png.error());
    const auto written = a.outputs.write(a.output, *png, Outputs::Effort::long_);
    if (!written) return written.error();
    return kDone;
}

} // namespace

void add_render(CLI::App& app, Work& chosen) {
    auto a = std::make_shared<RenderArguments>();
    CLI::App* command = app.add_subcommand("render", "Draw the levels of a tree beside its mesh, as a PNG file");
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
        "cut away the viewer's side of a plane across x, y or z (halfway, or at 0.4 of the extent for z,0.4), and show "
        "the mesh's section within the tree's, and an inner cover's within the mesh's");
    command
        ->add_option("--at", a->at,
                     "show a tree that deforms at these coordinates beside the one at rest; can be given again")
        ->type_name("Q1,Q2,...")
        ->allow_extra_args(false);
    command->add_option(
        "--modes", a->modes,
        "the modes that the tree was baked with: the mesh then moves with it (an exact tree knows them)");
    command->add_flag("--heat", a->heat,
                      "colour by how far the tree sticks out of the mesh, and print the mean and the maximum, or for "
                      "open meshes the 99th percentile");
    command
        ->add_option("--heat-top", a->heat_top,
                     "the same, with a legend that ends at this many % of the diagonal (default: as needed)")
        ->check(CLI::PositiveNumber);
    command->add_option("--samples", a->samples, "light samples a pixel, 16 ... 1024")->capture_default_str();
    command->add_option("-j,--threads", a->threads, "0 = all cores")->capture_default_str();
    command->add_flag("--no-shadow", a->no_shadow, "leave out the shadow on the floor");
    a->outputs.declare(*command);
    command->footer(kRenderFooter);
    command->callback([&chosen, a] { chosen = [a] { return run(*a); }; });
}

} // namespace prolate::cli
