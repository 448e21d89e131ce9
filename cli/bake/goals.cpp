#include "cli/bake/goals.hpp"

#include "cli/grouped.hpp"
#include "cli/length.hpp"
#include "cli/levels.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <tuple>
#include <vector>

namespace prolate::cli {
namespace {

// What was reached is asked for again with so much to spare: a second search ends elsewhere.
constexpr double kSpare = 1.02;

// The unit in which a length was asked for; metres if in none.
const LengthUnit& unit_of(const std::string& text) {
    const auto length = read_length("", text);
    return length ? *length->unit : *find_length_unit("m");
}

struct Size {
    double diagonal, longest;
};
Size size_of(MeshView mesh) {
    double low[3] = {HUGE_VAL, HUGE_VAL, HUGE_VAL}, high[3] = {-HUGE_VAL, -HUGE_VAL, -HUGE_VAL};
    for (const Vec3& v : mesh.vertices)
        for (size_t k = 0; const float x : {v.x, v.y, v.z}) {
            low[k] = std::min(low[k], double{x}), high[k] = std::max(high[k], double{x});
            ++k;
        }
    const double size[] = {high[0] - low[0], high[1] - low[1], high[2] - low[2]};
    return {std::hypot(size[0], size[1], size[2]), std::max({size[0], size[1], size[2]})};
}

// At least `value`, to three digits.
std::string at_least(double value) {
    const double step = std::pow(10, std::floor(std::log10(value)) - 2);
    return fmt::format("{:.3g}", std::ceil(value / step) * step);
}

} // namespace

Outcome<> check_lengths(const Asset& asset, const BuildOptions& options, MeshView mesh) {
    const auto [diagonal, longest] = size_of(mesh);
    const double least = least_clearance(diagonal, options.quality);
    if (options.clearance > 0 && double{options.clearance} < least)
        return Failure{kUsage, "--clearance",
                       fmt::format("{} is finer than can be told of a mesh {} in diagonal", asset.clearance,
                                   rounded_up(diagonal, unit_of(asset.clearance))),
                       fmt::format("the least is {}{}; does --unit say what the mesh's numbers are?",
                                   rounded_up(least, unit_of(asset.clearance)),
                                   options.quality == Quality::fast ? ", or a tenth with --quality normal" : "")};
    if (options.distance > 0 && 0.01 * double{options.distance} * diagonal < least * (1 - 1e-6))
        return Failure{kUsage, "--distance", fmt::format("{:g} % is finer than can be told", options.distance),
                       options.quality == Quality::fast ? "the least is 0.1, or 0.01 with --quality normal"
                                                        : "the least is 0.01"};
    const BallRange balls = ball_range(longest);
    for (const auto& [option, text, radius] : {std::tuple{"--fill", asset.fill, options.fill},
                                               std::tuple{"--keep-holes", asset.keep_holes, options.keep_holes}}) {
        const bool small = double{radius}<balls.least, large = double{radius}> balls.most;
        if (radius == 0 || !(small || large)) continue;
        const LengthUnit& unit = unit_of(text);
        return Failure{kUsage, option,
                       fmt::format("a ball of radius {} is too {} for a mesh whose longest side is {}", text,
                                   small ? "small" : "large", rounded_up(longest, unit)),
                       small ? fmt::format("the least is {}; does --unit say what the mesh's numbers are?",
                                           rounded_up(balls.least, unit))
                             : fmt::format("the largest is {}", rounded_down(balls.most, unit))};
    }
    return kSuccess;
}

Outcome<> check_closeness(const Asset& asset, const Baked& baked) {
    const TreeView tree = baked.tree.view();
    const BakeInfo info = tree.bake_info();
    const bool asked = info.tolerance > 0 || info.distance > 0 || info.keep_holes > 0;
    if (info.goal_reached || !asked) return kSuccess;
    const LevelInfo leaves = tree.level(tree.level_count() - 1);
    const double diagonal = info.diagonal, reached = leaves.hausdorff_max;
    std::vector<std::string> misses, nearest;
    if (info.tolerance > 0 && leaves.outside_ratio > double{info.tolerance}) {
        misses.push_back(
            fmt::format("an outside ratio of {:.3g} instead of {:g}", leaves.outside_ratio, info.tolerance));
        nearest.push_back("--tolerance " + at_least(kSpare * leaves.outside_ratio));
    }
    if (info.distance > 0 && reached > 0.01 * double{info.distance} * diagonal) {
        const bool by_length = !asset.clearance.empty();
        const LengthUnit& unit = unit_of(asset.clearance);
        const double asked_for = 0.01 * double{info.distance} * diagonal;
        misses.push_back(by_length ? fmt::format("a clearance of {} instead of {}", rounded_up(reached, unit),
                                                 rounded_up(asked_for * (1 - 1e-6), unit))
                                   : fmt::format("a distance of {:.3g} % instead of {:.3g} %", 100 * reached / diagonal,
                                                 info.distance));
        nearest.push_back(by_length ? "--clearance " + rounded_up(kSpare * reached, unit)
                                    : "--distance " + at_least(100 * kSpare * reached / diagonal));
    }
    if (info.keep_holes > 0 && baked.hole_radius < double{info.keep_holes}) {
        const LengthUnit& unit = unit_of(asset.keep_holes);
        if (baked.hole_radius > 0) {
            misses.push_back(fmt::format("holes for a ball of {} instead of {}", rounded_down(baked.hole_radius, unit),
                                         asset.keep_holes));
            nearest.push_back("--keep-holes " + rounded_down(baked.hole_radius / kSpare, unit));
        } else {
            misses.push_back(fmt::format("no free hole instead of one for a ball of {}", asset.keep_holes));
        }
    }
    const uint32_t count = cut_size(tree, tree.level_count() - 1);
    return Failure{kNo, asset.mesh,
                   fmt::format("{}{} ellipsoid{} reach{} {}", info.ellipsoids > 0 ? "at most " : "", grouped(count),
                               count == 1 ? "" : "s", count == 1 ? "es" : "", fmt::join(misses, " and ")),
                   (nearest.empty() ? std::string()
                                    : fmt::format("the nearest that can be had is {}, or ", fmt::join(nearest, " "))) +
                       (info.ellipsoids > 0 ? "give more --ellipsoids" : "try --quality best")};
}

} // namespace prolate::cli
