// Solids over the ground, asked about by plain threads in each step: what began to touch, and what ended.    threads
// A.etree COUNT
#include <prolate/world_queries.hpp>

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <thread>
#include <vector>

int fail(const prolate::Error& error) {
    std::fprintf(stderr, "threads: %s\n", error.what);
    return 1;
}

// The host's scheduler, here as simple as can be: each call starts its threads, and these take ranges until none is
// left. An engine hands the ranges to its own job system, and keeps its threads.
void run(void* user, uint32_t count, uint32_t grain, prolate::Jobs::Body body, void* job) {
    std::atomic<uint32_t> next{0};
    const auto work = [&](uint32_t worker) {
        for (uint32_t begin; (begin = next.fetch_add(grain)) < count;)
            body(job, begin, std::min(begin + grain, count), worker);
    };
    std::vector<std::thread> threads;
    for (uint32_t worker = 1; worker < *static_cast<uint32_t*>(user); ++worker) threads.emplace_back(work, worker);
    work(0);
    for (std::thread& thread : threads) thread.join();
}

int main(int argc, char** argv) {
    if (argc != 3) return std::fputs("usage: threads A.etree COUNT\n", stderr), 2;
    const auto tree = prolate::load(argv[1]);
    if (!tree) return fail(tree.error());
    auto world = prolate::World::create();
    if (!world) return fail(world.error());
    const float size = 2 * tree->view().ellipsoid(0).l11;
    std::vector<prolate::BodyId> ids;
    std::vector<prolate::Pose> poses;
    for (int i = 0; i < std::atoi(argv[2]); ++i) { // some half as large, in a tower that stands in the air
        const auto scaled = tree->view().scaled(i % 2 == 0 ? 1.0f : 0.5f);
        if (!scaled) return fail(scaled.error());
        poses.push_back({{0.1f * size * static_cast<float>(i % 5), 0, size * static_cast<float>(2 * i + 2)}, {}});
        const auto id = world->insert({.shape = *scaled, .pose = poses.back()});
        if (!id) return fail(id.error());
        ids.push_back(*id);
    }
    if (const auto ground = world->insert({.shape = prolate::HalfSpace{{0, 0, 1}, 0}, .pose = {}}); !ground)
        return fail(ground.error());

    uint32_t workers = 4;
    std::vector<prolate::QueryContext> contexts(workers); // one a worker
    const prolate::Jobs jobs{run, &workers, workers};
    std::vector<prolate::PairContacts> records; // by slot, kept from step to step
    std::vector<prolate::ContactEvent> events;
    for (int step = 0; step < 10; ++step) {
        for (prolate::Pose& pose : poses) pose.translation.z *= 0.8f; // the tower is pressed together
        if (const auto moved = world->move(ids, poses, jobs); !moved) return fail(moved.error());
        const auto pairs = world->update_pairs(jobs);
        if (!pairs) return fail(pairs.error());
        records.resize(world->slot_count());
        events.resize(pairs->size() + world->ended_pairs().size());
        if (const auto done = contacts(*world, *pairs, records, {contexts, jobs}); !done) return fail(done.error());
        const auto count = contact_events(*world, records, events);
        if (!count) return fail(count.error());
        size_t of_kind[3] = {};
        for (size_t i = 0; i < *count; ++i) ++of_kind[static_cast<size_t>(events[i].kind)];
        std::printf("step %d: %zu pairs, %zu began to touch, %zu still do, %zu ended\n", step, pairs->size(),
                    of_kind[0], of_kind[1], of_kind[2]);
    }
    return 0;
}
