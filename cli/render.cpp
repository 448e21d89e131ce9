// prolate render: a picture of a tree, level by level.
#include "cli/common.hpp"
#include "cli/render_sheet.hpp"

#include <CLI/CLI.hpp>

#include <algorithm>
#include <charconv>
#include <iterator>
#include <memory>

namespace prolate::cli {
namespace {

struct RenderArguments {
    std::string tree, mesh, output;
    std::string size = "1600x1200";
    std::vector<double> view = {View{}.azimuth, View{}.elevation};
    std::vector<uint32_t> levels;
    std::string up = "y";
    bool no_shadow = false;
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

int run(const RenderArguments& a) {
    SheetOptions options;
    if (!parse_size(a.size, options.width, options.height))
        return complain(kUsage, "--size", "not a size in pixels", "write it as 1600x1200");
    if (const std::string kind = extension(a.output); !kind.empty() && kind != "png")
        return complain(kUsage, a.output, "render writes PNG files only", "end the name in .png");
    int code = kDone;
    const auto tree = read_tree(a.tree, code);
    if (!tree) return code;
    const TreeView view = tree->view();

    std::optional<CleanMesh> mesh;
    if (!a.mesh.empty()) {
        const auto raw = read_mesh(a.mesh, code);
        if (!raw) return code;
        auto cleaned = clean(raw->view());
        if (!cleaned) return complain(a.mesh, cleaned.error());
        mesh = std::move(*cleaned);
    }

    options.levels = a.levels;
    // The root is by far the largest, so it would make all else small: it is shown only if asked for.
    if (options.levels.empty())
        for (uint32_t level = std::min(1u, view.level_count() - 1); level < std::min(4u, view.level_count()); ++level)
            options.levels.push_back(level);
    const auto axis = std::find(std::begin(kUpAxes), std::end(kUpAxes), a.up) - std::begin(kUpAxes);
    options.view = {a.view[0], a.view[1], static_cast<UpAxis>(axis)};
    options.samples = a.samples;
    options.threads = a.threads;
    options.floor_shadow = !a.no_shadow;
    const auto rendered = [&] {
        ProgressLine line;
        options.progress = [&line](double fraction) { return line.show("rendering", fraction); };
        return render_sheet(view, mesh ? std::optional(mesh->mesh.view()) : std::nullopt, options);
    }();
    if (!rendered) return complain("render", rendered.error());
    const auto png = encode_png(*rendered);
    if (!png) return complain(a.output, png.error());
    return write_output(a.output, *png);
}

} // namespace

void add_render(CLI::App& app, Work& chosen) {
    auto a = std::make_shared<RenderArguments>();
    CLI::App* command = app.add_subcommand("render", "Picture the levels of a tree beside its mesh, as a PNG file");
    command->add_option("tree", a->tree, "the .etree file")->required();
    command->add_option("mesh", a->mesh, "the mesh that it was baked from, for the first panel");
    command->add_option("-o,--output", a->output, "the PNG file to write, or - for standard output")->required();
    command->add_option("--size", a->size, "width and height of the picture, pixels")->capture_default_str();
    command->add_option("--levels", a->levels, "levels to show, as 0,1,2 (default: 1, 2 and 3, as far as they exist)")
        ->delimiter(',')
        ->allow_extra_args(false); // or it would swallow the file names that follow
    command->add_option("--view", a->view, "where the viewer stands: azimuth and elevation, degrees (default: 30,18)")
        ->delimiter(',')
        ->expected(2);
    command->add_option("--up", a->up, "the model's axis that points up")
        ->check(CLI::IsMember(std::vector<std::string>(std::begin(kUpAxes), std::end(kUpAxes))))
        ->capture_default_str();
    command->add_option("--samples", a->samples, "light samples a pixel, 16 ... 1024")->capture_default_str();
    command->add_option("--threads", a->threads, "0 = all cores")->capture_default_str();
    command->add_flag("--no-shadow", a->no_shadow, "leave out the shadow on the floor");
    command->callback([&chosen, a] { chosen = [a] { return run(*a); }; });
}

} // namespace prolate::cli
