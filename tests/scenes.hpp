// Seeded scenes for tests and benchmarks: random numbers that are the same everywhere, ellipsoids, poses, and valid
// trees over point clouds.
//
// A cloud is the "solid" here: a node's sub-volume is a subset of the points, and its ellipsoid encloses them.
#pragma once

#include "src/format.hpp"

#include <prolate/tree.hpp>
#include <prolate/types.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <span>
#include <vector>

namespace prolate::scenes {

using Point = std::array<double, 3>;

/// SplitMix64 (Steele, Lea, Flood 2014). The distributions of <random> differ between standard libraries.
class Random {
public:
    explicit Random(uint64_t seed) : state_(seed) {}
    uint64_t next() {
        uint64_t z = state_ += 0x9e3779b97f4a7c15u;
        z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
        z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
        return z ^ (z >> 31);
    }
    double unit() { return static_cast<double>(next() >> 11) * 0x1p-53; } // [0, 1)
    double in(double low, double high) { return low + (high - low) * unit(); }
    double log_in(double low, double high) { return low * std::pow(high / low, unit()); }
    uint32_t below(uint32_t n) { return static_cast<uint32_t>(next() % n); }

    Point in_ball() {
        for (;;) {
            const Point p{in(-1, 1), in(-1, 1), in(-1, 1)};
            if (p[0] * p[0] + p[1] * p[1] + p[2] * p[2] <= 1) return p;
        }
    }
    Point direction() {
        for (;;) {
            const Point p = in_ball();
            const double length = std::sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]);
            if (length > 0.1) return {p[0] / length, p[1] / length, p[2] / length};
        }
    }
    /// Uniform rotation (Shoemake); a float quaternion, so its length is only nearly 1.
    Quat rotation() {
        for (;;) {
            const double x = in(-1, 1), y = in(-1, 1), z = in(-1, 1), w = in(-1, 1), s = x * x + y * y + z * z + w * w;
            if (s > 1 || s < 0.01) continue;
            const double k = 1 / std::sqrt(s);
            return {static_cast<float>(k * x), static_cast<float>(k * y), static_cast<float>(k * z),
                    static_cast<float>(k * w)};
        }
    }

private:
    uint64_t state_;
};

inline Vec3 to_float(const Point& p) {
    return {static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])};
}

/// Rotation matrix of a quaternion of any length.
inline std::array<Point, 3> rotation_rows(const Quat& q) {
    const double x = q.x, y = q.y, z = q.z, w = q.w, s = 2 / (x * x + y * y + z * z + w * w);
    return {{{1 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)},
             {s * (x * y + z * w), 1 - s * (x * x + z * z), s * (y * z - x * w)},
             {s * (x * z - y * w), s * (y * z + x * w), 1 - s * (x * x + y * y)}}};
}
inline Point rotate(const Quat& q, const Point& p) {
    const auto r = rotation_rows(q);
    Point out{};
    for (size_t i = 0; i < 3; ++i) out[i] = r[i][0] * p[0] + r[i][1] * p[1] + r[i][2] * p[2];
    return out;
}

/// Turned at random, `offset` metres from the origin in a random direction.
inline Pose pose_at(Random& random, double offset) {
    const Point d = random.direction();
    return {to_float({offset * d[0], offset * d[1], offset * d[2]}), random.rotation()};
}

/// Lower Cholesky factor of a positive definite matrix, as an ellipsoid {center + L u}.
inline Ellipsoid from_shape(const Point& center, const std::array<Point, 3>& q) {
    const double l11 = std::sqrt(q[0][0]), l21 = q[1][0] / l11, l31 = q[2][0] / l11;
    const double l22 = std::sqrt(q[1][1] - l21 * l21), l32 = (q[2][1] - l31 * l21) / l22;
    const double l33 = std::sqrt(std::max(q[2][2] - l31 * l31 - l32 * l32, 1e-12 * q[2][2]));
    return {.center = to_float(center),
            .l11 = static_cast<float>(l11),
            .l21 = static_cast<float>(l21),
            .l22 = static_cast<float>(l22),
            .l31 = static_cast<float>(l31),
            .l32 = static_cast<float>(l32),
            .l33 = static_cast<float>(l33)};
}

/// Ellipsoid with the given semi-axes, turned by `rotation`.
inline Ellipsoid ellipsoid(const Point& center, const Point& radii, const Quat& rotation) {
    const auto r = rotation_rows(rotation);
    std::array<Point, 3> q{};
    for (size_t i = 0; i < 3; ++i)
        for (size_t j = 0; j < 3; ++j)
            for (size_t k = 0; k < 3; ++k) q[i][j] += r[i][k] * radii[k] * radii[k] * r[j][k];
    return from_shape(center, q);
}

/// Semi-axes up to `ratio` apart, the largest 1: a needle, a disc or anything between.
inline Point radii(Random& random, double ratio) {
    Point r{1, 1 / random.log_in(1, ratio), 1 / random.log_in(1, ratio)};
    std::swap(r[0], r[random.below(3)]);
    return r;
}

/// A solid's points: a few blobs, drawn out and scattered, inside the unit ball.
inline std::vector<Point> cloud(Random& random, uint32_t count) {
    std::array<Point, 5> center{}, axes{};
    std::array<Quat, 5> rotation{};
    for (size_t i = 0; i < center.size(); ++i) {
        center[i] = random.in_ball();
        axes[i] = radii(random, 8);
        rotation[i] = random.rotation();
    }
    std::vector<Point> points(count);
    for (Point& p : points) {
        const uint32_t blob = random.below(center.size());
        const Point b = random.in_ball();
        const Point q = rotate(rotation[blob], {axes[blob][0] * b[0], axes[blob][1] * b[1], axes[blob][2] * b[2]});
        for (size_t i = 0; i < 3; ++i) p[i] = 0.6 * center[blob][i] + 0.4 * q[i];
    }
    return points;
}

/// An enclosing ellipsoid: the covariance's, which the caller scales.
inline Ellipsoid fit(std::span<const Point> points) {
    Point mean{};
    for (const Point& p : points)
        for (size_t i = 0; i < 3; ++i) mean[i] += p[i] / static_cast<double>(points.size());
    std::array<Point, 3> q{};
    double sum = 0;
    for (const Point& p : points)
        for (size_t i = 0; i < 3; ++i)
            for (size_t j = 0; j < 3; ++j) q[i][j] += (p[i] - mean[i]) * (p[j] - mean[j]);
    for (size_t i = 0; i < 3; ++i) sum += q[i][i];
    for (size_t i = 0; i < 3; ++i) q[i][i] += 1e-3 * sum + 1e-4; // no flat nodes
    return from_shape(mean, q);
}

struct TreeOptions {
    uint32_t degree = 8;
    uint32_t levels = 4;         ///< at most, the root included
    uint32_t leaf_points = 8;    ///< fewer are not split
    double stop_probability = 0; ///< a node becomes a leaf early: uneven depths
    double unit = 1;             ///< length of one cloud unit, a power of two
    double shrink = 1;           ///< below 1: nodes do not enclose (to show that the tests notice)
};

/// A built tree and what its nodes stand for.
struct Scene {
    std::vector<Point> points;    ///< scaled by `unit`
    std::vector<std::byte> bytes; ///< the .etree
};

/// Splits the cloud along the longest box side again and again until there are `degree` parts; every node's decoded
/// ellipsoid encloses its points with 5e-3 to spare.
inline Scene tree(Random& random, std::vector<Point> points, const TreeOptions& options) {
    Point low = points[0], high = points[0];
    for (const Point& p : points)
        for (size_t i = 0; i < 3; ++i) low[i] = std::min(low[i], p[i]), high[i] = std::max(high[i], p[i]);
    for (size_t i = 0; i < 3; ++i) low[i] *= options.unit, high[i] *= options.unit;
    const format::Lattice lattice = format::lattice_for(low.data(), high.data());

    struct Part {
        size_t begin, end;
    };
    const auto split = [&](const Part& part, std::vector<Part>& out) {
        std::vector<Part> parts{part};
        while (parts.size() < options.degree) {
            const auto size = [](const Part& p) { return p.end - p.begin; };
            const auto largest = std::ranges::max_element(parts, {}, size);
            if (size(*largest) < 2) break;
            const Part whole = *largest;
            size_t axis = 0;
            double best = -1;
            for (size_t i = 0; i < 3; ++i) {
                const auto [a, b] = std::minmax_element(points.begin() + whole.begin, points.begin() + whole.end,
                                                        [i](const Point& p, const Point& q) { return p[i] < q[i]; });
                if ((*b)[i] - (*a)[i] > best) best = (*b)[i] - (*a)[i], axis = i;
            }
            std::sort(points.begin() + whole.begin, points.begin() + whole.end,
                      [axis](const Point& p, const Point& q) { return p[axis] < q[axis]; });
            const size_t middle = whole.begin + size(whole) / 2;
            *largest = {whole.begin, middle};
            parts.push_back({middle, whole.end});
        }
        out.insert(out.end(), parts.begin(), parts.end());
        return static_cast<uint8_t>(parts.size());
    };
    const auto node_of = [&](const Part& part) {
        const std::span<const Point> mine(points.data() + part.begin, part.end - part.begin);
        const Ellipsoid e = fit(mine);
        double scale = 0.1;
        for (const Point& p : mine) scale = std::max(scale, std::sqrt(radial_squared(e, p.data())));
        format::PackedNode node;
        const auto encloses = [&] { // decoded
            const Ellipsoid d = format::decode(node, lattice);
            return std::ranges::all_of(mine, [&](const Point& p) {
                const double q[3] = {p[0] * options.unit, p[1] * options.unit, p[2] * options.unit};
                return radial_squared(d, q) < 0.99;
            });
        };
        const double u = options.unit, center[3] = {u * e.center.x, u * e.center.y, u * e.center.z};
        for (;; scale *= 1.01) {
            const double k = u * scale * options.shrink;
            const double factor[6] = {k * e.l11, k * e.l21, k * e.l22, k * e.l31, k * e.l32, k * e.l33};
            format::quantise(node, lattice, center, factor);
            if (options.shrink < 1 || encloses()) return node;
        }
    };

    std::vector<format::PackedLevel> levels;
    std::vector<Part> parts{{0, points.size()}};
    while (!parts.empty()) {
        format::PackedLevel level;
        level.figures.outside_ratio = 1.0 / static_cast<double>(levels.size() + 1);
        level.figures.surface_error = options.unit * level.figures.outside_ratio;
        std::vector<Part> next;
        const bool last = levels.size() + 1 == options.levels;
        for (const Part& part : parts) {
            format::PackedNode node = node_of(part);
            const bool stop = !levels.empty() && random.unit() < options.stop_probability;
            if (!last && !stop && part.end - part.begin >= std::max(options.leaf_points, 2u))
                node.child_count = split(part, next);
            level.nodes.push_back(node);
        }
        levels.push_back(std::move(level));
        parts = std::move(next);
    }
    BakeInfo info;
    info.source_hash = random.next();
    info.alpha = info.beta = 0.5f;
    info.levels = options.levels - 1;
    info.resolution = 32;
    Scene out{{}, format::encode(info, options.degree, lattice, levels)};
    for (Point& p : points)
        for (double& x : p) x *= options.unit;
    out.points = std::move(points);
    return out;
}

} // namespace prolate::scenes
