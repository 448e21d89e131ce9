// prolate view: trees to look at, and to move against each other, as one page for a browser.
#include "cli/commands.hpp"
#include "cli/console.hpp"
#include "cli/inputs.hpp"
#include "cli/mesh_options.hpp"
#include "cli/outputs.hpp"
#include "cli/pose.hpp"
#include "cli/progress_line.hpp"
#include "cli/render/camera.hpp"
#include "cli/shown_mesh.hpp"
#include "cli/threads.hpp"
#include "cli/view/scene.hpp"
#include "cli/words.hpp"

#include <prolate/version.hpp>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include <cstdio>
#include <filesystem>
#include <iterator>
#include <memory>

namespace prolate::cli {
namespace {

constexpr const char* kViewFooter = R"(
Give one or two trees, each followed by the mesh that it was baked from, if you have it. The page shows the mesh
with the tree, and how far the ellipsoids stick out of it; an exact tree brings its own mesh. The page is a single
file that needs no network and no server, and sends nothing anywhere. It needs a browser with WebGL 2, as all have
had since 2021. Press ? in it for help.

If a tree has an inner cover (bake --inner), the page begins with both covers cut open. A slider moves the plane.

If a tree deforms (bake --modes), the page has a slider for each of its modes, and plays them. The ellipsoids move and
grow as queries take them; the mesh moves with them if --modes names the file that bake had, or if the tree is exact.
If bones move it (bake --skin), the glTF after it brings a slider for each bone, which turns about its joint.

With two trees, you can drag one body against the other. The verdict, the distance, the nearest points and the
counts come from prolate's own runtime, compiled to WebAssembly; this needs a command that was built where
emscripten was installed.

Examples:
  prolate view horse.etree horse.obj -o horse.html
  prolate view horse.etree horse.obj bunny.etree bunny.obj -o both.html
  prolate view moving.etree horse.obj --modes modes.npz -o moving.html
  prolate view horse.etree bunny.etree --pose 0.5,0,0 -o - >both.html)";

struct ViewArguments {
    std::vector<std::string> files;
    std::string output, up = "y", pose, modes;
    MeshOptions mesh_options;
    Outputs outputs;
};

bool is_tree(const std::string& path) {
    if (extension(path) == "etree") return true;
    char magic[6] = {};
    const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "rb"), std::fclose);
    return file && std::fread(magic, 1, sizeof magic, file.get()) == sizeof magic &&
           std::string_view(magic, sizeof magic) == "\x89"
                                                    "ETREE";
}

std::string name_of(const std::string& path) {
    return std::filesystem::path(path).filename().string();
}

// A tree as it was named on the command line, and what was read.
struct ViewedAsset {
    std::string tree_path, mesh_path;
    std::optional<Tree> tree;
    ShownMesh shown;
};

// Which mesh belongs to which tree; nothing if that is not clear.
std::optional<std::vector<ViewedAsset>> sort_files(const std::vector<std::string>& files) {
    std::vector<ViewedAsset> assets;
    for (const std::string& path : files) {
        if (is_tree(path) || (assets.empty() && is_standard_input(path)))
            assets.push_back({path, "", {}, {}});
        else if (!assets.empty() && assets.back().mesh_path.empty())
            assets.back().mesh_path = path;
        else
            return {};
    }
    return assets;
}

Outcome<> read_asset(ViewedAsset& asset, const MeshOptions& mesh_options, const std::string& modes_path) {
    auto tree = read_tree(asset.tree_path);
    if (!tree) return tree.error();
    asset.tree = std::move(*tree);
    auto shown = read_shown_mesh(asset.tree->view(), asset.mesh_path, mesh_options, modes_path);
    if (!shown) return shown.error();
    asset.shown = std::move(*shown);
    if (!asset.shown.own) note(asset.mesh_path, fmt::format("not the mesh that {} was baked from", asset.tree_path));
    return kSuccess;
}

// What the page shows: trees with their meshes, and where the second body is.
struct Request {
    std::vector<ViewedAsset> assets;
    std::optional<Pose> pose;
};

Outcome<Request> request_of(const ViewArguments& a) {
    if (const std::string kind = extension(a.output); !kind.empty() && kind != "html" && kind != "htm")
        return Failure{kUsage, a.output, "view writes HTML files only", "end the name in .html"};
    auto assets = sort_files(a.files);
    if (!assets)
        return Failure{kUsage, "view", "a mesh must follow the tree that it belongs to",
                       "name one or two .etree files, each with at most one mesh after it"};
    if (assets->size() > 2)
        return Failure{kUsage, "view", fmt::format("{} trees are too many", assets->size()), "name one or two"};
    const bool two = assets->size() == 2;
    Request out{std::move(*assets), {}};
    if (!a.pose.empty()) {
        if (!two) return Failure{kUsage, "--pose", "there is no second body to place", "name two trees"};
        const auto pose = parse_pose(a.pose);
        if (!pose) return pose.error();
        out.pose = *pose;
    }
    if (two && !has_query_module())
        return Failure{kUsage, "view", "this prolate was built without emscripten, so its pages cannot answer queries",
                       "view one tree, or install emscripten and build prolate again"};
    return out;
}

Outcome<ExitCode> run(ViewArguments& a) {
    use_available_threads();
    auto request = request_of(a);
    if (!request) return request.error();
    for (const ViewedAsset& asset : request->assets) {
        a.outputs.reads(asset.tree_path, "the tree");
        a.outputs.reads_mesh(asset.mesh_path, "the mesh");
    }
    a.outputs.reads(a.modes, "the modes");
    if (const auto claimed = a.outputs.claim(a.output, "the page", "html"); !claimed) return claimed.error();

    nlohmann::ordered_json scene{
        {"version", fmt::format("{}.{}.{}", PROLATE_VERSION_MAJOR, PROLATE_VERSION_MINOR, PROLATE_VERSION_PATCH)},
        {"up", a.up}};
    if (request->pose) {
        const auto& [t, r] = *request->pose;
        scene["pose"] = {t.x, t.y, t.z, r.x, r.y, r.z, r.w};
    }
    scene["bodies"] = nlohmann::ordered_json::array();
    const bool two = request->assets.size() == 2;
    NumberBlock numbers;
    for (ViewedAsset& asset : request->assets) {
        const bool first = &asset == request->assets.data();
        if (const auto read = read_asset(asset, a.mesh_options, first ? a.modes : ""); !read) return read.error();
        ProgressLine line;
        auto body = view_body({name_of(asset.tree_path), name_of(asset.mesh_path), asset.tree->view(),
                               std::move(asset.shown.mesh), asset.shown.own, std::move(asset.shown.displacements),
                               std::move(asset.shown.skin)},
                              numbers, two, [&line](double fraction) { return line.show("measuring", fraction); });
        if (!body) return failure_of("view", Error{ErrorCode::cancelled});
        scene["bodies"].push_back(std::move(*body));
    }
    const auto written = a.outputs.write(a.output, view_page(scene, numbers, two), Outputs::Effort::long_);
    if (!written) return written.error();
    return kDone;
}

} // namespace

void add_view(CLI::App& app, Work& chosen) {
    auto a = std::make_shared<ViewArguments>();
    CLI::App* command = app.add_subcommand("view", "Make a page that shows trees in a browser, and collides two");
    command->add_option("files", a->files, "one or two .etree files, each with its mesh after it")
        ->required()
        ->type_name("TREE [MESH] [TREE [MESH]]");
    command->add_option("-o,--output", a->output, "the HTML file to write, or - for standard output")->required();
    declare_mesh_options(*command, a->mesh_options, true);
    command->add_option(
        "--modes", a->modes,
        "the modes that the first tree was baked with: its mesh then moves with it (an exact tree knows them)");
    command->add_option("--pose", a->pose, "of the second body in the frame of the first: tx,ty,tz[,qx,qy,qz,qw]");
    command->add_option("--up", a->up, "the models' axis that points up")
        ->check(CLI::IsMember(std::vector<std::string>(std::begin(kUpAxes), std::end(kUpAxes))))
        ->capture_default_str();
    a->outputs.declare(*command);
    command->footer(kViewFooter);
    command->callback([&chosen, a] { chosen = [a] { return run(*a); }; });
}

} // namespace prolate::cli
