// Speed of what is done with triangles at the leaves of exact trees: pairs of leaves, and pairs of triangles.
//
// Leaves are patches of surface of `count` triangles each; the gap between the patches is a share of their size, or
// they cross. Counters: `pairs` tested a call, `exact` those that took the scalar test, `answers` a hash of the
// answers. Time is for a call; `time_a_pair` divides by the pairs. 1024 scenes are visited in turn, so that the branch
// predictor cannot learn them.
#include "query/triangle/contact.hpp"
#include "query/triangle/distance.hpp"
#include "query/triangle/leaves.hpp"
#include "tests/query/triangle/triangle_pairs.hpp"
#include "tests/scenes.hpp"

#include <benchmark/benchmark.h>

#include <vector>

namespace prolate {
namespace {

using scenes::Point;
using scenes::Random;

// A strip of `count` triangles over a wavy surface, 1 wide; z is its height.
std::vector<std::byte> strip(Random& random, uint32_t count) {
    std::vector<Vec3> vertices;
    std::vector<Triangle> triangles;
    for (uint32_t i = 0; i < count + 2; ++i) {
        const double x = 0.5 * i / count, y = i % 2 ? 0.5 : 0;
        vertices.push_back(
            scenes::to_float({x + random.in(-0.1, 0.1) / count, y + random.in(-0.1, 0.1), random.in(-0.15, 0.15)}));
        if (i >= 2) triangles.push_back({i - 2, i - 1, i});
    }
    return triangle_pairs::leaf_of(vertices, triangles);
}

struct Scene {
    std::vector<std::byte> bytes_a, bytes_b;
    TreeView a, b;
    query::RelativePose b_to_a;
};

// Strips at random poses, the second moved along a random direction until no two of their triangles meet, and then by
// `gap` more: below 0 they cross.
std::vector<Scene> scenes_of(uint32_t count, double gap) {
    Random random(41);
    std::vector<Scene> out;
    for (int i = 0; i < 1024; ++i) {
        auto bytes_a = strip(random, count), bytes_b = strip(random, count);
        const TreeView a = *TreeView::open(bytes_a), b = *TreeView::open(bytes_b);
        const Pose pose_a{{}, random.rotation()};
        Pose pose_b{{}, random.rotation()};
        const Point way = random.direction();
        const auto place = [&](double t) {
            pose_b.translation = scenes::to_float({t * way[0], t * way[1], t * way[2]});
            return query::relative_pose(pose_a, pose_b);
        };
        double low = 0, high = 4;
        for (int step = 0; step < 30; ++step) {
            const double middle = (low + high) / 2;
            (query::test_leaves(a, {0, count}, b, {0, count}, place(middle)).meet ? low : high) = middle;
        }
        const auto b_to_a = place(high + gap);
        out.push_back({std::move(bytes_a), std::move(bytes_b), a, b, b_to_a});
    }
    return out;
}

class Hash {
public:
    void add(uint64_t x) { state_ = (state_ ^ x) * 0x100000001b3u; }
    double value() const { return static_cast<double>(state_ >> 12); } // 52 bits, which a double prints exactly

private:
    uint64_t state_ = 0xcbf29ce484222325u;
};

template <class Test> void run(benchmark::State& state, const std::vector<Scene>& scenes, Test&& test) {
    Hash hash;
    uint64_t pairs = 0, exact = 0;
    for (const Scene& s : scenes) {
        const query::LeafResult r = test(s);
        hash.add(r.meet), hash.add(r.triangle_a), hash.add(r.triangle_b), pairs += r.pair_tests, exact += r.exact_tests;
    }
    size_t i = 0;
    for (auto _ : state) {
        benchmark::DoNotOptimize(test(scenes[i]));
        i = (i + 1) % scenes.size();
    }
    const double n = static_cast<double>(scenes.size());
    state.counters["pairs"] = static_cast<double>(pairs) / n;
    state.counters["exact"] = static_cast<double>(exact) / n;
    state.counters["answers"] = hash.value();
    state.counters["time_a_pair"] =
        benchmark::Counter(static_cast<double>(state.iterations()) * static_cast<double>(pairs) / n,
                           benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}

void leaves(benchmark::State& state, uint32_t count, double gap) {
    run(state, scenes_of(count, gap), [count](const Scene& s) {
        return query::test_leaves(s.a, {0, count}, s.b, {0, count}, s.b_to_a);
    });
}
// Pair by pair with the scalar test, as a query would do without the kernels.
void leaves_scalar(benchmark::State& state, uint32_t count, double gap) {
    run(state, scenes_of(count, gap), [count](const Scene& s) {
        query::LeafResult out;
        for (uint32_t j = 0; j < count; ++j) {
            const auto b = query::place(s.b, j, s.b_to_a);
            for (uint32_t i = 0; i < count; ++i) {
                ++out.pair_tests, ++out.exact_tests;
                if (query::separated(query::place(s.a, i), b)) continue;
                out.meet = true, out.triangle_a = i, out.triangle_b = j;
                return out;
            }
        }
        return out;
    });
}
BENCHMARK_CAPTURE(leaves, 4x4_near_1e_3, 4u, 1e-3);
BENCHMARK_CAPTURE(leaves_scalar, 4x4_near_1e_3, 4u, 1e-3);
BENCHMARK_CAPTURE(leaves, 3x3_near_1e_3, 3u, 1e-3);
BENCHMARK_CAPTURE(leaves, 4x4_near_1e_1, 4u, 1e-1);
BENCHMARK_CAPTURE(leaves_scalar, 4x4_near_1e_1, 4u, 1e-1);
BENCHMARK_CAPTURE(leaves, 4x4_crossing, 4u, -1e-2);
BENCHMARK_CAPTURE(leaves_scalar, 4x4_crossing, 4u, -1e-2);
BENCHMARK_CAPTURE(leaves, 16x16_near_1e_3, 16u, 1e-3);

// Triangle by triangle: the first of each strip.
template <class Call> void triangles(benchmark::State& state, double gap, Call&& call) {
    const auto scenes = scenes_of(1, gap);
    std::vector<query::PlacedTriangle> a, b;
    for (const Scene& s : scenes) a.push_back(query::place(s.a, 0)), b.push_back(query::place(s.b, 0, s.b_to_a));
    size_t i = 0;
    for (auto _ : state) {
        benchmark::DoNotOptimize(call(a[i], b[i]));
        i = (i + 1) % a.size();
    }
}
void distance_of_triangles(benchmark::State& state, double gap) {
    triangles(state, gap, [](const auto& a, const auto& b) { return query::distance(a, b); });
}
void contact_of_triangles(benchmark::State& state, double gap) {
    triangles(state, gap, [](const auto& a, const auto& b) { return query::contact({a}, {b}, 0); });
}
BENCHMARK_CAPTURE(distance_of_triangles, gap_1e_1, 1e-1);
BENCHMARK_CAPTURE(distance_of_triangles, gap_1e_3, 1e-3);
BENCHMARK_CAPTURE(distance_of_triangles, crossing, -1e-2);
BENCHMARK_CAPTURE(contact_of_triangles, crossing, -1e-2);

} // namespace
} // namespace prolate
