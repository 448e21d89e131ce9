// Rays through a World of many bodies: cast in one call, and one by one.
//
//   bench_world_rays TREE.etree [--bodies N] [--rays N] [--room X]
//
// Copies of a body lie at random in a box. Rays are those of a picture of it,
// row by row, or random ones. For each, CPU time of a ray cast by itself, of one cast with all others, and the ratio,
// as medians of rounds that take turns. The program fails if an answer differs.
#include "tests/scenes.hpp"

#include <prolate/world_queries.hpp>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <memory>
#include <string>
#include <vector>

namespace prolate {
namespace {

constexpr int kRounds = 9;

double thread_seconds() {
    timespec t{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

double median(std::vector<double> values) {
    std::nth_element(values.begin(), values.begin() + kRounds / 2, values.end());
    return values[kRounds / 2];
}

std::vector<Ray> rays_of(bool picture, uint32_t count, double half) {
    scenes::Random random(2);
    std::vector<Ray> out;
    const auto side = static_cast<uint32_t>(std::sqrt(count));
    for (uint32_t i = 0; i < side * side; ++i) {
        const auto at = [&](uint32_t k) { return half * (2.0 * k / side - 1); };
        const scenes::Point from = picture ? scenes::Point{0, 0, 4 * half} : random.direction(),
                            to = picture ? scenes::Point{at(i % side), at(i / side), 0} : random.in_ball();
        const double far = picture ? 1 : 4 * half, near = picture ? 1 : half;
        out.push_back({scenes::to_float({far * from[0], far * from[1], far * from[2]}),
                       scenes::to_float({near * to[0] - far * from[0], near * to[1] - far * from[1],
                                         near * to[2] - far * from[2]})});
    }
    return out;
}

int run(const std::string& file, uint32_t bodies, uint32_t count, double room) {
    const auto tree = load(file.c_str());
    if (!tree) return fmt::print(stderr, "bench_world_rays: {}: {}\n", file, tree.error().what), 1;
    World world = *World::create();
    scenes::Random random(1);
    const double half = 0.5 * tree->view().bake_info().diagonal * std::cbrt(room * bodies);
    for (uint32_t i = 0; i < bodies; ++i) {
        const auto in = [&] { return random.in(-half, half); };
        const double x = in(), y = in(), z = in();
        if (!world.insert({.shape = tree->view(), .pose = {scenes::to_float({x, y, z}), random.rotation()}})) return 1;
    }
    const auto context = std::make_unique<QueryContext>();
    const Workers workers{{context.get(), 1}};
    fmt::print("{} bodies, us a ray: one by one, together, ratio; share that hits\n", bodies);
    for (const bool picture : {true, false}) {
        const std::vector<Ray> rays = rays_of(picture, count, half);
        std::vector<RayHit> alone(rays.size()), together(rays.size());
        std::vector<double> one, all, ratio;
        for (int round = 0; round < kRounds; ++round) {
            const double start = thread_seconds();
            for (size_t i = 0; i < rays.size(); ++i)
                if (!raycast(world, {&rays[i], 1}, {&alone[i], 1}, workers)) return 1;
            const double middle = thread_seconds();
            if (!raycast(world, rays, together, workers)) return 1;
            const double end = thread_seconds(), each = 1e6 / static_cast<double>(rays.size());
            one.push_back(each * (middle - start)), all.push_back(each * (end - middle));
            ratio.push_back((end - middle) / (middle - start));
        }
        size_t hits = 0;
        for (size_t i = 0; i < rays.size(); ++i) {
            hits += alone[i].result.verdict == Verdict::overlapping;
            if (alone[i].body != together[i].body || alone[i].result.t != together[i].result.t)
                return fmt::print(stderr, "bench_world_rays: ray {} has two answers\n", i), 1;
        }
        fmt::print("  {:8} {:7.3f} {:7.3f} {:6.2f} {:6.2f}\n", picture ? "picture" : "random", median(one), median(all),
                   median(ratio), static_cast<double>(hits) / static_cast<double>(rays.size()));
    }
    return 0;
}

} // namespace
} // namespace prolate

int main(int argc, char** argv) {
    CLI::App app("Rays through a World: many in one call, and one by one");
    std::string file;
    uint32_t bodies = 100, rays = 16384;
    double room = 10;
    app.add_option("file", file, "a tree (.etree)")->required();
    app.add_option("--bodies", bodies, "copies of it")->capture_default_str();
    app.add_option("--rays", rays, "of each kind")->capture_default_str();
    app.add_option("--room", room, "of the box, for each body; cubes of its diagonal")->capture_default_str();
    CLI11_PARSE(app, argc, argv);
    return prolate::run(file, bodies, rays, room);
}
