// prolate collide: one query between two trees, for trying out and for scripts.
#include "cli/common.hpp"
#include "cli/pose.hpp"

#include <prolate/collide.hpp>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <memory>

namespace prolate::cli {
namespace {

constexpr const char* kFooter = R"(
The pose is that of B in the frame of A: translation tx,ty,tz, then optionally the rotation as a quaternion
qx,qy,qz,qw of any length; B is rotated first. "separated" is certain. "overlapping" speaks of the covers: the solids
may still be apart by what the covers stick out. Of exact trees, it speaks of their triangles, or of a body inside the
other. The exit code is 0 whatever the verdict.

Examples:
  prolate collide horse.etree bunny.etree --pose 0.5,0,0
  prolate collide horse.etree bunny.etree --pose 0.5,0,0,0,0,0.7071,0.7071 --json)";

struct CollideArguments {
    std::string tree_a, tree_b, pose = "0,0,0";
    std::optional<uint32_t> level;
    std::optional<uint64_t> budget;
    bool json = false;
};

constexpr const char* kVerdicts[] = {"separated", "overlapping", "undecided"};

int run(const CollideArguments& a) {
    const auto pose = parse_pose(a.pose);
    if (!pose) return complain_of_pose();
    int code = kDone;
    const auto tree_a = read_tree(a.tree_a, code);
    if (!tree_a) return code;
    const auto tree_b = read_tree(a.tree_b, code);
    if (!tree_b) return code;
    QueryOptions options;
    options.max_level = a.level.value_or(options.max_level);
    options.max_pair_tests = a.budget.value_or(options.max_pair_tests);
    QueryContext context;
    const CollideResult result = collide(tree_a->view(), Pose{}, tree_b->view(), *pose, context, options);
    const char* verdict = kVerdicts[static_cast<size_t>(result.verdict)];
    const bool meet = result.verdict == Verdict::overlapping;
    if (a.json) {
        nlohmann::ordered_json out;
        out["verdict"] = verdict;
        out["node_a"] = meet ? nlohmann::ordered_json(result.pair.node_a) : nullptr;
        out["node_b"] = meet ? nlohmann::ordered_json(result.pair.node_b) : nullptr;
        const auto triangle = [](uint32_t t) { return t == kNoTriangle ? nullptr : nlohmann::ordered_json(t); };
        out["triangle_a"] = triangle(result.pair.triangle_a);
        out["triangle_b"] = triangle(result.pair.triangle_b);
        out["enclosed"] = result.enclosed;
        out["pair_tests"] = result.stats.pair_tests;
        out["block_tests"] = result.stats.block_tests;
        out["triangle_tests"] = result.stats.triangle_tests;
        out["deepest_level"] = result.stats.deepest_level;
        print(out.dump(2) + '\n');
        return kDone;
    }
    const auto part = [](uint32_t node, uint32_t triangle) {
        return triangle == kNoTriangle ? fmt::format("node {}", node) : fmt::format("triangle {}", triangle);
    };
    print(!meet ? fmt::format("{}\n", verdict)
          : result.enclosed
              ? fmt::format("{}: a part of one lies inside the other\n", verdict)
              : fmt::format("{}: {} of A and {} of B meet\n", verdict, part(result.pair.node_a, result.pair.triangle_a),
                            part(result.pair.node_b, result.pair.triangle_b)));
    print(fmt::format("{} pair tests, {} block tests, {} triangle tests, deepest level {}\n",
                      grouped(result.stats.pair_tests), grouped(result.stats.block_tests),
                      grouped(result.stats.triangle_tests), result.stats.deepest_level));
    return kDone;
}

} // namespace

void add_collide(CLI::App& app, Work& chosen) {
    auto a = std::make_shared<CollideArguments>();
    CLI::App* command = app.add_subcommand("collide", "Ask whether two trees meet");
    command->add_option("a", a->tree_a, "the .etree file of body A")->required();
    command->add_option("b", a->tree_b, "the .etree file of body B")->required();
    command->add_option("--pose", a->pose, "of B in the frame of A: tx,ty,tz[,qx,qy,qz,qw]")->capture_default_str();
    command->add_option("--level", a->level, "look no deeper than this level (default: all)");
    command->add_option("--budget", a->budget,
                        "stop undecided after so many tests of nodes and triangles (default: never)");
    command->add_flag("--json", a->json, "print JSON");
    command->footer(kFooter);
    command->callback([&chosen, a] { chosen = [a] { return run(*a); }; });
}

} // namespace prolate::cli
