// prolate bake: from mesh files to .etree files. One asset (bake/asset.cpp), or all of a manifest
// (bake/manifest.cpp).
#include "cli/bake/asset.hpp"
#include "cli/bake/manifest.hpp"
#include "cli/commands.hpp"
#include "cli/console.hpp"
#include "cli/levels.hpp"
#include "cli/outputs.hpp"
#include "cli/threads.hpp"

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include <memory>

namespace prolate::cli {
namespace {

constexpr const char* kBakeFooter = R"(
The goal is --levels, --ellipsoids, a closeness (--tolerance, --distance, --clearance, --keep-holes or several) or
--exact. The default is 3 levels. For a closeness, the tree gets as few leaves as reach it, more where the shape needs
more: the cover then sticks out of the solid by no more than that volume and that distance. --ellipsoids with a
closeness is "at most": as few as reach it, and no tree at all if that many do not, but a line that says what they
reach. --levels and --exact go with no other goal.

With --fill, what a ball of that radius cannot reach from outside is inside, for hollow shells of robots, bodies of cars
and houses: an open mesh has an inside then, too. The filled solid is made of cells, 1/160 of the longest side or more.
It holds the mesh and all that cannot be reached, and sticks out by a cell or two. All figures are about it.
--keep-holes is the opposite: as few leaves as leave each hole free for such a ball, wherever a somewhat larger one
passes: by a seventh of its radius, or by 1/110 of the longest side if that is more.

With --inner, the file also holds a second tree, of ellipsoids that are proved to lie inside the solid. Where the outer
ellipsoids of two bodies are apart, so are the solids; where the inner ones meet, so do the solids. Goes with every goal
and with --exact, and leaves the tree itself as it is.

With --modes, the body deforms: at coordinates q, each vertex is moved by the sum of q times its displacements, and all
nodes are proved to hold it for every q within the ranges. Displacements are those of the vertices as the file has
them, in its unit; vertices in one place must move alike. numpy.savez(path, modes=..., ranges=...) writes such a file.

With --skin, the joints of a glTF's skins and its morph targets move the body: nodes hold it at *all* matrices of the
bones, the joints' world matrices times their inverse bind matrices. The tree is that of the bind pose. Morph targets
become modes, their weights within -1 and 1, or --range.

With --exact, the tree goes down to the mesh's triangles and stores them, a few in each leaf. Its ellipsoids cover
the surface only, and queries answer for the triangles. 100,000 triangles take less than a second of CPU time;
--quality fast takes a sixth less, for queries up to a quarter slower, and best is as normal.

Coordinates are taken from the file, as metres unless --unit or --scale says otherwise. The unit that a 3MF states
is applied; that of a DAE is only reported. The tree stores scale and local origin, and answers of queries are
relative to it. Vertices that nearly meet are joined if that closes the mesh (--weld 0: never), and the cover holds
them where they were. Closed parts that are inside out are reversed. The same mesh and options give the same bytes.

An open mesh has no certain inside. It is baked in surface mode, in which only the cover of its triangles is
certain.

Nothing is baked twice. If the output already is what this mesh and these options make, only its date is renewed
("unchanged"). A folder named by --cache, or by the environment variable PROLATE_CACHE, keeps every tree for later
runs, other outputs and other machines ("cached"); then an unchanged mesh is not even imported. Both compare the
content of the mesh, the options and the version of the builder, never dates. You may delete any file of the folder.

A manifest bakes many assets in one run. It is a JSON file:
  {
    "defaults": {"quality": "best", "ellipsoids": 200},
    "assets": [
      {"mesh": "models/horse.obj", "output": "baked/horse.etree"},
      {"mesh": "models/castle.glb", "output": "baked/castle.etree", "levels": 4, "report": "baked/castle.json"}
    ]
  }
An entry has a mesh, an output, and any of the options above by their long names without dashes. Values are numbers
or strings, and true for an option without a value. Missing options are taken from the defaults; but an entry with
one of levels, ellipsoids, tolerance, distance, clearance, keep-holes and exact takes none of these from them. Paths
are relative to the manifest's folder. A bad entry, or an asset that fails, is reported in one line and does not stop
the others; the exit code is then 1. Ctrl-C keeps what is done.
)";

constexpr const char* kBakeExamples = R"(

Examples:
  prolate bake horse.obj -o horse.etree
  prolate bake horse.obj -o horse.etree --ellipsoids 200 --quality best --report horse.json
  prolate bake horse.obj -o horse.etree --tolerance 0.1
  prolate bake link.stl -o link.etree --unit mm --ellipsoids 32 --clearance 5mm  # a robot's link: at most 32
  prolate bake shell.dae -o shell.etree --unit mm --fill 20mm --ellipsoids 16    # its hollow cover, as a block
  prolate bake crate.glb -o crate.etree --ellipsoids 8 --quality best            # a prop of a game: few and tight
  prolate bake plate.3mf -o plate.etree --keep-holes 4mm --clearance 1mm         # a machined part, its holes free
  prolate bake part.dae -o part.etree --unit mm
  prolate bake horse.obj -o band.etree --ellipsoids 64 --inner 64                # from outside and from inside
  prolate bake horse.obj -o moving.etree --ellipsoids 64 --modes modes.npz       # deforms; or modes.npy --range 0.5
  prolate bake hero.glb -o hero.etree --ellipsoids 64 --skin                     # moves by its bones
  prolate bake site.obj -o site.etree --recentre
  prolate bake horse.obj -o - | ssh robot 'cat > horse.etree'
  prolate bake --manifest assets.json
  prolate bake --manifest assets.json --cache ~/.cache/prolate --json | jq '.assets[] | select(.error)')";

struct BakeArguments {
    Asset asset;
    std::string manifest, cache;
    Outputs outputs;
    bool rebake = false, json = false;
    std::vector<const CLI::Option*> asset_options;
};

Outcome<ExitCode> run_one(BakeArguments& a) {
    if (a.asset.mesh.empty()) return Failure{kUsage, "bake", "no mesh is given", "see 'prolate bake --help'"};
    if (a.asset.output.empty()) return Failure{kUsage, "bake", "--output is required", "see 'prolate bake --help'"};
    name_inputs(a.asset, a.outputs);
    a.outputs.reads(a.cache, "the cache folder");
    if (const auto claimed = claim_outputs(a.asset, a.outputs); !claimed) return claimed.error();
    BakeCache cache(a.cache);
    const auto baked = bake_asset(a.asset, a.outputs, cache, a.rebake, "");
    if (!baked) return baked.error();
    if (baked->source == Source::unchanged)
        note(a.asset.output, "unchanged: made from this mesh with these options (--rebake bakes it again)");
    if (baked->source == Source::cached) note(a.asset.output, "taken from the cache (--rebake bakes it again)");
    const std::string shown = a.json ? text_of(report_of(a.asset, *baked))
                                     : level_table(baked->tree.view(), baked->level_seconds) +
                                           inner_text(baked->tree.view()) + motion_text(baked->tree.view());
    if (is_quiet() && !a.json) return kDone;
    if (is_standard_output(a.asset.output))
        fmt::print(stderr, "{}", shown);
    else
        print(shown);
    return kDone;
}

Outcome<ExitCode> run(BakeArguments& a) {
    use_available_threads();
    if (a.manifest.empty()) return run_one(a);
    const std::string report = a.asset.report;
    for (const CLI::Option* option : a.asset_options)
        if (option->count() > 0)
            return Failure{kUsage, option->get_name(), "cannot be combined with --manifest", "set it in the manifest"};
    BakeCache cache(a.cache);
    a.outputs.reads(a.cache, "the cache folder");
    return bake_manifest(a.manifest, a.outputs, cache, {a.rebake, a.json, a.asset.options.threads, report});
}

} // namespace

void add_bake(CLI::App& app, Work& chosen) {
    auto a = std::make_shared<BakeArguments>();
    CLI::App* command = app.add_subcommand("bake", "Make an ellipsoid tree from a mesh, and prove that it covers it");
    declare_asset_options(*command, a->asset);
    for (const CLI::Option* option : command->get_options())
        if (const std::string name = option->get_name(); name != "--help" && name != "--threads" && name != "--report")
            a->asset_options.push_back(option);
    command->add_option("--manifest", a->manifest, "bake all assets of this JSON file; see below");
    command->add_option("--cache", a->cache, "folder that keeps baked trees; see below")->envname("PROLATE_CACHE");
    command->add_flag("--rebake", a->rebake, "bake even if the result is already there");
    a->outputs.declare(*command);
    command->add_flag("--json", a->json, "print the figures as JSON");
    command->footer(std::string(kBakeFooter) + kLevelTableHelp + kBakeExamples);
    command->callback([&chosen, a] { chosen = [a] { return run(*a); }; });
}

} // namespace prolate::cli
