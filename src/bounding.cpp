// A nearly smallest ellipsoid around ellipsoids: that around some of their points, to which those that stick out of it
// farthest are added a few times; what is left is paid for by growth about the center. Of points: the multiplicative
// algorithm for the dual, D-optimal design (Titterington 1976; Khachiyan 1996 has the same problem and a faster method,
// which for a percent is not needed). Deterministic: one order, and only operations that IEEE 754 rounds exactly.
#include "src/bounding.hpp"

#include "src/nested.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace prolate::format {
namespace {

using Point = std::array<double, 3>;
using Square = std::array<Point, 3>;

constexpr int kRounds = 6, kIterations = 60;
constexpr size_t kMostAdded = 48;     // points a round
constexpr double kEnough = 1.004;     // a radial coordinate, of the points; and squared, of the algorithm
constexpr double kThinnest = 0x1p-20; // share of the size that any axis has at least, and four times that, ...
constexpr double kMostGrowth = 1.02;  // ... until rounding to the file costs no more than this

double dot(const Point& x, const Point& y) {
    return x[0] * y[0] + x[1] * y[1] + x[2] * y[2];
}
Point times(const Square& m, const Point& x) {
    return {dot(m[0], x), dot(m[1], x), dot(m[2], x)};
}
Square inverse(const Square& q) { // of a symmetric one
    const double a = q[1][1] * q[2][2] - q[1][2] * q[1][2], b = q[0][2] * q[1][2] - q[0][1] * q[2][2],
                 c = q[0][1] * q[1][2] - q[0][2] * q[1][1], d = q[0][0] * q[2][2] - q[0][2] * q[0][2],
                 e = q[0][1] * q[0][2] - q[0][0] * q[1][2], f = q[0][0] * q[1][1] - q[0][1] * q[0][1];
    const double s = 1 / (q[0][0] * a + q[0][1] * b + q[0][2] * c);
    return {{{a * s, b * s, c * s}, {b * s, d * s, e * s}, {c * s, e * s, f * s}}};
}
Point center_of(const Ellipsoid& e) {
    return {e.center.x, e.center.y, e.center.z};
}
// The point of an ellipsoid that is farthest along n.
Point farthest(const Ellipsoid& e, const Point& n) {
    const Point w{e.l11 * n[0] + e.l21 * n[1] + e.l31 * n[2], e.l22 * n[1] + e.l32 * n[2], e.l33 * n[2]};
    const double scale = 1 / std::max(std::sqrt(dot(w, w)), 0x1p-500);
    return {e.center.x + e.l11 * w[0] * scale, e.center.y + (e.l21 * w[0] + e.l22 * w[1]) * scale,
            e.center.z + (e.l31 * w[0] + e.l32 * w[1] + e.l33 * w[2]) * scale};
}

// {x : (x - center)^T shape^-1 (x - center) <= 1}
struct Fit {
    Point center;
    Square shape, inverse;
    double radial_squared(const Point& p) const {
        const Point x{p[0] - center[0], p[1] - center[1], p[2] - center[2]};
        return dot(x, times(inverse, x));
    }
    // With all axes longer, by this share of the size.
    Ellipsoid thickened(double share) const {
        const double more = share * share * (shape[0][0] + shape[1][1] + shape[2][2]);
        const double l11 = std::sqrt(shape[0][0] + more), l21 = shape[1][0] / l11, l31 = shape[2][0] / l11;
        const double l22 = std::sqrt(std::max(shape[1][1] - l21 * l21, 0.0) + more),
                     l32 = (shape[2][1] - l31 * l21) / l22;
        const double l33 = std::sqrt(std::max(shape[2][2] - l31 * l31 - l32 * l32, 0.0) + more);
        const auto round = [](double x) { return static_cast<float>(x); };
        return {{round(center[0]), round(center[1]), round(center[2])},
                round(l11),
                round(l21),
                round(l22),
                round(l31),
                round(l32),
                round(l33)};
    }
};

Fit around(const std::vector<Point>& points) {
    std::vector<double> weight(points.size(), 1.0 / static_cast<double>(points.size()));
    Fit fit{};
    for (int i = 0; i < kIterations; ++i) {
        fit.center = {}, fit.shape = {};
        for (size_t p = 0; p < points.size(); ++p)
            for (size_t k = 0; k < 3; ++k) fit.center[k] += weight[p] * points[p][k];
        for (size_t p = 0; p < points.size(); ++p) {
            const Point x{points[p][0] - fit.center[0], points[p][1] - fit.center[1], points[p][2] - fit.center[2]};
            for (size_t j = 0; j < 3; ++j)
                for (size_t k = 0; k < 3; ++k) fit.shape[j][k] += 3 * weight[p] * x[j] * x[k];
        }
        const double trace = fit.shape[0][0] + fit.shape[1][1] + fit.shape[2][2];
        for (size_t k = 0; k < 3; ++k) fit.shape[k][k] += kThinnest * kThinnest * trace;
        fit.inverse = inverse(fit.shape);
        double most = 0, sum = 0;
        for (size_t p = 0; p < points.size(); ++p) { // (1 + 3 r^2) / 4 is at most 1 for all, at the optimum
            const double square = fit.radial_squared(points[p]);
            most = std::max(most, square);
            weight[p] *= (1 + 3 * square) / 4, sum += weight[p];
        }
        for (double& w : weight) w /= sum;
        if (most < kEnough * kEnough) break;
    }
    return fit;
}

Fit around(const std::vector<Ellipsoid>& ellipsoids) {
    std::vector<Point> points;
    const auto support = [&](const Point& n) {
        Point best = farthest(ellipsoids[0], n);
        for (const Ellipsoid& e : ellipsoids)
            if (const Point p = farthest(e, n); dot(n, p) > dot(n, best)) best = p;
        points.push_back(best);
    };
    double half[3];
    for (size_t k = 0; k < 3; ++k) {
        Point n{};
        n[k] = 1, support(n);
        const double high = points.back()[k];
        n[k] = -1, support(n);
        half[k] = std::max(high - points.back()[k], 0x1p-500);
    }
    for (int i = 0; i < 27; ++i) { // towards edges and corners of the box around all
        const int x = i % 3 - 1, y = i / 3 % 3 - 1, z = i / 9 - 1;
        if (x * x + y * y + z * z >= 2) support({x / half[0], y / half[1], z / half[2]});
    }
    Fit fit = around(points);
    struct Farthest {
        double square;
        Point point;
    };
    std::vector<Farthest> out;
    for (int round = 0; round < kRounds; ++round) {
        out.clear();
        for (const Ellipsoid& e : ellipsoids) {
            Point p = center_of(e);
            for (int i = 0; i < 4; ++i) {
                const Point x{p[0] - fit.center[0], p[1] - fit.center[1], p[2] - fit.center[2]};
                p = farthest(e, times(fit.inverse, x));
            }
            if (const double square = fit.radial_squared(p); square > kEnough * kEnough) out.push_back({square, p});
        }
        if (out.empty()) break;
        std::stable_sort(out.begin(), out.end(),
                         [](const Farthest& x, const Farthest& y) { return x.square > y.square; });
        for (size_t i = 0; i < std::min(out.size(), kMostAdded); ++i) points.push_back(out[i].point);
        fit = around(points);
    }
    return fit;
}

} // namespace

Bounding::Bounding(std::span<const PackedLevel> levels, const Lattice& lattice) : levels_(levels), lattice_(lattice) {
    for (const PackedLevel& level : levels) {
        std::vector<size_t>& first = first_child_.emplace_back(1, 0);
        std::vector<Ellipsoid>& ellipsoids = ellipsoids_.emplace_back();
        for (const PackedNode& node : level.nodes) {
            first.push_back(first.back() + node.child_count);
            ellipsoids.push_back(decode(node, lattice));
        }
    }
}

std::vector<Ellipsoid> Bounding::below(size_t level, size_t index) const {
    std::vector<Ellipsoid> out;
    for (size_t l = level, first = index, last = index + 1;;) {
        first = first_child_[l][first], last = first_child_[l][last], ++l;
        if (first == last) return out;
        out.insert(out.end(), &ellipsoids_[l][first], &ellipsoids_[l][first] + (last - first));
    }
}

PackedNode Bounding::node(size_t level, size_t index) const {
    PackedNode out = levels_[level].nodes[index];
    if (out.child_count == 0) return out;
    const std::vector<Ellipsoid> all = below(level, index);
    for (size_t k = 0; k < 3; ++k) {
        out.box_low[k] = HUGE_VAL, out.box_high[k] = -HUGE_VAL;
        for (const Ellipsoid& e : all) {
            const double half[3] = {e.l11, std::hypot(e.l21, e.l22), std::hypot(e.l31, e.l32, e.l33)};
            out.box_low[k] = std::min(out.box_low[k], center_of(e)[k] - half[k] * (1 + 0x1p-40));
            out.box_high[k] = std::max(out.box_high[k], center_of(e)[k] + half[k] * (1 + 0x1p-40));
        }
    }
    const Fit fit = around(all);
    const auto growth_of = [&](const Ellipsoid& e) {
        const Outer outer(e);
        double most = 0;
        for (const Ellipsoid& inner : all)
            if (const double growth = outer.growth_to_hold(inner); !(growth <= most)) most = growth;
        return most;
    };
    const auto store = [&](const Ellipsoid& e, double scale) {
        const double factor[6] = {scale * e.l11, scale * e.l21, scale * e.l22,
                                  scale * e.l31, scale * e.l32, scale * e.l33};
        quantise(out, lattice_, fit.center.data(), factor);
        return growth_of(decode(out, lattice_));
    };
    Ellipsoid best = fit.thickened(0);
    const double unrounded = growth_of(best);
    double least = HUGE_VAL;
    for (double thickness = kThinnest; thickness < 1; thickness *= 4) {
        const Ellipsoid e = fit.thickened(thickness);
        const double growth = store(e, 1), size = volume(e) * (growth * growth * growth);
        if (size < least) least = size, best = e;
        if (growth < kMostGrowth * unrounded) break;
    }
    double scale = 1;
    for (double growth; !((growth = store(best, scale)) <= 1);) scale *= growth * (1 + 0x1p-20);
    return out;
}

} // namespace prolate::format
