// Speed of contacts(): with the ground, and of a box with a box and a torus with a torus.
//
// Bodies rest: poses differ a little from step to step, and manifolds are kept, as in a simulator. Counters: points of
// contact, and tests of nodes and triangles, of a query.
//
//   bench_contacts --benchmark_repetitions=5 --benchmark_report_aggregates_only
#include "tests/exact_scenes.hpp"
#include "tests/scenes.hpp"
#include "tests/shapes.hpp"

#include <prolate/half_space.hpp>
#include <prolate/primitives.hpp>

#include <benchmark/benchmark.h>

#include <cmath>
#include <memory>
#include <numbers>
#include <utility>
#include <vector>

namespace prolate {
namespace {

constexpr size_t kPoses = 64;

// About `middle`, nearly level.
std::vector<Pose> poses_near(const Vec3& middle, double depth) {
    scenes::Random random(3);
    std::vector<Pose> out;
    for (size_t i = 0; i < kPoses; ++i) {
        const auto shake = [&](double by) { return static_cast<float>(random.in(-by, by)); };
        out.push_back({{middle.x + shake(0.01), middle.y + shake(0.01), middle.z + shake(0.1 * depth)},
                       {shake(1e-4), shake(1e-4), shake(0.3), 1}});
    }
    return out;
}

template <class Query> void measure(benchmark::State& state, const std::vector<Pose>& poses, Query&& query) {
    const auto context = std::make_unique<QueryContext>();
    ContactManifolds manifolds;
    uint64_t points = 0, tests = 0, step = 0;
    for (auto _ : state) {
        const ContactResult result = query(poses[step++ % kPoses], manifolds, *context);
        tests += result.stats.tests();
        for (uint32_t i = 0; i < manifolds.count; ++i) points += manifolds.manifolds[i].count;
    }
    state.counters["points"] = static_cast<double>(points) / static_cast<double>(step);
    state.counters["tests"] = static_cast<double>(tests) / static_cast<double>(step);
}

void on_ground(benchmark::State& state, const TreeView& tree, float lowest, double depth, bool anew = false) {
    measure(state, poses_near({0, 0, -lowest - static_cast<float>(depth)}, depth),
            [&](const Pose& pose, ContactManifolds& manifolds, QueryContext& context) {
                if (anew) manifolds = {};
                return contacts(tree, pose, {{0, 0, 1}, 0}, manifolds, context, {.margin = 0.001f});
            });
}

// A flange: a ring with a flat bottom, finely meshed.
Mesh flange() {
    Mesh mesh;
    constexpr uint32_t kAround = 100, kSides = 25;
    for (uint32_t i = 0; i < kAround; ++i)
        for (uint32_t k = 0; k < kSides; ++k) {
            const float angle = 2 * std::numbers::pi_v<float> * static_cast<float>(i) / static_cast<float>(kAround);
            const float t = static_cast<float>(k); // along the bottom, up, back, down
            const float r = k < 10 ? 0.5f + 0.05f * t : k < 13 ? 1 : k < 22 ? 1 - 0.05f * (t - 12) : 0.5f;
            const float z = k < 10 ? 0 : k < 13 ? 0.1f * (t - 9) : k < 22 ? 0.3f : 0.3f - 0.075f * (t - 21);
            mesh.vertices.push_back({r * std::cos(angle), r * std::sin(angle), z});
        }
    const auto at = [&](uint32_t i, uint32_t k) { return i % kAround * kSides + k % kSides; };
    for (uint32_t i = 0; i < kAround; ++i)
        for (uint32_t k = 0; k < kSides; ++k) {
            mesh.triangles.push_back({at(i, k), at(i + 1, k), at(i + 1, k + 1)});
            mesh.triangles.push_back({at(i, k), at(i + 1, k + 1), at(i, k + 1)});
        }
    return mesh;
}

void box_on_ground(benchmark::State& state) {
    const Tree box = std::move(*box_tree({0.5f, 0.5f, 0.5f}));
    on_ground(state, box.view(), -0.5f, 1e-3);
}
BENCHMARK(box_on_ground);
void cylinder_on_ground(benchmark::State& state) { // on its end
    const Tree cylinder = std::move(*cylinder_tree(0.5f, 0.5f, 128));
    on_ground(state, cylinder.view(), -0.5f, 1e-3);
}
BENCHMARK(cylinder_on_ground);
void flange_on_ground(benchmark::State& state) { // 5,000 triangles
    const scenes::ExactScene scene = scenes::exact_tree(flange());
    on_ground(state, *TreeView::open(scene.bytes), 0, 1e-3);
}
BENCHMARK(flange_on_ground);
void flange_lands(benchmark::State& state) { // nothing is known of an earlier step
    const scenes::ExactScene scene = scenes::exact_tree(flange());
    on_ground(state, *TreeView::open(scene.bytes), 0, 1e-3, true);
}
BENCHMARK(flange_lands);
void ball_rolls(benchmark::State& state) { // 5,120 triangles, half a degree a step
    const scenes::ExactScene scene = scenes::exact_tree(shapes::icosphere(4));
    const TreeView ball = *TreeView::open(scene.bytes);
    std::vector<Pose> poses;
    for (size_t i = 0; i < kPoses; ++i) {
        const float half = 0.25f * std::numbers::pi_v<float> / 180 * static_cast<float>(i);
        poses.push_back({{0, 0, 0.998f}, {std::sin(half), 0, 0, std::cos(half)}});
    }
    measure(state, poses, [&](const Pose& pose, ContactManifolds& manifolds, QueryContext& context) {
        return contacts(ball, pose, {{0, 0, 1}, 0}, manifolds, context, {.margin = 0.001f});
    });
}
BENCHMARK(ball_rolls);
void torus_on_ground(benchmark::State& state) { // 5,000 triangles
    const scenes::ExactScene scene = scenes::exact_tree(shapes::torus(1, 0.3f, 50, 50));
    on_ground(state, *TreeView::open(scene.bytes), -0.3f, 1e-3);
}
BENCHMARK(torus_on_ground);

void box_on_box(benchmark::State& state) {
    const Tree box = std::move(*box_tree({0.5f, 0.5f, 0.5f})), floor = std::move(*box_tree({2, 2, 0.5f}));
    measure(state, poses_near({0, 0, 0.999f}, 1e-3),
            [&](const Pose& pose, ContactManifolds& manifolds, QueryContext& context) {
                return contacts(floor.view(), {}, box.view(), pose, manifolds, context, {.margin = 0.001f});
            });
}
BENCHMARK(box_on_box);
void torus_on_torus(benchmark::State& state) { // 576 triangles
    const scenes::ExactScene scene = scenes::exact_tree(shapes::torus(1, 0.4f, 24, 12));
    const TreeView tree = *TreeView::open(scene.bytes);
    measure(state, poses_near({0.9f, 0, 0.7f}, 1e-3),
            [&](const Pose& pose, ContactManifolds& manifolds, QueryContext& context) {
                return contacts(tree, {}, tree, pose, manifolds, context, {.margin = 0.001f});
            });
}
BENCHMARK(torus_on_torus);

} // namespace
} // namespace prolate
