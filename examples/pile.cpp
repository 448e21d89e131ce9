// Draws COUNT copies of a baked solid together, and counts in each step which of them touch.    pile A.etree COUNT
#include <prolate/world_queries.hpp>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <vector>

int fail(const prolate::Error& error) {
    std::fprintf(stderr, "pile: %s\n", error.what);
    return 1;
}

int main(int argc, char** argv) {
    if (argc != 3) return std::fputs("usage: pile A.etree COUNT\n", stderr), 2;
    const auto tree = prolate::load(argv[1]);
    if (!tree) return fail(tree.error());
    auto world = prolate::World::create();
    if (!world) return fail(world.error());

    // On a grid, four of the root's widths apart.
    const float pitch = 8 * tree->view().ellipsoid(0).l11;
    std::vector<prolate::BodyId> ids;
    std::vector<prolate::Pose> poses;
    for (int i = 0; i < std::atoi(argv[2]); ++i) {
        const int layer = i / 100, row = i / 10 % 10;
        const auto x = static_cast<float>(i % 10), y = static_cast<float>(row), z = static_cast<float>(layer);
        poses.push_back({{pitch * x, pitch * y, pitch * z}, {x, y, z, 5}});
        const auto id = world->insert({.shape = tree->view(), .pose = poses.back()});
        if (!id) return fail(id.error());
        ids.push_back(*id);
    }

    std::vector<prolate::QueryContext> contexts(1); // one a worker: prolate/tbb.hpp, or your scheduler, has more
    std::vector<prolate::CollideResult> results;
    for (int step = 0; step < 20; ++step) {
        const auto pairs = world->update_pairs();
        if (!pairs) return fail(pairs.error());
        results.resize(pairs->size());
        if (const auto done = prolate::collide(*world, *pairs, results, {contexts}); !done) return fail(done.error());
        const auto touching =
            std::ranges::count(results, prolate::Verdict::overlapping, &prolate::CollideResult::verdict);
        std::printf("step %2d: %6zu pairs, %6td touch\n", step, pairs->size(), touching);
        for (prolate::Pose& pose : poses)
            for (float* x : {&pose.translation.x, &pose.translation.y, &pose.translation.z}) *x *= 0.9f;
        if (const auto moved = world->move(ids, poses); !moved) return fail(moved.error());
    }
    return 0;
}
