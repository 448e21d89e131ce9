// Uses each header that README's table of questions names, as a user would: `rows TREE` asks each of them about a baked
// solid of about a metre around the origin, and prints the headers whose answers are right.
// tests/project/consumer.cmake compares them with the table.
#include <prolate/bounds.hpp>
#include <prolate/collide.hpp>
#include <prolate/contacts.hpp>
#include <prolate/deform.hpp>
#include <prolate/distance.hpp>
#include <prolate/half_space.hpp>
#include <prolate/jobs.hpp>
#include <prolate/pairs.hpp>
#include <prolate/points.hpp>
#include <prolate/poses.hpp>
#include <prolate/primitives.hpp>
#include <prolate/raycast.hpp>
#include <prolate/shapes.hpp>
#include <prolate/solids.hpp>
#include <prolate/sweep.hpp>
#ifdef WITH_TBB
#include <prolate/tbb.hpp>
#endif
#include <prolate/world.hpp>
#include <prolate/world_queries.hpp>

#include <cstdio>

using namespace prolate;

int main(int argc, char** argv) {
    if (argc != 2) return std::fputs("usage: rows TREE\n", stderr), 2;
    const auto loaded = load(argv[1]);
    if (!loaded) return std::fprintf(stderr, "rows: %s\n", loaded.error().what), 1;
    const TreeView tree = loaded->view();
    const Pose here, near{{0.5f, 0, 0}, {}}, far{{10, 0, 0}, {}};
    QueryContext context;
    const auto row = [](const char* header, bool right) { std::printf("%s%s\n", header, right ? "" : ": wrong"); };

    row("collide.hpp", collide(tree, here, tree, near, context).verdict == Verdict::overlapping);

    const DeformedBody at_rest{tree};
    row("deform.hpp", collide(at_rest, {tree, near}, context).verdict == Verdict::overlapping &&
                          distance(at_rest, {tree, far}, context).verdict == Verdict::separated);

    const DistanceResult d = distance(tree, here, tree, far, context);
    row("distance.hpp", d.lower > 1 && d.lower <= d.upper && d.upper < 10);

    const Solid solid(tree);
    const SolidsDistance apart = distance(solid, here, solid, far, context);
    row("solids.hpp", collide(solid, here, solid, far, context).verdict == Verdict::separated &&
                          apart.verdict == Verdict::separated && apart.lower > 1 && apart.lower <= apart.upper);

    ContactManifolds manifolds;
    contacts(tree, here, tree, near, manifolds, context);
    row("contacts.hpp", manifolds.count > 0 && manifolds.manifolds[0].count > 0);

    const SweepResult s = sweep(tree, {.start = here}, tree, {.start = far, .linear = {-10, 0, 0}}, context);
    row("sweep.hpp", s.verdict == Verdict::overlapping && s.time_lower > 0 && s.time_upper < 1);

    row("raycast.hpp", raycast(tree, here, {{-10, 0.1f, 0.1f}, {1, 0, 0}}, context).verdict == Verdict::overlapping);

    row("shapes.hpp", overlap(tree, here, Sphere{{0, 0, 0}, 1}, context).verdict == Verdict::overlapping &&
                          overlap(tree, far, HalfSpace{{1, 0, 0}, 0}, context).verdict == Verdict::separated);

    const SignedDistance inside = signed_distance(tree, here, {0, 0, 0}, context),
                         outside = signed_distance(tree, far, {0, 0, 0}, context);
    row("points.hpp", inside.upper < 0 && outside.lower > 5 && outside.upper < 10 &&
                          contains(tree, here, {0, 0, 0}, context) == Verdict::overlapping);

    const DistanceResult above = distance(tree, far, HalfSpace{{1, 0, 0}, 0}, context);
    contacts(tree, here, HalfSpace{{1, 0, 0}, 0}, manifolds, context);
    row("half_space.hpp", above.lower > 5 && above.upper < 10 && manifolds.count == 1);

    const auto floor = box_tree({100, 100, 1});
    row("primitives.hpp",
        floor && collide(tree, here, floor->view(), {{0, 0, -1}, {}}, context).verdict == Verdict::overlapping);

    row("pairs.hpp", collide(tree.root(), here, tree.root(), far) == Verdict::separated);

    const Bounds box = bounds(tree, far);
    row("bounds.hpp", box.lower.x > 5 && box.upper.x < 15);

    const Pose many[] = {near, far};
    CollideResult results[2];
    const bool asked = static_cast<bool>(collide_poses(tree, {&here, 1}, tree, many, results, {&context, 1}));
    row("poses.hpp", asked && results[0].verdict == Verdict::overlapping && results[1].verdict == Verdict::separated);

    auto world = World::create();
    const bool inserted = world && world->insert({.shape = tree, .pose = here}) &&
                          world->insert({.shape = tree, .pose = near}) && world->insert({.shape = tree, .pose = far});
    row("world.hpp", inserted && world->update_pairs()->size() == 1);
    Verdict verdict{};
    row("world_queries.hpp",
        inserted && collide(*world, world->pairs(), {&verdict, 1}, {{&context, 1}}) && verdict == Verdict::overlapping);
    row("jobs.hpp", inserted && world->update_pairs(Jobs{})->size() == 1);
#ifdef WITH_TBB
    oneapi::tbb::task_arena arena(2);
    row("tbb.hpp", inserted && world->update_pairs(tbb_jobs(arena))->size() == 1);
#endif
    return 0;
}
