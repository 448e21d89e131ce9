// Cached queries along motions: what a PairCache spares, or costs.
//
//   bench_moving TREE.etree... [--poses N] [--steps N] [--gap SHARE]
//
// A body meets itself: B, turned at random, comes along a random direction until it meets A, and backs off by a random
// part of --gap, a share of the diagonal. From there it moves on, straight or each step in another direction, by steps
// of so many shares of the diagonal. For each size of step, a row: CPU time of collide() with a cache as a share of
// that without, the median of rounds that take turns; both with the cache empty at first, and with one that has seen as
// many steps before; blocks tested a query, without a cache and with one; and the share of queries that needed no test.
#include "tests/scenes.hpp"

#include <prolate/collide.hpp>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include <algorithm>
#include <ctime>
#include <memory>
#include <string>
#include <vector>

namespace prolate {
namespace {

using scenes::Point;

constexpr double kStepSizes[] = {1e-4, 5e-4, 1e-3, 2e-3, 4e-3, 1.6e-2}; // shares of the diagonal
constexpr int kRounds = 7;

struct Settings {
    size_t poses = 200, steps = 16;
    double gap = 0.01;
};
using Motion = std::vector<Pose>; // of B

double thread_seconds() {
    timespec t{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

double median(std::vector<double> values) {
    std::nth_element(values.begin(), values.begin() + kRounds / 2, values.end());
    return values[kRounds / 2];
}

std::vector<Motion> motions(const TreeView& tree, double step, bool straight, const Settings& settings,
                            QueryContext& context) {
    scenes::Random random(1);
    const double diagonal = tree.bake_info().diagonal;
    const Vec3 middle = tree.ellipsoid(0).center;
    std::vector<Motion> out(settings.poses);
    for (Motion& motion : out) {
        const Point direction = random.direction();
        Pose pose{{}, random.rotation()};
        const Point turned = scenes::rotate(pose.rotation, {middle.x, middle.y, middle.z});
        Point at{middle.x - turned[0], middle.y - turned[1], middle.z - turned[2]};
        const auto move = [&](double t, const Point& along) {
            for (size_t k = 0; k < 3; ++k) at[k] += t * along[k];
            pose.translation = scenes::to_float(at);
        };
        const Point start = at;
        double meets = 0, apart = 2 * diagonal;
        while (apart - meets > 1e-4 * diagonal) {
            const double between = 0.5 * (meets + apart);
            at = start, move(between, direction);
            (collide(tree, {}, tree, pose, context).verdict == Verdict::overlapping ? meets : apart) = between;
        }
        at = start, move(apart + settings.gap * diagonal * random.in(0, 1), direction);
        const Point ahead = random.direction();
        for (size_t i = 0; i < 2 * settings.steps; ++i) {
            motion.push_back(pose);
            move(step * diagonal, straight ? ahead : random.direction());
        }
    }
    return out;
}

struct Cost {
    double seconds = 0;
    uint64_t blocks = 0, untested = 0;
};

// All motions' first steps, or later ones, after a cache has seen the first.
Cost cost_of(const TreeView& tree, const std::vector<Motion>& all, bool cached, bool later, QueryContext& context) {
    Cost out;
    for (const Motion& motion : all) {
        PairCache cache;
        PairCache* const used = cached ? &cache : nullptr;
        const auto half = std::span(motion).first(motion.size() / 2), rest = std::span(motion).last(half.size());
        const auto ask = [&](const Pose& pose) { return collide(tree, {}, tree, pose, context, {}, used); };
        if (later)
            for (const Pose& pose : half) ask(pose);
        const double start = thread_seconds();
        for (const Pose& pose : later ? rest : half) {
            const CollideResult r = ask(pose);
            out.blocks += r.stats.block_tests, out.untested += r.stats.tests() == 0;
        }
        out.seconds += thread_seconds() - start;
    }
    return out;
}

void print_row(const TreeView& tree, double step, bool straight, const Settings& settings, QueryContext& context) {
    const std::vector<Motion> all = motions(tree, step, straight, settings, context);
    const auto queries = static_cast<double>(settings.poses * settings.steps);
    fmt::print("  {:8.4f} {:>9}", step, straight ? "straight" : "random");
    for (const bool later : {false, true}) {
        std::vector<double> shares;
        Cost without, with;
        for (int round = 0; round < kRounds; ++round) {
            without = cost_of(tree, all, false, later, context), with = cost_of(tree, all, true, later, context);
            shares.push_back(with.seconds / without.seconds);
        }
        fmt::print("  {:7.2f} {:7.1f} {:7.1f} {:8.2f}", median(shares), static_cast<double>(without.blocks) / queries,
                   static_cast<double>(with.blocks) / queries, static_cast<double>(with.untested) / queries);
    }
    fmt::print("\n");
}

int run(const std::vector<std::string>& files, const Settings& settings) {
    const auto context = std::make_unique<QueryContext>();
    for (const std::string& file : files) {
        const auto tree = load(file.c_str());
        if (!tree) return fmt::print(stderr, "bench_moving: {}: {}\n", file, tree.error().what), 1;
        fmt::print("{}\n  {:>8} {:>9}  {:>32}  {:>32}\n", file, "step", "", "first: time blocks cached untested",
                   "later: time blocks cached untested");
        for (const double step : kStepSizes)
            for (const bool straight : {false, true}) print_row(tree->view(), step, straight, settings, *context);
    }
    return 0;
}

} // namespace
} // namespace prolate

int main(int argc, char** argv) {
    CLI::App app("Queries with a cache along motions, beside those without");
    std::vector<std::string> files;
    prolate::Settings settings;
    app.add_option("files", files, "trees (.etree)")->required();
    app.add_option("--poses", settings.poses, "motions")->capture_default_str();
    app.add_option("--steps", settings.steps, "timed in turn")->capture_default_str();
    app.add_option("--gap", settings.gap, "at the start, at most; a share of the diagonal")->capture_default_str();
    CLI11_PARSE(app, argc, argv);
    return prolate::run(files, settings);
}
