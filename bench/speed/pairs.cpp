// Speed of single ellipsoid pairs: one at a time, in batches, and libccd's GJK on the same pairs in the same process.
//
// Names: pair_<what>/<how>/<scene>. `s_per_pair` is the time of one pair. Other counters: `evaluations` and `in_double`
// (share) of a pair, and `verdicts`, a hash of the verdicts: if it changes, the answers changed. `wrong`: verdicts of
// the 4096 pairs that are not the reference's. Scenes: axis ratios up to 5, 10, 100; "random" pairs lie within a factor
// of 0.1 to 1.9 of contact, "near" ones within 1e-3; "particles" are what a simulator has: a dense packing, each body
// in several pairs. Poses are visited in turn, so that the branch predictor cannot learn one.
//
//   bench_pairs --benchmark_repetitions=5 --benchmark_report_aggregates_only
#include "tests/reference.hpp"
#include "tests/scenes.hpp"

#include <prolate/pairs.hpp>

#include <benchmark/benchmark.h>

#ifdef PROLATE_BENCH_CCD
#include <ccd/ccd.h>
#include <ccd/quat.h>
#endif

#include <array>
#include <cmath>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace prolate {
namespace {

using scenes::Point;
using scenes::Random;

constexpr uint32_t kPairs = 4096;
constexpr float kTolerance = 1e-4f; // of distances; bodies have a largest semi-axis of 1

struct Scene {
    std::vector<Ellipsoid> shapes;
    std::vector<std::pair<Point, Quat>> axes; // as libccd is told: radii, and their rotation within the shape
    std::vector<Pose> poses;
    std::vector<WorldEllipsoid> world;
    std::vector<IndexPair> pairs;

    EllipsoidBodies view() const { return {shapes, poses, world}; }
    void add(const Point& radii, const Quat& turn, const Pose& pose) {
        shapes.push_back(scenes::ellipsoid({}, radii, turn));
        axes.push_back({radii, turn}), poses.push_back(pose);
    }
    reference::Pair exact(const IndexPair& p) const { return {shapes[p.a], poses[p.a], shapes[p.b], poses[p.b]}; }
    void place() { world.resize(shapes.size()), prolate::place(shapes, poses, world); }
};

// Pairs whose contact function lies between `low` and `high`.
Scene pairs(double ratio, double low, double high) {
    Random random(1);
    Scene out;
    for (uint32_t i = 0; i < kPairs; ++i) {
        for (int k = 0; k < 2; ++k) { // one draw a statement: the order of arguments differs between compilers
            const Point r = scenes::radii(random, ratio);
            const Quat turn = random.rotation();
            const Quat rotation = random.rotation();
            out.add(r, turn, {{}, rotation});
        }
        out.pairs.push_back({2 * i, 2 * i + 1});
        const Point d = random.direction();
        Vec3& t = out.poses.back().translation;
        t = scenes::to_float(d);
        const double scale =
            random.in(low, high) / static_cast<double>(reference::contact(out.exact(out.pairs.back())));
        t = scenes::to_float({scale * d[0], scale * d[1], scale * d[2]});
    }
    out.place();
    return out;
}

// A box of bodies of axis ratio up to 3, and all pairs whose enclosing spheres meet.
Scene particles() {
    Random random(2);
    Scene out;
    constexpr uint32_t kBodies = 4096;
    std::vector<Point> centers;
    for (uint32_t i = 0; i < kBodies; ++i) {
        const Point r = scenes::radii(random, 3);
        const Quat turn = random.rotation();
        const Quat rotation = random.rotation();
        Point c{};
        for (double& x : c) x = random.in(0, 20);
        out.add(r, turn, {scenes::to_float(c), rotation}), centers.push_back(c);
    }
    for (uint32_t i = 0; i < kBodies; ++i)
        for (uint32_t j = i + 1; j < kBodies; ++j) {
            double square = 0;
            for (size_t k = 0; k < 3; ++k) square += std::pow(centers[i][k] - centers[j][k], 2);
            if (square < 4 && out.pairs.size() < 8 * kPairs) out.pairs.push_back({i, j});
        }
    out.place();
    return out;
}

const Scene& scene(const std::string& name) {
    static std::map<std::string, Scene> made;
    const auto found = made.find(name);
    if (found != made.end()) return found->second;
    const auto make = [&] {
        if (name == "particles") return particles();
        const double ratio = std::stod(name.substr(name.rfind('_') + 1));
        if (name.starts_with("near")) return pairs(ratio, 1 - 1e-3, 1 + 1e-3);
        if (name.starts_with("apart_near")) return pairs(ratio, 1 + 1e-6, 1 + 1e-3);
        if (name.starts_with("apart")) return pairs(ratio, 1.001, 4);
        if (name.starts_with("inside")) return pairs(ratio, 0.95, 0.999);
        return pairs(ratio, 0.1, 1.9);
    };
    return made.emplace(name, make()).first->second;
}

void per_pair(benchmark::State& state, double pairs_an_iteration) {
    state.counters["s_per_pair"] = benchmark::Counter(
        pairs_an_iteration, benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}

// Verdicts are judged once a scene, in a statement of their own.
template <class Apart> void judge(benchmark::State& state, const Scene& s, Apart&& apart) {
    uint64_t hash = 0xcbf29ce484222325u, wrong = 0;
    for (size_t i = 0; i < std::min<size_t>(s.pairs.size(), kPairs); ++i) {
        const bool answer = apart(i);
        hash = (hash ^ answer) * 0x100000001b3u;
        wrong += answer != (reference::contact(s.exact(s.pairs[i])) > 1);
    }
    state.counters["verdicts"] = static_cast<double>(hash >> 12); // 52 bits, so that a double prints it exactly
    state.counters["wrong"] = static_cast<double>(wrong);
}

// `test(i)` of each pair in turn.
template <class Test> void in_turn(benchmark::State& state, const Scene& s, Test&& test) {
    size_t i = 0;
    for (auto _ : state) {
        benchmark::DoNotOptimize(test(s.pairs[i]));
        i = i + 1 == s.pairs.size() ? 0 : i + 1;
    }
    per_pair(state, 1);
}

void collide_single(benchmark::State& state, const std::string& name) {
    const Scene& s = scene(name);
    const auto test = [&](const IndexPair& p) {
        return collide(s.shapes[p.a], s.poses[p.a], s.shapes[p.b], s.poses[p.b]);
    };
    in_turn(state, s, test);
    judge(state, s, [&](size_t i) { return test(s.pairs[i]) == Verdict::separated; });
}

void collide_batch(benchmark::State& state, const std::string& name) {
    const Scene& s = scene(name);
    std::vector<Verdict> verdicts(s.pairs.size());
    PairStats stats;
    for (auto _ : state) {
        stats = collide(s.view(), s.pairs, verdicts);
        benchmark::DoNotOptimize(verdicts.data());
    }
    const auto count = static_cast<double>(s.pairs.size());
    per_pair(state, count);
    state.counters["evaluations"] = static_cast<double>(stats.evaluations) / count;
    state.counters["in_double"] = static_cast<double>(stats.in_double) / count;
    judge(state, s, [&](size_t i) { return verdicts[i] == Verdict::separated; });
}

void distance_single(benchmark::State& state, const std::string& name) {
    const Scene& s = scene(name);
    in_turn(state, s, [&](const IndexPair& p) {
        return distance(s.shapes[p.a], s.poses[p.a], s.shapes[p.b], s.poses[p.b], kTolerance);
    });
}

void distance_batch(benchmark::State& state, const std::string& name) {
    const Scene& s = scene(name);
    std::vector<PairDistance> distances(s.pairs.size());
    PairStats stats;
    for (auto _ : state) {
        stats = distance(s.view(), s.pairs, distances, kTolerance);
        benchmark::DoNotOptimize(distances.data());
    }
    const auto count = static_cast<double>(s.pairs.size());
    per_pair(state, count);
    state.counters["evaluations"] = static_cast<double>(stats.evaluations) / count;
    state.counters["in_double"] = static_cast<double>(stats.in_double) / count;
    double widest = 0;
    for (const PairDistance& d : distances)
        if (d.lower > 0) widest = std::max(widest, static_cast<double>(d.upper) - d.lower);
    state.counters["widest"] = widest;
}

void place_bodies(benchmark::State& state) {
    const Scene& s = scene("particles");
    std::vector<WorldEllipsoid> world(s.shapes.size());
    for (auto _ : state) {
        place(s.shapes, s.poses, world);
        benchmark::DoNotOptimize(world.data());
    }
    per_pair(state, static_cast<double>(world.size()));
}

#ifdef PROLATE_BENCH_CCD
// An ellipsoid as libccd's examples have one.
struct CcdEllipsoid {
    ccd_vec3_t center, radii;
    ccd_quat_t turn, inverse;
};
void ccd_support(const void* object, const ccd_vec3_t* direction, ccd_vec3_t* out) {
    const auto& e = *static_cast<const CcdEllipsoid*>(object);
    ccd_vec3_t d = *direction;
    ccdQuatRotVec(&d, &e.inverse);
    for (int i = 0; i < 3; ++i) d.v[i] *= e.radii.v[i];
    const double length = std::sqrt(ccdVec3Len2(&d));
    for (int i = 0; i < 3; ++i) out->v[i] = e.radii.v[i] * d.v[i] / length;
    ccdQuatRotVec(out, &e.turn);
    ccdVec3Add(out, &e.center);
}
std::vector<CcdEllipsoid> for_ccd(const Scene& s) {
    std::vector<CcdEllipsoid> out(s.shapes.size());
    for (size_t i = 0; i < out.size(); ++i) {
        const auto& [radii, turn] = s.axes[i];
        const auto quaternion = [](const Quat& q) {
            ccd_quat_t r;
            const double n = std::sqrt(double{q.x} * q.x + double{q.y} * q.y + double{q.z} * q.z + double{q.w} * q.w);
            ccdQuatSet(&r, q.x / n, q.y / n, q.z / n, q.w / n);
            return r;
        };
        const ccd_quat_t outer = quaternion(s.poses[i].rotation), inner = quaternion(turn);
        ccdQuatMul2(&out[i].turn, &outer, &inner);
        ccdQuatInvert2(&out[i].inverse, &out[i].turn);
        const Vec3& t = s.poses[i].translation;
        ccdVec3Set(&out[i].center, t.x, t.y, t.z), ccdVec3Set(&out[i].radii, radii[0], radii[1], radii[2]);
    }
    return out;
}
void collide_ccd(benchmark::State& state, const std::string& name) {
    const Scene& s = scene(name);
    const auto bodies = for_ccd(s);
    ccd_t ccd;
    CCD_INIT(&ccd);
    ccd.support1 = ccd.support2 = ccd_support, ccd.max_iterations = 500;
    const auto test = [&](const IndexPair& p) { return ccdGJKIntersect(&bodies[p.a], &bodies[p.b], &ccd); };
    in_turn(state, s, test);
    judge(state, s, [&](size_t i) { return test(s.pairs[i]) == 0; });
}
#endif

const bool kRegistered = [] {
    const auto add = [](const std::string& what, auto function, const std::string& scene_name) {
        benchmark::RegisterBenchmark((what + "/" + scene_name).c_str(),
                                     [=](benchmark::State& state) { function(state, scene_name); });
    };
    for (const char* name : {"random_5", "random_10", "random_100", "near_5", "near_10", "near_100", "particles"}) {
        add("pair_collide/single", collide_single, name);
        add("pair_collide/batch", collide_batch, name);
#ifdef PROLATE_BENCH_CCD
        add("pair_collide/libccd", collide_ccd, name);
#endif
    }
    for (const char* name :
         {"apart_5", "apart_10", "apart_100", "apart_near_5", "apart_near_10", "inside_5", "inside_10"}) {
        add("pair_distance/single", distance_single, name);
        add("pair_distance/batch", distance_batch, name);
    }
    benchmark::RegisterBenchmark("pair_place", place_bodies);
    return true;
}();

} // namespace
} // namespace prolate
