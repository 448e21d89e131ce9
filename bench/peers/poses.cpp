#include "bench/peers/poses.hpp"

#include "tests/scenes.hpp"

#include <cmath>

namespace prolate::bench::peers {
namespace {

using scenes::Point;
using scenes::Random;

constexpr double kSpread = 0.01; // of the diagonal, which is 1
constexpr double kApart = 1.5;   // beyond it, neither unit diagonals meet nor the covers around them
constexpr int kBisections = 14;  // down to 0.01 % of the diagonal

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

PoseSets make_poses(const std::function<bool(const Placement&)>& meet, size_t count, uint64_t seed, bool aligned) {
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
        if (!meet(at(low))) continue;
        for (int i = 0; i < kBisections; ++i) {
            const double middle = (low + high) / 2;
            (meet(at(middle)) ? low : high) = middle;
        }
        const double room = kSpread - (high - low); // near and touching count from the true contact
        const Placement near = at(high + room * up), touching = at(low - room * down);
        if (meet(near) || !meet(touching)) continue; // there is another contact on the way
        out.near.push_back(near), out.touching.push_back(touching), out.far.push_back(at(away));
    }
    return out;
}

std::vector<Placement> moved(std::span<const Placement> poses, uint64_t seed) {
    constexpr double kStep = 5e-4; // by turning as by shifting; no point is more than 0.5 from the middle
    Random random(seed);
    std::vector<Placement> out;
    for (Placement p : poses) {
        p.before = p.b;
        const Point shift = random.direction(), axis = random.direction();
        Vec3& t = p.b.translation;
        t = scenes::to_float({t.x + kStep * shift[0], t.y + kStep * shift[1], t.z + kStep * shift[2]});
        const double x = kStep * axis[0], y = kStep * axis[1], z = kStep * axis[2]; // half of an angle of 2 kStep
        const Quat q = p.b.rotation;
        p.b.rotation = {static_cast<float>(q.x + x * q.w + y * q.z - z * q.y),
                        static_cast<float>(q.y + y * q.w + z * q.x - x * q.z),
                        static_cast<float>(q.z + z * q.w + x * q.y - y * q.x),
                        static_cast<float>(q.w - x * q.x - y * q.y - z * q.z)};
        out.push_back(p);
    }
    return out;
}

} // namespace prolate::bench::peers
