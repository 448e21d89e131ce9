#include "bench/peers/poses.hpp"

#include "tests/scenes.hpp"

#include <cmath>

namespace prolate::bench::peers {
namespace {

using scenes::Point;
using scenes::Random;

constexpr double kSpread = 0.01; // of the diagonal, which is 1
constexpr double kApart = 1.05;  // no unit diagonals meet at this distance of their middles
constexpr int kBisections = 14;  // down to 1.05 / 2^14 = 0.006 % of the diagonal

// One of the 24 rotations that map the axes onto axes.
Quat cube_rotation(Random& random) {
    const float h = std::sqrt(0.5f);
    const Quat turns[4] = {{0, 0, 0, 1}, {0, 0, h, h}, {0, 0, 1, 0}, {0, 0, -h, h}};
    const Quat tops[6] = {{0, 0, 0, 1}, {h, 0, 0, h}, {1, 0, 0, 0}, {-h, 0, 0, h}, {0, h, 0, h}, {0, -h, 0, h}};
    const Quat p = tops[random.below(6)], q = turns[random.below(4)];
    return {p.w * q.x + p.x * q.w + p.y * q.z - p.z * q.y, p.w * q.y + p.y * q.w + p.z * q.x - p.x * q.z,
            p.w * q.z + p.z * q.w + p.x * q.y - p.y * q.x, p.w * q.w - p.x * q.x - p.y * q.y - p.z * q.z};
}

} // namespace

PoseSets make_poses(const Reference& a, const Reference& b, size_t count, uint64_t seed, bool aligned) {
    Random random(seed);
    PoseSets out;
    while (out.near.size() < count) {
        Placement p;
        p.a.rotation = aligned ? cube_rotation(random) : random.rotation();
        p.b.rotation = aligned ? cube_rotation(random) : random.rotation();
        const Point origin = random.in_ball(), direction = random.direction();
        p.a.translation = scenes::to_float(origin);
        const auto at = [&](double t) {
            Placement q = p;
            q.b.translation = scenes::to_float(
                {origin[0] + t * direction[0], origin[1] + t * direction[1], origin[2] + t * direction[2]});
            return q;
        };
        const double up = random.unit(), down = random.unit(), away = random.in(2, 4);
        double low = 0, high = kApart;
        if (!meet(a, b, at(low))) continue;
        for (int i = 0; i < kBisections; ++i) {
            const double middle = (low + high) / 2;
            (meet(a, b, at(middle)) ? low : high) = middle;
        }
        const double room = kSpread - (high - low); // near and touching count from the true contact
        const Placement near = at(high + room * up), touching = at(low - room * down);
        if (meet(a, b, near) || !meet(a, b, touching)) continue; // there is another contact on the way
        out.near.push_back(near), out.touching.push_back(touching), out.far.push_back(at(away));
    }
    return out;
}

} // namespace prolate::bench::peers
