#include "cli/compare/query_time.hpp"

#include <prolate/collide.hpp>
#include <prolate/matrix.hpp>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <memory>
#include <random>
#include <vector>

namespace prolate::cli {
namespace {

constexpr int kPoses = 64, kRepetitions = 200;
constexpr double kNear = 0.01; // of a body's size: how far apart the two are

Quat random_rotation(std::mt19937& random) {
    std::normal_distribution<float> normal;
    Quat q{normal(random), normal(random), normal(random), normal(random)};
    const float length = std::sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
    return {q.x / length, q.y / length, q.z / length, q.w / length};
}

// Turned, and moved so that `center` comes to lie at `to`.
Pose centered(const Quat& rotation, const Vec3& center, const std::array<double, 3>& to) {
    Pose out{{}, rotation};
    const Matrix4 turn = to_matrix(out);
    const auto at = [&](size_t i) {
        return static_cast<float>(to[i] - turn.m[i][0] * center.x - turn.m[i][1] * center.y - turn.m[i][2] * center.z);
    };
    out.translation = {at(0), at(1), at(2)};
    return out;
}

} // namespace

double nanoseconds_a_query(const TreeView& tree) {
    using Clock = std::chrono::steady_clock;
    std::mt19937 random(1); // the same poses for all
    std::normal_distribution<float> normal;
    const auto context = std::make_unique<QueryContext>();
    const double size = tree.bake_info().diagonal;
    const Vec3 center = tree.root_bound().center;
    std::vector<double> times;
    for (int n = 0; n < kPoses; ++n) {
        const Quat turn_a = random_rotation(random), turn_b = random_rotation(random);
        float direction[3];
        for (float& x : direction) x = normal(random);
        const float length = std::hypot(direction[0], direction[1], direction[2]);
        const Pose a = centered(turn_a, center, {});
        Pose b;
        const auto place = [&](double t) {
            const double by = t / double{length};
            b = centered(turn_b, center, {by * direction[0], by * direction[1], by * direction[2]});
        };
        double low = 0, high = 4 * size;
        for (int i = 0; i < 20; ++i) {
            place(0.5 * (low + high));
            const bool apart = collide(tree, a, tree, b, *context).verdict == Verdict::separated;
            (apart ? high : low) = 0.5 * (low + high);
        }
        place(high + kNear * size);
        uint64_t tests = 0; // so that no query is left out
        const auto start = Clock::now();
        for (int i = 0; i < kRepetitions; ++i) tests += collide(tree, a, tree, b, *context).stats.pair_tests;
        const std::chrono::duration<double, std::nano> taken = Clock::now() - start;
        if (tests > 0) times.push_back(taken.count() / kRepetitions);
    }
    if (times.empty()) return 0;
    std::ranges::nth_element(times, times.begin() + static_cast<std::ptrdiff_t>(times.size() / 2));
    return times[times.size() / 2];
}

} // namespace prolate::cli
