// prolate verify: proves anew, from the file and the mesh alone, that every level of the tree covers.
#include "cli/commands.hpp"
#include "cli/console.hpp"
#include "cli/grouped.hpp"
#include "cli/inputs.hpp"
#include "cli/mesh_options.hpp"
#include "cli/moving.hpp"
#include "cli/progress_line.hpp"
#include "cli/threads.hpp"

#include <prolate/verify.hpp>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <memory>
#include <optional>

namespace prolate::cli {
namespace {

constexpr const char* kVerifyFooter = R"(
The proof uses only the tree's file and the mesh. Exit code 0: every level covers. 1: some level does not, or it
could not be proved. The mesh is read as when the tree was baked, with the same unit, scale, local origin and weld
tolerance, unless you give others. An open mesh has no certain inside, so only its triangles are proved to be
covered. Of a tree baked with --fill, the filled solid is; of one with --keep-holes, the holes are proved to be free,
too. An exact tree must hold the mesh's triangles, each in one leaf and in every ellipsoid above it. The ellipsoids of
an inner cover (bake --inner) must lie inside the solid, or the exit code is 1. Of a tree that deforms, --modes proves
that its nodes hold the mesh wherever these modes move it, within the tree's ranges; without, only the mesh at rest.
--skin proves it for the bones and morph targets of a glTF, at all matrices.

Examples:
  prolate verify horse.etree horse.obj
  prolate verify horse.etree horse.obj --json
  prolate verify moving.etree horse.obj --modes modes.npz
  prolate verify hero.etree hero.glb --skin)";

struct VerifyArguments {
    std::string tree, mesh, modes;
    MeshOptions mesh_options;
    uint32_t threads = 0;
    bool skin = false, json = false;
};

// What is known of how the tree deforms: nothing, if it does not, or it was not asked for.
struct MotionProofs {
    std::optional<ModesProof> modes;
    std::optional<SkinProof> skin;
    bool holds() const { return (!modes || modes->proved) && (!skin || skin->proved); }
};

std::string as_json(const VerifyReport& report, const MotionProofs& motion, bool same_mesh) {
    nlohmann::ordered_json out;
    out["covered"] = report.covered;
    out["surface_mode"] = report.surface_mode;
    out["exact"] = report.exact;
    out["same_triangles"] = report.exact ? nlohmann::ordered_json(report.same_mesh) : nullptr;
    out["bounded"] = report.exact ? nullptr : nlohmann::ordered_json(report.bounded);
    if (!report.bounded) out["unbounded_node"] = report.unbounded_node;
    out["holes_kept"] = report.holes_kept;
    if (!report.holes_kept) out["blocked_at"] = report.blocked;
    out["inner_inside"] = report.has_inner ? nlohmann::ordered_json(report.inner_inside) : nullptr;
    if (!report.inner_inside) out["protruding_node"] = report.protruding_node;
    const auto& [modes, skin] = motion;
    out["modes_hold"] = modes ? nlohmann::ordered_json(modes->proved) : nullptr;
    if (modes && !modes->proved) out["failing_mode"] = {{"mode", modes->mode}, {"node", modes->node}};
    out["bones_hold"] = skin ? nlohmann::ordered_json(skin->proved) : nullptr;
    if (skin && !skin->proved) out["failing_bone"] = {{"bone", skin->bone}, {"node", skin->node}};
    out["baked_from_this_mesh"] = same_mesh;
    out["levels"] = nlohmann::ordered_json::array();
    for (const LevelProof& level : report.levels) {
        nlohmann::ordered_json one;
        one["covered"] = level.covered;
        one["pieces"] = level.pieces;
        if (level.has_counterexample) {
            one["counterexample"] = level.point;
            one["depth"] = level.depth;
        } else if (!level.covered) {
            one["undecided_at"] = level.point;
        }
        out["levels"].push_back(one);
    }
    return out.dump(2) + '\n';
}

std::string as_text(const VerifyReport& report, const MotionProofs& motion) {
    const auto& [modes, skin] = motion;
    std::string out;
    for (size_t l = 0; l < report.levels.size(); ++l) {
        const LevelProof& level = report.levels[l];
        const std::string point =
            fmt::format("({:.9g}, {:.9g}, {:.9g})", level.point[0], level.point[1], level.point[2]);
        if (level.covered)
            out += fmt::format("level {}: covered, proved with {} {}\n", l, grouped(level.pieces),
                               report.exact ? "triangles" : "pieces");
        else if (level.has_counterexample)
            out += fmt::format("level {}: NOT covered: {} lies in no ellipsoid, by {:.3g} of a radius\n", l, point,
                               level.depth);
        else
            out += fmt::format("level {}: not proved: undecided at {}\n", l, point);
    }
    if (report.exact)
        out += report.same_mesh ? "exact tree: its triangles are the mesh's\n"
                                : "exact tree: its triangles are NOT the mesh's\n";
    if (!report.bounded)
        out +=
            fmt::format("node {}: its bounding volume does NOT hold all ellipsoids below it, so queries may miss them; "
                        "bake again\n",
                        report.unbounded_node);
    if (!report.holes_kept)
        out += fmt::format("holes: NOT certainly free for the ball around ({:.9g}, {:.9g}, {:.9g})\n",
                           report.blocked[0], report.blocked[1], report.blocked[2]);
    if (report.has_inner)
        out += report.inner_inside ? "inner cover: inside the solid, proved\n"
                                   : fmt::format("inner cover: node {} does NOT certainly lie inside the solid\n",
                                                 report.protruding_node);
    if (modes)
        out += modes->proved
                   ? "modes: the nodes hold the mesh wherever they move it within the ranges, proved\n"
                   : fmt::format("modes: node {} does NOT certainly hold the mesh as mode {} moves it, or the "
                                 "tree was baked with another one\n",
                                 modes->node, modes->mode + 1);
    if (skin)
        out += skin->proved ? "bones: the nodes hold the mesh at all matrices, proved\n"
                            : fmt::format("bones: node {} does NOT certainly hold what bone {} moves, or the tree was "
                                          "baked with other weights\n",
                                          skin->node, skin->bone + 1);
    if (report.surface_mode) out += "surface mode: the mesh is open, so the proof is about its triangles only\n";
    out += report.covered ? "covered\n" : "NOT covered\n";
    return out;
}

// What the glTF's rig says, by the tree's ranges.
Outcome<MotionProofs> prove_rig(const TreeView& tree, const std::string& mesh, const Placement& placement) {
    auto rigged = read_rigged_mesh(mesh, placed_as(placement));
    if (!rigged) return rigged.error();
    const auto modes = tree.deformation();
    if (modes.has_value() == rigged->modes.empty() || tree.skin().has_value() == rigged->bones.empty())
        return Failure{kBadInput, mesh, "has another rig than the tree", "bake it with --skin"};
    MotionProofs out;
    if (modes) {
        rigged->ranges.clear();
        for (uint32_t m = 0; m < modes->mode_count(); ++m) rigged->ranges.push_back(modes->range(m));
        const auto proof = verify_modes(tree, rigged->mesh.view(), rigged->morphs());
        if (!proof) return failure_of(mesh, proof.error());
        out.modes = *proof;
    }
    if (tree.skin()) {
        const auto proof = verify_skin(tree, rigged->mesh.view(), rigged->skin());
        if (!proof) return failure_of(mesh, proof.error());
        out.skin = *proof;
    }
    return out;
}

Outcome<MotionProofs> prove_motion(const TreeView& tree, const Mesh& mesh, const VerifyArguments& a) {
    if (a.skin && !a.modes.empty())
        return Failure{kUsage, "--skin", "takes the file's morph targets for modes", "give it, or --modes"};
    if (a.skin) return prove_rig(tree, a.mesh, mesh.placement);
    if (!a.modes.empty()) {
        const auto known = prove_modes(tree, mesh, a.modes);
        return known ? Outcome<MotionProofs>(MotionProofs{known->proof, {}}) : Outcome<MotionProofs>(known.error());
    }
    if (tree.deformation()) note(a.tree, "this tree deforms, which is not proved without its modes; give --modes");
    if (tree.skin()) note(a.tree, "bones move this tree, which is not proved without them; give --skin");
    return MotionProofs{};
}

Outcome<ExitCode> run(const VerifyArguments& a) {
    use_available_threads();
    const auto tree = read_tree(a.tree);
    if (!tree) return tree.error();
    const auto mesh = read_mesh_of(tree->view(), a.mesh, a.mesh_options);
    if (!mesh) return mesh.error();
    const auto motion = prove_motion(tree->view(), mesh->as_read, a);
    if (!motion) return motion.error();
    const BakeInfo info = tree->view().bake_info();
    describe_mesh(a.mesh, mesh->cleaned.report, {.exact = info.exact, .filled = info.fill > 0});
    if (!mesh->own) note(a.tree, "this tree was baked from another mesh");
    const auto report = [&] {
        ProgressLine line;
        VerifyOptions options;
        options.threads = a.threads;
        options.progress = [&line](double fraction) { return line.show("prove", fraction); };
        return verify(tree->view(), mesh->as_read.view(), options);
    }();
    if (!report) return failure_of(a.mesh, report.error());
    print(a.json ? as_json(*report, *motion, mesh->own) : as_text(*report, *motion));
    return report->covered && motion->holds() ? kDone : kNo;
}

} // namespace

void add_verify(CLI::App& app, Work& chosen) {
    auto a = std::make_shared<VerifyArguments>();
    CLI::App* command = app.add_subcommand("verify", "Prove that every level of a tree covers a mesh");
    command->add_option("tree", a->tree, "the .etree file, or - for standard input")->required();
    command->add_option("mesh", a->mesh, "the mesh that it should cover, or - for standard input")->required();
    declare_mesh_options(*command, a->mesh_options, true);
    command->add_option("--modes", a->modes,
                        "how the mesh deforms, the file that bake had: proves that the nodes hold it");
    command->add_flag("--skin", a->skin, "of glTF and GLB: proves that the nodes hold it at all matrices of its bones");
    command->add_option("-j,--threads", a->threads, "0 = all cores")->capture_default_str();
    command->add_flag("--json", a->json, "print JSON");
    command->footer(kVerifyFooter);
    command->callback([&chosen, a] { chosen = [a] { return run(*a); }; });
}

} // namespace prolate::cli
