// Speed of the pair test and of tree against tree, on seeded scenes.
//
// Counters: evaluations or pair_tests a query (work, the same on every machine) and `verdicts`, a hash of the verdicts
// of all scenes: if it changes, the answers changed. Scenes are visited in turn, so that the branch predictor cannot
// learn one pose; 4096 pairs are 1 MB, 256 tree poses one pair of trees.
//
//   bench_collide --benchmark_repetitions=5 --benchmark_report_aggregates_only
#include "query/ellipsoid/separation.hpp"
#include "tests/reference.hpp"
#include "tests/scenes.hpp"

#include <prolate/collide.hpp>
#include <prolate/pairs.hpp>
#include <prolate/poses.hpp>

#include <benchmark/benchmark.h>

#include <vector>

namespace prolate {
namespace {

using scenes::Point;
using scenes::Random;

// 52 bits, so that a double prints it exactly.
class Hash {
public:
    void add(uint64_t x) { state_ = (state_ ^ x) * 0x100000001b3u; }
    double value() const { return static_cast<double>(state_ >> 12); }

private:
    uint64_t state_ = 0xcbf29ce484222325u;
};

struct Pair {
    Ellipsoid a, b;
    Pose pose_a, pose_b;
};

// Pairs whose contact function lies within `spread` of touching.
std::vector<Pair> pairs(double ratio, double spread) {
    Random random(1);
    std::vector<Pair> out(4096);
    for (Pair& p : out) {
        for (Ellipsoid* e : {&p.a, &p.b}) { // one draw a statement: the order of arguments differs between compilers
            const Point r = scenes::radii(random, ratio);
            *e = scenes::ellipsoid({}, r, random.rotation());
        }
        const Point d = random.direction();
        p.pose_a.rotation = random.rotation(), p.pose_b.rotation = random.rotation();
        p.pose_b.translation = scenes::to_float(d);
        const auto now = static_cast<double>(reference::contact({p.a, p.pose_a, p.b, p.pose_b}));
        const double t = random.in(1 - spread, 1 + spread) / now;
        p.pose_b.translation = scenes::to_float({t * d[0], t * d[1], t * d[2]});
    }
    return out;
}

void pair_test(benchmark::State& state, double ratio, double spread) {
    const auto scenes = pairs(ratio, spread);
    std::vector<query::PlacedEllipsoid> a, b;
    Hash hash;
    uint64_t evaluations = 0;
    for (const Pair& p : scenes) {
        a.push_back(query::place(p.a));
        b.push_back(query::place(p.b, query::relative_pose(p.pose_a, p.pose_b)));
        const auto result = query::test_pair(a.back(), b.back());
        hash.add(static_cast<uint64_t>(result.verdict)), evaluations += result.evaluations;
    }
    size_t i = 0;
    for (auto _ : state) {
        benchmark::DoNotOptimize(query::test_pair(a[i], b[i]));
        i = (i + 1) % a.size();
    }
    state.counters["evaluations"] = static_cast<double>(evaluations) / static_cast<double>(a.size());
    state.counters["verdicts"] = hash.value();
}
BENCHMARK_CAPTURE(pair_test, random_ratio_5, 5.0, 0.9);
BENCHMARK_CAPTURE(pair_test, random_ratio_100, 100.0, 0.9);
BENCHMARK_CAPTURE(pair_test, near_contact_ratio_10, 10.0, 1e-3);
BENCHMARK_CAPTURE(pair_test, near_contact_ratio_100, 100.0, 1e-3);

// The whole public call, poses included.
void pair_call(benchmark::State& state) {
    const auto scenes = pairs(10, 0.9);
    size_t i = 0;
    for (auto _ : state) {
        const Pair& p = scenes[i];
        benchmark::DoNotOptimize(collide(p.a, p.pose_a, p.b, p.pose_b));
        i = (i + 1) % scenes.size();
    }
}
BENCHMARK(pair_call);

// Trees of `levels` levels, degree 8. The distance is that at which the covers of the deepest level just meet or just
// miss, found by bisection for each pair of rotations, plus `offset` of a body's size.
void tree_tree(benchmark::State& state, uint32_t levels, double offset) {
    Random random(2);
    const auto make = [&] {
        return scenes::tree(random, scenes::cloud(random, 8192), {.levels = levels, .leaf_points = 2});
    };
    const auto scene_a = make(), scene_b = make();
    const TreeView a = *TreeView::open(scene_a.bytes), b = *TreeView::open(scene_b.bytes);
    QueryContext context;
    struct Placement {
        Pose a, b;
    };
    std::vector<Placement> poses(256);
    Hash hash;
    uint64_t pair_tests = 0, evaluations = 0;
    for (Placement& pose : poses) {
        pose.a.rotation = random.rotation(), pose.b.rotation = random.rotation();
        const Point d = random.direction();
        const auto at = [&](double t) {
            pose.b.translation = scenes::to_float({t * d[0], t * d[1], t * d[2]});
            return collide(a, pose.a, b, pose.b, context);
        };
        double low = 0, high = 8;
        for (int i = 0; i < 24; ++i) {
            const double middle = (low + high) / 2;
            (at(middle).verdict == Verdict::separated ? high : low) = middle;
        }
        const CollideResult result = at(high + offset);
        hash.add(static_cast<uint64_t>(result.verdict));
        pair_tests += result.stats.pair_tests, evaluations += result.stats.block_tests;
    }
    size_t i = 0;
    for (auto _ : state) {
        benchmark::DoNotOptimize(collide(a, poses[i].a, b, poses[i].b, context));
        i = (i + 1) % poses.size();
    }
    state.counters["pair_tests"] = static_cast<double>(pair_tests) / static_cast<double>(poses.size());
    state.counters["block_tests"] = static_cast<double>(evaluations) / static_cast<double>(poses.size());
    state.counters["verdicts"] = hash.value();
}
BENCHMARK_CAPTURE(tree_tree, 2_levels_near, 2u, 0.01);
BENCHMARK_CAPTURE(tree_tree, 3_levels_near, 3u, 0.01);
BENCHMARK_CAPTURE(tree_tree, 4_levels_near, 4u, 0.01);
BENCHMARK_CAPTURE(tree_tree, 4_levels_touching, 4u, -0.01);
BENCHMARK_CAPTURE(tree_tree, 4_levels_far, 4u, 5.0);

// collide() at 4096 poses in turn, or collide_poses() of them in one call: a body anywhere in a box `spread` times as
// wide as another in its middle, as a planner's samples are. Time is that of a pose.
void at_poses(benchmark::State& state, double spread, bool one_call) {
    Random random(3);
    const auto make = [&] {
        return scenes::tree(random, scenes::cloud(random, 8192), {.levels = 4, .leaf_points = 2});
    };
    const auto scene_a = make(), scene_b = make();
    const TreeView a = *TreeView::open(scene_a.bytes), b = *TreeView::open(scene_b.bytes);
    QueryContext context;
    const Pose still;
    std::vector<Pose> poses(4096);
    for (Pose& pose : poses) {
        pose.rotation = random.rotation();
        const double x = random.in(-spread, spread), y = random.in(-spread, spread), z = random.in(-spread, spread);
        pose.translation = scenes::to_float({x, y, z});
    }
    std::vector<Verdict> out(poses.size());
    for (auto _ : state) {
        if (one_call) {
            benchmark::DoNotOptimize(collide_poses(a, {&still, 1}, b, poses, out, {&context, 1}));
        } else {
            for (size_t i = 0; i < poses.size(); ++i) out[i] = collide(a, still, b, poses[i], context).verdict;
        }
        benchmark::ClobberMemory();
    }
    Hash hash;
    double apart = 0;
    for (const Verdict verdict : out) hash.add(static_cast<uint64_t>(verdict)), apart += verdict == Verdict::separated;
    state.SetItemsProcessed(static_cast<int64_t>(state.iterations() * poses.size()));
    state.counters["apart"] = apart / static_cast<double>(poses.size());
    state.counters["verdicts"] = hash.value();
}
BENCHMARK_CAPTURE(at_poses, wide_one_by_one, 4.0, false);
BENCHMARK_CAPTURE(at_poses, wide_in_one_call, 4.0, true);
BENCHMARK_CAPTURE(at_poses, narrow_one_by_one, 2.0, false);
BENCHMARK_CAPTURE(at_poses, narrow_in_one_call, 2.0, true);

} // namespace
} // namespace prolate
