// The oneTBB adapter keeps the promises of Jobs.
#include "tests/scenes.hpp"

#include <prolate/tbb.hpp>
#include <prolate/world_queries.hpp>

#include <gtest/gtest.h>

#include <atomic>
#include <vector>

namespace prolate {
namespace {

TEST(Tbb, CutsEverythingOnceAndSharesNoWorker) {
    oneapi::tbb::task_arena arena(4);
    const Jobs jobs = tbb_jobs(arena);
    EXPECT_EQ(jobs.workers, 4u);
    struct Job {
        std::vector<std::atomic<uint32_t>> visits = std::vector<std::atomic<uint32_t>>(20000);
        std::vector<std::atomic<uint32_t>> busy = std::vector<std::atomic<uint32_t>>(4);
        std::atomic<uint32_t> clashes{0};
    } job;
    for (uint32_t round = 0; round < 20; ++round)
        jobs.run(
            jobs.user, 20000, round,
            [](void* user, uint32_t begin, uint32_t end, uint32_t worker) {
                Job& j = *static_cast<Job*>(user);
                j.clashes += worker >= 4 || j.busy[worker].exchange(1) != 0;
                for (uint32_t i = begin; i < end; ++i) ++j.visits[i];
                j.busy[worker] = 0;
            },
            &job);
    EXPECT_EQ(job.clashes, 0u);
    for (const auto& visits : job.visits) EXPECT_EQ(visits, 20u);
}

TEST(Tbb, GivesTheSameWorld) {
    scenes::Random random(1);
    const auto scene = scenes::tree(random, scenes::cloud(random, 200), {});
    const TreeView tree = *TreeView::open(scene.bytes);
    std::vector<Pose> poses;
    for (uint32_t i = 0; i < 600; ++i) {
        const auto p = random.in_ball();
        poses.push_back({scenes::to_float({8 * p[0], 8 * p[1], 8 * p[2]}), random.rotation()});
    }
    const auto run = [&](const Jobs& jobs) {
        World world = *World::create();
        std::vector<BodyId> ids;
        for (size_t i = 0; i < poses.size(); ++i) ids.push_back(*world.insert({.shape = tree, .pose = {}}));
        EXPECT_TRUE(world.move(ids, poses, jobs));
        const auto pairs = *world.update_pairs(jobs);
        std::vector<CollideResult> results(pairs.size());
        std::vector<QueryContext> contexts(jobs.workers);
        EXPECT_TRUE(collide(world, pairs, results, {contexts, jobs}));
        std::vector<uint64_t> out;
        for (size_t i = 0; i < pairs.size(); ++i)
            out.insert(out.end(),
                       {pairs[i].a.index, pairs[i].b.index, pairs[i].slot, static_cast<uint64_t>(results[i].verdict)});
        return out;
    };
    const auto serial = run({});
    EXPECT_GT(serial.size(), 3000u);
    for (const int threads : {1, 2, 5}) {
        oneapi::tbb::task_arena arena(threads);
        EXPECT_EQ(run(tbb_jobs(arena)), serial);
    }
}

} // namespace
} // namespace prolate
