// Speed of a World's broadphase: N bodies that all move and turn a little in every step, beside Bullet's
// btDbvtBroadphase where its headers are installed.
//
// A step of `world` is move() for all bodies, boxes included, and update_pairs(). Bullet is handed the same tight
// boxes, computed beforehand, so its steps (`bullet`) are to be compared with `world` less `world_boxes`, what the
// boxes cost. Counters: pairs, bodies whose box changed, boxes compared, per step; and a hash of the pairs. Bullet's
// boxes grow by an absolute 0.05, and never shrink, so its pairs differ a little.
//
//   bench_world --benchmark_repetitions=5 --benchmark_report_aggregates_only
#include "tests/scenes.hpp"

#include <prolate/world.hpp>

#include <benchmark/benchmark.h>

#ifdef PROLATE_BENCH_BULLET
#include <BulletCollision/BroadphaseCollision/btDbvtBroadphase.h>
#endif

#include <cmath>
#include <memory>
#include <vector>

namespace prolate {
namespace {

using scenes::Random;

constexpr uint32_t kSteps = 64; // then back again, so that a loop over them is one long motion

// Bodies of size 1 to 2 in a cube in which a body has about three neighbours. A step moves them by about 0.02.
struct Motion {
    std::vector<scenes::Scene> solids;
    std::vector<TreeView> trees;          // of each body
    std::vector<std::vector<Pose>> poses; // of each step

    explicit Motion(uint32_t count) {
        Random random(1);
        for (uint32_t i = 0; i < 4; ++i)
            solids.push_back(scenes::tree(random, scenes::cloud(random, 512), {.levels = 3}));
        const double side = 1.5 * std::cbrt(count);
        poses.resize(kSteps);
        for (uint32_t i = 0; i < count; ++i) {
            trees.push_back(*TreeView::open(solids[i % 4].bytes));
            Pose pose{{}, random.rotation()};
            const auto start = [&] { return static_cast<float>(random.in(0, side)); };
            pose.translation.x = start(), pose.translation.y = start(), pose.translation.z = start();
            const auto d = random.direction(), spin = random.in_ball();
            for (uint32_t step = 0; step < kSteps; ++step) {
                poses[step].push_back(pose);
                pose.translation.x += static_cast<float>(0.02 * d[0]);
                pose.translation.y += static_cast<float>(0.02 * d[1]);
                pose.translation.z += static_cast<float>(0.02 * d[2]);
                pose.rotation.x += static_cast<float>(0.02 * spin[0]);
                pose.rotation.y += static_cast<float>(0.02 * spin[1]);
            }
        }
    }
    const std::vector<Pose>& at(uint64_t step) const {
        const uint64_t k = step % (2 * kSteps - 2);
        return poses[k < kSteps ? k : 2 * kSteps - 2 - k];
    }
};

void world(benchmark::State& state) {
    const Motion motion(static_cast<uint32_t>(state.range(0)));
    World world = *World::create();
    std::vector<BodyId> ids;
    for (size_t i = 0; i < motion.trees.size(); ++i)
        ids.push_back(*world.insert({.shape = motion.trees[i], .pose = motion.at(0)[i]}));
    uint64_t step = 0, pairs = 0, changed = 0, tests = 0, hash = 0;
    (void)world.update_pairs();
    for (auto _ : state) {
        benchmark::DoNotOptimize(world.move(ids, motion.at(++step)));
        const auto list = world.update_pairs();
        pairs += list->size(), changed += world.stats().changed, tests += world.stats().box_tests;
        if (step < kSteps)
            for (const BodyPair& p : *list) hash = (hash ^ p.a.index) * 0x100000001b3u + p.b.index;
    }
    const auto per_step = [&](uint64_t n) { return static_cast<double>(n) / static_cast<double>(step); };
    state.counters["pairs"] = per_step(pairs);
    state.counters["changed"] = per_step(changed);
    state.counters["box_tests"] = per_step(tests);
    state.counters["hash"] = static_cast<double>(hash >> 12);
}
BENCHMARK(world)->Arg(1000)->Arg(10000)->Unit(benchmark::kMicrosecond)->Iterations(256);

// The part of `world` that the boxes take.
void world_boxes(benchmark::State& state) {
    const Motion motion(static_cast<uint32_t>(state.range(0)));
    // Never out of a box with so much slack, and never in need of another body's.
    World world = *World::create({.slack = 1});
    std::vector<BodyId> ids;
    for (size_t i = 0; i < motion.trees.size(); ++i)
        ids.push_back(*world.insert({.shape = motion.trees[i], .pose = motion.at(0)[i]}));
    uint64_t step = 0;
    for (auto _ : state) benchmark::DoNotOptimize(world.move(ids, motion.at(++step)));
}
BENCHMARK(world_boxes)->Arg(1000)->Arg(10000)->Unit(benchmark::kMicrosecond)->Iterations(256);

#ifdef PROLATE_BENCH_BULLET
void bullet(benchmark::State& state) {
    const Motion motion(static_cast<uint32_t>(state.range(0)));
    std::vector<std::vector<Bounds>> boxes(kSteps);
    for (uint32_t step = 0; step < kSteps; ++step)
        for (size_t i = 0; i < motion.trees.size(); ++i)
            boxes[step].push_back(bounds(motion.trees[i], motion.poses[step][i]));
    const auto low = [](const Bounds& b) { return btVector3(b.lower.x, b.lower.y, b.lower.z); };
    const auto high = [](const Bounds& b) { return btVector3(b.upper.x, b.upper.y, b.upper.z); };
    btDbvtBroadphase broadphase;
    std::vector<btBroadphaseProxy*> proxies;
    for (const Bounds& b : boxes[0])
        proxies.push_back(broadphase.createProxy(low(b), high(b), 0, nullptr, 1, -1, nullptr));
    broadphase.calculateOverlappingPairs(nullptr);
    uint64_t step = 0, pairs = 0;
    for (auto _ : state) {
        const uint64_t k = ++step % (2 * kSteps - 2);
        const auto& now = boxes[k < kSteps ? k : 2 * kSteps - 2 - k];
        for (size_t i = 0; i < proxies.size(); ++i) broadphase.setAabb(proxies[i], low(now[i]), high(now[i]), nullptr);
        broadphase.calculateOverlappingPairs(nullptr);
        pairs += static_cast<uint64_t>(broadphase.getOverlappingPairCache()->getNumOverlappingPairs());
    }
    state.counters["pairs"] = static_cast<double>(pairs) / static_cast<double>(step);
    for (btBroadphaseProxy* proxy : proxies) broadphase.destroyProxy(proxy, nullptr);
}
BENCHMARK(bullet)->Arg(1000)->Arg(10000)->Unit(benchmark::kMicrosecond)->Iterations(256);
#endif

} // namespace
} // namespace prolate
