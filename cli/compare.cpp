// prolate compare: what a mesh can be baked into, side by side, so that a person picks by looking.
#include "cli/bake/asset.hpp"
#include "cli/bake/goals.hpp"
#include "cli/commands.hpp"
#include "cli/compare/choices.hpp"
#include "cli/console.hpp"
#include "cli/grouped.hpp"
#include "cli/inputs.hpp"
#include "cli/levels.hpp"
#include "cli/mesh_options.hpp"
#include "cli/outputs.hpp"
#include "cli/progress_line.hpp"
#include "cli/render/sheet.hpp"
#include "cli/threads.hpp"
#include "cli/view_option.hpp"
#include "cli/words.hpp"

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <cmath>
#include <memory>

namespace prolate::cli {
namespace {

constexpr const char* kCompareFooter = R"(
The table has a row for each choice: 8, 16, 32 and 64 ellipsoids, 64 spheres, and the convex hull.
  outside ratio  volume of the choice outside the solid / volume of the solid
  clearance      how far it sticks out at most: metres, and percent of the diagonal of the mesh's box
  bytes          of its file; the hull's is an exact tree
  ns a query     "collide" of two of them just apart, median over attitudes, on this machine now
With -o, a picture of the mesh and of all choices, coloured by how far they stick out, on one scale.

Examples:
  prolate compare horse.obj
  prolate compare horse.obj -o choices.png --quality fast
  prolate compare shell.stl --unit mm --fill 20mm -o choices.png --up z)";

struct CompareArguments {
    Asset asset;
    std::string picture;
    ViewWords view;
    Outputs outputs;
    bool json = false;
};

double percent(const Choice& choice, double diagonal) {
    return 100 * choice.clearance / diagonal;
}

std::string as_text(const std::vector<Choice>& choices, double diagonal) {
    std::string out = fmt::format("{:<16} {:>14} {:>12} {:>9} {:>9} {:>11}\n", "choice", "outside ratio",
                                  "clearance, m", "%", "bytes", "ns a query");
    for (const Choice& c : choices)
        out += fmt::format("{:<16} {:>14} {:>12.4g} {:>9.2f} {:>9} {:>11.0f}\n", c.name,
                           std::isnan(c.outside_ratio) ? "-" : fmt::format("{:.4f}", c.outside_ratio), c.clearance,
                           percent(c, diagonal), grouped(c.tree.bytes().size()), c.nanoseconds);
    return out;
}

std::string as_json(const std::string& mesh, const std::vector<Choice>& choices, double diagonal) {
    nlohmann::ordered_json out{{"mesh", mesh}, {"diagonal", diagonal}};
    out["choices"] = nlohmann::ordered_json::array();
    for (const Choice& c : choices)
        out["choices"].push_back({{"name", c.name},
                                  {"outside_ratio", c.outside_ratio},
                                  {"clearance", c.clearance},
                                  {"clearance_percent", percent(c, diagonal)},
                                  {"bytes", c.tree.bytes().size()},
                                  {"nanoseconds", c.nanoseconds}});
    return text_of(out);
}

Outcome<> draw(const CompareArguments& a, const std::vector<Choice>& choices, const CleanMesh& mesh, double diagonal) {
    SheetOptions options;
    const auto view = view_of(a.view);
    if (!view) return view.error();
    options.view = *view;
    options.threads = a.asset.options.threads;
    std::vector<CoverPanel> panels;
    panels.reserve(choices.size());
    for (const Choice& c : choices)
        panels.push_back(
            {c.tree.view(), c.hull.view(),
             fmt::format("{}, {}max {:.2f} %", c.name,
                         std::isnan(c.outside_ratio) ? "" : fmt::format("outside {:.3f}, ", c.outside_ratio),
                         percent(c, diagonal))});
    ProgressLine line;
    options.progress = [&line](double fraction) { return line.show("rendering", fraction); };
    const auto sheet = render_covers(panels, mesh, options);
    if (!sheet) return failure_of("compare", sheet.error());
    const auto png = encode_png(*sheet);
    if (!png) return failure_of(a.picture, png.error());
    return a.outputs.write(a.picture, *png, Outputs::Effort::long_);
}

Outcome<ExitCode> run(CompareArguments& a) {
    use_available_threads();
    if (const std::string kind = extension(a.picture); !kind.empty() && kind != "png")
        return Failure{kUsage, a.picture, "compare draws PNG files only", "end the name in .png"};
    a.outputs.reads_mesh(a.asset.mesh, "the mesh");
    if (const auto claimed = a.outputs.claim(a.picture, "the picture", "png"); !claimed) return claimed.error();
    const auto options = options_of(a.asset);
    if (!options) return options.error();
    const auto import = import_options(a.asset.mesh_options);
    if (!import) return import.error();
    const auto read = read_mesh(a.asset.mesh, *import);
    if (!read) return read.error();
    if (const auto possible = check_lengths(a.asset, *options, read->view()); !possible) return possible.error();
    const auto mesh = clean(read->view(), options->weld);
    if (!mesh) return failure_of(a.asset.mesh, mesh.error());
    describe_mesh(a.asset.mesh, mesh->report, {.filled = options->fill > 0});
    const auto choices = [&] {
        ProgressLine line;
        return make_choices(a.asset.mesh, *mesh, *options,
                            [&line](const std::string& what, double done) { return line.show(what, done); });
    }();
    if (!choices) return choices.error();
    const double diagonal = choices->front().tree.view().bake_info().diagonal;
    if (!a.picture.empty())
        if (const auto drawn = draw(a, *choices, *mesh, diagonal); !drawn) return drawn.error();
    print(a.json ? as_json(a.asset.mesh, *choices, diagonal) : as_text(*choices, diagonal));
    return kDone;
}

} // namespace

void add_compare(CLI::App& app, Work& chosen) {
    auto a = std::make_shared<CompareArguments>();
    CLI::App* command = app.add_subcommand("compare", "Show what a mesh can be baked into, as a table and a picture");
    command->add_option("mesh", a->asset.mesh, "the mesh, or - for standard input")->required();
    command->add_option("-o,--output", a->picture, "the PNG file for the picture, or - for standard output");
    declare_mesh_options(*command, a->asset.mesh_options);
    command->add_option("--fill", a->asset.fill,
                        "what a ball of this radius cannot reach from outside counts as solid: 20mm");
    command->add_option("--quality", a->asset.quality, "of the bakes: fast, normal or best")->capture_default_str();
    declare_view(*command, a->view);
    command->add_option("-j,--threads", a->asset.options.threads, "0 = all cores")->capture_default_str();
    a->outputs.declare(*command);
    command->add_flag("--json", a->json, "print JSON");
    command->footer(kCompareFooter);
    command->callback([&chosen, a] { chosen = [a] { return run(*a); }; });
}

} // namespace prolate::cli
