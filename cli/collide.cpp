// prolate collide: one query between two trees, for trying out and for scripts.
#include "cli/commands.hpp"
#include "cli/console.hpp"
#include "cli/grouped.hpp"
#include "cli/inputs.hpp"
#include "cli/pose.hpp"

#include <prolate/collide.hpp>
#include <prolate/distance.hpp>
#include <prolate/solids.hpp>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <optional>

namespace prolate::cli {
namespace {

constexpr const char* kCollideFooter = R"(
The pose is that of B in the frame of A: translation tx,ty,tz, then optionally the rotation as a quaternion
qx,qy,qz,qw of any length; B is rotated first. "separated" is certain. "overlapping" is about the covers; because
they stick out, the solids may still be separated. For exact trees, it is about their triangles, or about a body
inside the other. The distance is that of the same bodies, with certain bounds; the points are the nearest ones
found, in the frame of A. Nodes are named by their slots in the file, as in "export".

If both trees have inner covers ("bake --inner"), a further answer is about the solids, certain both ways: apart, meeting
(and at least how deep), or within the band that covers leave open, with bounds of their distance.

The exit code is 0 whatever the verdict. With --exit-code, 0 means separated, 1 overlapping, 6 undecided (--budget).

Examples:
  prolate collide horse.etree bunny.etree --pose 0.5,0,0
  prolate collide horse.etree bunny.etree --pose 0.5,0,0,0,0,0.7071,0.7071 --json
  prolate collide arm.etree table.etree --pose 0,0,0.8 --exit-code && echo free)";

struct CollideArguments {
    std::string tree_a, tree_b, pose = "0,0,0";
    std::optional<uint32_t> level;
    std::optional<uint64_t> budget;
    bool json = false, exit_code = false;
};

constexpr const char* kVerdicts[] = {"separated", "overlapping", "undecided"}; // by Verdict
constexpr ExitCode kVerdictCodes[] = {kDone, kNo, kUnknown};

uint32_t level_of(const TreeView& tree, uint32_t node) {
    uint32_t level = 0;
    while (level + 1 < tree.level_count() && tree.level(level + 1).first_slot <= node) ++level;
    return level;
}

nlohmann::ordered_json distance_json(const DistanceResult& distance) {
    nlohmann::ordered_json out{
        {"lower", distance.lower}, {"upper", nullptr}, {"point_a", nullptr}, {"point_b", nullptr}};
    if (!std::isfinite(distance.upper)) return out;
    out["upper"] = distance.upper;
    if (distance.verdict == Verdict::overlapping) return out;
    out["point_a"] = std::array<double, 3>{distance.point_a.x, distance.point_a.y, distance.point_a.z};
    out["point_b"] = std::array<double, 3>{distance.point_b.x, distance.point_b.y, distance.point_b.z};
    return out;
}

std::string distance_text(const DistanceResult& distance) {
    if (distance.verdict == Verdict::overlapping) return "distance 0\n";
    if (!std::isfinite(distance.upper)) return fmt::format("distance at least {:.6g}\n", distance.lower);
    const auto point = [](const Vec3& p) { return fmt::format("({:.6g}, {:.6g}, {:.6g})", p.x, p.y, p.z); };
    const bool close = distance.upper - distance.lower <= 1e-5 * distance.upper;
    return fmt::format("distance {}, from {} of A to {} of B\n",
                       close ? fmt::format("{:.6g}", distance.upper)
                             : fmt::format("{:.6g} to {:.6g}", distance.lower, distance.upper),
                       point(distance.point_a), point(distance.point_b));
}

// What is certain of the solids.
struct SolidsAnswer {
    bool known = false; // both have inner covers
    SolidsDistance distance;
    SolidsContacts contacts;
};
SolidsAnswer ask_solids(const TreeView& tree_a, const TreeView& tree_b, const Pose& pose, QueryContext& context,
                        const QueryOptions& options) {
    if (!tree_a.inner() || !tree_b.inner()) return {};
    const Solid a(tree_a, options.max_level), b(tree_b, options.max_level);
    ContactManifolds manifolds;
    return {true, distance(a, Pose{}, b, pose, context, {.max_pair_tests = options.max_pair_tests}),
            contacts(a, Pose{}, b, pose, manifolds, context, {.max_pair_tests = options.max_pair_tests})};
}

nlohmann::ordered_json solids_json(const SolidsAnswer& solids) {
    const auto finite = [](double x) { return std::isfinite(x) ? nlohmann::ordered_json(x) : nullptr; };
    return {{"verdict", kVerdicts[static_cast<size_t>(solids.contacts.verdict)]},
            {"lower", solids.distance.lower},
            {"upper", finite(solids.distance.upper)},
            {"depth_lower", solids.contacts.depth_lower},
            {"depth_upper", finite(solids.contacts.depth_upper)}};
}

std::string solids_text(const SolidsAnswer& solids) {
    const SolidsDistance& d = solids.distance;
    const auto between = [](double lower, double upper) {
        return std::isfinite(upper) ? fmt::format("{:.6g} to {:.6g}", lower, upper)
                                    : fmt::format("at least {:.6g}", lower);
    };
    switch (solids.contacts.verdict) {
    case Verdict::separated:
        return fmt::format("solids: certainly apart, {}\n", between(d.lower, d.upper));
    case Verdict::overlapping:
        return fmt::format("solids: certainly meet, depth {}\n",
                           between(solids.contacts.depth_lower, solids.contacts.depth_upper));
    case Verdict::undecided:
        break;
    }
    return fmt::format("solids: within the band, distance {}\n", between(d.lower, d.upper));
}

// All answers to the one question.
struct Answer {
    CollideResult collide;
    DistanceResult distance;
    SolidsAnswer solids;
};

std::string as_json(const Answer& answer) {
    using Json = nlohmann::ordered_json;
    const CollideResult& result = answer.collide;
    const bool meet = result.verdict == Verdict::overlapping;
    const auto triangle = [](uint32_t t) { return t == kNoTriangle ? nullptr : Json(t); };
    Json out;
    out["verdict"] = kVerdicts[static_cast<size_t>(result.verdict)];
    out["node_a"] = meet ? Json(result.pair.node_a) : nullptr;
    out["node_b"] = meet ? Json(result.pair.node_b) : nullptr;
    out["triangle_a"] = triangle(result.pair.triangle_a);
    out["triangle_b"] = triangle(result.pair.triangle_b);
    out["distance"] = distance_json(answer.distance);
    if (answer.solids.known) out["solids"] = solids_json(answer.solids);
    out["enclosed"] = result.enclosed;
    out["pair_tests"] = result.stats.pair_tests;
    out["block_tests"] = result.stats.block_tests;
    out["triangle_tests"] = result.stats.triangle_tests;
    out["deepest_level"] = result.stats.deepest_level;
    return out.dump(2) + '\n';
}

std::string as_text(const Answer& answer, const TreeView& tree_a, const TreeView& tree_b) {
    const CollideResult& result = answer.collide;
    const auto part = [](const TreeView& tree, uint32_t node, uint32_t triangle, char body) {
        return triangle == kNoTriangle ? fmt::format("node {} of {} (level {})", node, body, level_of(tree, node))
                                       : fmt::format("triangle {} of {}", triangle, body);
    };
    std::string out = kVerdicts[static_cast<size_t>(result.verdict)];
    if (result.verdict == Verdict::overlapping)
        out += result.enclosed
                   ? ": a part of one lies inside the other"
                   : fmt::format(": {} and {} meet", part(tree_a, result.pair.node_a, result.pair.triangle_a, 'A'),
                                 part(tree_b, result.pair.node_b, result.pair.triangle_b, 'B'));
    return out + '\n' + distance_text(answer.distance) + (answer.solids.known ? solids_text(answer.solids) : "") +
           fmt::format("{} pair tests, {} block tests, {} triangle tests, deepest level {}\n",
                       grouped(result.stats.pair_tests), grouped(result.stats.block_tests),
                       grouped(result.stats.triangle_tests), result.stats.deepest_level);
}

Outcome<ExitCode> run(const CollideArguments& a) {
    const auto pose = parse_pose(a.pose);
    if (!pose) return pose.error();
    const auto file_a = read_tree(a.tree_a);
    if (!file_a) return file_a.error();
    const auto file_b = read_tree(a.tree_b);
    if (!file_b) return file_b.error();
    const TreeView tree_a = file_a->view(), tree_b = file_b->view();
    if (const uint32_t levels = std::max(tree_a.level_count(), tree_b.level_count()); a.level && *a.level >= levels)
        return Failure{kUsage, "--level", fmt::format("neither tree has a level {}", *a.level),
                       fmt::format("their levels are 0 to {}", levels - 1)};
    QueryOptions options;
    options.max_level = a.level.value_or(options.max_level);
    options.max_pair_tests = a.budget.value_or(options.max_pair_tests);
    DistanceOptions distance_options;
    distance_options.max_level = options.max_level;
    distance_options.max_pair_tests = options.max_pair_tests;
    QueryContext context;
    const Answer answer{collide(tree_a, Pose{}, tree_b, *pose, context, options),
                        distance(tree_a, Pose{}, tree_b, *pose, context, distance_options),
                        ask_solids(tree_a, tree_b, *pose, context, options)};
    print(a.json ? as_json(answer) : as_text(answer, tree_a, tree_b));
    return a.exit_code ? kVerdictCodes[static_cast<size_t>(answer.collide.verdict)] : kDone;
}

} // namespace

void add_collide(CLI::App& app, Work& chosen) {
    auto a = std::make_shared<CollideArguments>();
    CLI::App* command = app.add_subcommand("collide", "Ask whether two trees meet");
    command->add_option("a", a->tree_a, "the .etree file of body A, or - for standard input")->required();
    command->add_option("b", a->tree_b, "the .etree file of body B, or - for standard input")->required();
    command->add_option("--pose", a->pose, "of B in the frame of A: tx,ty,tz[,qx,qy,qz,qw]")->capture_default_str();
    command->add_option("--level", a->level, "look no deeper than this level (default: all)");
    command->add_option("--budget", a->budget,
                        "stop undecided after this many tests of nodes and triangles (default: never)");
    command->add_flag("--exit-code", a->exit_code, "report the verdict by the exit code as well; see below");
    command->add_flag("--json", a->json, "print JSON");
    command->footer(kCollideFooter);
    command->callback([&chosen, a] { chosen = [a] { return run(*a); }; });
}

} // namespace prolate::cli
