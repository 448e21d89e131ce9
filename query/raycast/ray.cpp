#include "query/raycast/ray.hpp"

#include "query/ellipsoid/nearest_direction.hpp"
#include "query/ellipsoid/placed.hpp"

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

namespace prolate::query {
namespace {

using glm::dmat3;
using glm::dvec3;

double norm1(double x, double y) {
    return std::abs(x) + std::abs(y);
}

// L^-1 x and L^-T x.
dvec3 solve(const dmat3& l, const dvec3& x) {
    const double u = x.x / l[0][0], v = (x.y - l[0][1] * u) / l[1][1];
    return {u, v, (x.z - l[0][2] * u - l[1][2] * v) / l[2][2]};
}
dvec3 solve_transposed(const dmat3& l, const dvec3& x) {
    const double w = x.z / l[2][2], v = (x.y - l[1][2] * w) / l[1][1];
    return {(x.x - l[0][1] * v - l[0][2] * w) / l[0][0], v, w};
}

// A corner where the ray is the z-axis.
struct Corner {
    double x, y, z;
};

// Where a triangle that is nearly a segment comes near to the axis; empty if low > high.
struct Depths {
    double low = std::numeric_limits<double>::infinity(), high = -low, first = low;
};
Depths depths_of_edges(const Corner (&c)[3], double near) {
    Depths out;
    for (size_t i = 0; i < 3; ++i) {
        const Corner &a = c[i], &b = c[(i + 1) % 3];
        const double x = b.x - a.x, y = b.y - a.y, z = b.z - a.z, square = x * x + y * y;
        const double s = square > 0 ? std::clamp(-(a.x * x + a.y * y) / square, 0.0, 1.0) : 0;
        if (norm1(a.x + s * x, a.y + s * y) > near) continue;
        const double depth = a.z + s * z, extent = norm1(x, y);
        // An edge along the axis is met anywhere.
        const bool along_axis = !(extent > 4 * near);
        const double doubt = along_axis ? std::abs(z) : 4 * near / extent * std::abs(z);
        out.low = std::min(out.low, depth - doubt), out.high = std::max(out.high, depth + doubt);
        out.first = std::min(out.first, along_axis ? std::min(a.z, b.z) : depth);
    }
    return out;
}

// Bodies as the ray sees them that shall come near: a point, how far they reach along n, and the direction from their
// point that is nearest to x; 0 if x is one of them. And others to try, where rounding may have hidden which that is.
class NearEllipsoid {
public:
    explicit NearEllipsoid(const PlacedEllipsoid& e) : e_(e), q_(e.factor * glm::transpose(e.factor)) {}
    dvec3 middle() const { return e_.center; }
    double end(const dvec3& n) const { return glm::dot(n, e_.center) + glm::length(n * e_.factor); }
    dvec3 towards(const dvec3& x) const {
        const dvec3 r = x - e_.center;
        return glm::length(solve(e_.factor, r)) > 1 ? nearest_direction(e_.factor, q_, r) : dvec3(0);
    }
    static std::array<dvec3, 0> others(const dvec3& /*x*/) { return {}; }

private:
    const PlacedEllipsoid& e_;
    const dmat3 q_;
};

class NearTriangle {
public:
    explicit NearTriangle(const PlacedTriangle& t) : c_(t.corner) {}
    dvec3 middle() const { return (c_[0] + c_[1] + c_[2]) / 3.0; }
    double end(const dvec3& n) const { return std::max({glm::dot(n, c_[0]), glm::dot(n, c_[1]), glm::dot(n, c_[2])}); }
    // Ericson 2005, section 5.1.5.
    dvec3 towards(const dvec3& x) const {
        const dvec3 ab = c_[1] - c_[0], ac = c_[2] - c_[0], a = x - c_[0], b = x - c_[1], c = x - c_[2];
        const double d1 = glm::dot(ab, a), d2 = glm::dot(ac, a), d3 = glm::dot(ab, b), d4 = glm::dot(ac, b),
                     d5 = glm::dot(ab, c), d6 = glm::dot(ac, c);
        if (d1 <= 0 && d2 <= 0) return a;
        if (d3 >= 0 && d4 <= d3) return b;
        if (d6 >= 0 && d5 <= d6) return c;
        const double wc = d1 * d4 - d3 * d2, wb = d5 * d2 - d1 * d6, wa = d3 * d6 - d5 * d4; // areas
        if (wc <= 0 && d1 >= 0 && d3 <= 0) return a - d1 / (d1 - d3) * ab;
        if (wb <= 0 && d2 >= 0 && d6 <= 0) return a - d2 / (d2 - d6) * ac;
        if (wa <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) return b - (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (ac - ab);
        const dvec3 n = glm::cross(ab, ac);
        return glm::dot(n, a) < 0 ? -n : n;
    }
    // From the nearest point of each edge: of a needle, the signs of the areas above mean nothing.
    std::array<dvec3, 3> others(const dvec3& x) const {
        std::array<dvec3, 3> out;
        for (size_t i = 0; i < 3; ++i) {
            const dvec3 from = x - c_[i], edge = c_[(i + 1) % 3] - c_[i];
            const double square = glm::dot(edge, edge);
            out[i] = from - (square > 0 ? std::clamp(glm::dot(from, edge) / square, 0.0, 1.0) : 0.0) * edge;
        }
        return out;
    }

private:
    const dvec3 (&c_)[3];
};

constexpr int kNewtonSteps = 64;

template <class Convex>
std::optional<RayHit> approach(double distance, const PlacedRay& ray, const Convex& body, double tolerance) {
    struct Look {
        dvec3 n;
        double gap, slope; // along n, of the ray's begin; and how it grows
        double at(double t) const { return gap + t * slope; }
    };
    const auto look_along = [&](const dvec3& direction) {
        const dvec3 n = direction / glm::length(direction); // NaN if 0, which claims nothing
        return Look{n, glm::dot(n, ray.origin) - body.end(n) - distance, glm::dot(n, ray.direction)};
    };
    const auto look_from = [&](double t) { return look_along(body.towards(ray.origin + t * ray.direction)); };
    // Most that miss do so where they come near to the body's middle.
    const double square = glm::dot(ray.direction, ray.direction);
    Look look = look_from(std::clamp(glm::dot(body.middle() - ray.origin, ray.direction) / square, 0.0, ray.length));
    if (look.gap > tolerance && look.at(ray.length) > tolerance) return {};

    double t = 0;
    for (int i = 0; i < kNewtonSteps; ++i) {
        look = look_from(t);
        // Certainly separated until the gap falls to `tolerance`; the hit is certain enough within twice that.
        double most = 2 * tolerance;
        if (!(look.at(t) > most))
            for (const dvec3& direction : body.others(ray.origin + t * ray.direction))
                if (const Look other = look_along(direction); other.at(t) > most) look = other, most = other.at(t);
        const double here = look.at(t) - tolerance;
        if (!(here > tolerance)) break;
        if (look.at(ray.length) > tolerance) return {};
        const double next = t - here / look.slope;
        if (!(next > t)) break;
        t = std::min(next, ray.length);
    }
    const double room = t == 0 ? look.gap : look.at(t) + distance; // NaN inside the body
    return RayHit{t, room >= 0 ? look.n : dvec3(0)};
}

// Without branches, which directions of many rays would have guessed wrong.
RayShear shear_to_axis(const dvec3& d) {
    const double x = std::abs(d.x), y = std::abs(d.y), z = std::abs(d.z);
    const auto x_is_longest = static_cast<size_t>(x > y) & static_cast<size_t>(x > z),
               y_is_longest = static_cast<size_t>(!(x > y)) & static_cast<size_t>(y > z);
    const size_t k = 2 - 2 * x_is_longest - y_is_longest;
    constexpr size_t kNext[] = {1, 2, 0, 1};
    const size_t i = kNext[k], j = kNext[k + 1];
    const double axes[] = {d.x, d.y, d.z}, along = axes[k]; // glm's own [] branches
    return {.i = i,
            .j = j,
            .k = k,
            .shear = {axes[i] / along, axes[j] / along},
            .sign = along < 0 ? -1.0 : 1.0,
            .per_t = std::abs(along)};
}

} // namespace

RayBound ray_bound(const TreeView& tree) noexcept {
    const detail::RootVolume& root = tree.raw().root();
    const auto scale = double{tree.scale()};
    constexpr double kRoundUp = 1 + 0x1p-48; // as the reach of the farthest corner may be
    return {.center = {root.center[0] * scale, root.center[1] * scale, root.center[2] * scale},
            .radius = root.radius * scale,
            .reach = root.reach * scale * kRoundUp};
}

PlacedRay place(const Ray& ray, const dmat3& rotation, const dvec3& origin, double far, const RayBound& bound,
                double distance) noexcept {
    const dvec3 direction = rotation * to_double(ray.direction);
    const double square = glm::dot(direction, direction), speed = std::sqrt(square);
    // Whatever is met lies in the ball, or near it, so |t - middle| speed is at most its radius.
    const double reach = far + bound.reach + distance, radius = bound.radius + distance + kSeparationMargin * reach;
    const double middle = glm::dot(bound.center - origin, direction) / square, half = radius / speed;
    const double begin = std::max(0.0, middle - half), end = std::min(double{ray.max_t}, middle + half);
    PlacedRay out{};

    out.empty = begin > end;
    out.origin = origin + begin * direction, out.direction = direction;
    out.begin = begin, out.length = end - begin;
    out.reach = reach + end * speed;
    out.valid = speed > 0 && std::isfinite(begin) && std::isfinite(end) && std::isfinite(out.reach);
    out.shear = shear_to_axis(direction);
    return out;
}

std::optional<RayHit> hit(const PlacedRay& ray, const PlacedEllipsoid& e, double margin) noexcept {
    const dvec3 r = e.center - ray.origin;
    const dvec3 y = solve(e.factor, -r), v = solve(e.factor, ray.direction);
    const double vv = glm::dot(v, v), nearest = -glm::dot(y, v) / vv;
    const dvec3 m = y + nearest * v;
    const double back = std::sqrt(std::max(0.0, 1 - glm::dot(m, m)) / vv);
    const bool ahead = nearest > back;
    const dvec3 z = ahead ? m - back * v : y, normal = solve_transposed(e.factor, z);
    const double gap = -glm::dot(normal, r) - glm::length(normal * e.factor);
    const double far = std::max(0.0, -ray.length * glm::dot(normal, ray.direction));
    if (gap - far > margin * glm::length(normal) * (ray.reach + e.reach)) return {};
    if (!ahead) return RayHit{0, glm::dot(y, y) < 1 ? dvec3(0) : normal};
    return RayHit{std::min(nearest - back, ray.length), normal};
}

std::optional<RayHit> hit(const PlacedRay& ray, const PlacedTriangle& triangle, double margin) noexcept {
    const double tau = margin * (ray.reach + triangle.reach);
    const RayShear& shear = ray.shear;
    const auto i = static_cast<glm::length_t>(shear.i), j = static_cast<glm::length_t>(shear.j),
               k = static_cast<glm::length_t>(shear.k);
    Corner c[3];
    for (size_t n = 0; n < 3; ++n) {
        const dvec3 p = triangle.corner[n] - ray.origin;
        c[n] = {p[i] - shear.shear[0] * p[k], p[j] - shear.shear[1] * p[k], shear.sign * p[k]};
    }
    const auto [left, right] = std::minmax({c[0].x, c[1].x, c[2].x});
    const auto [bottom, top] = std::minmax({c[0].y, c[1].y, c[2].y});
    const auto [low, high] = std::minmax({c[0].z, c[1].z, c[2].z});
    const double end = ray.length * shear.per_t;
    if (left > tau || right < -tau || bottom > tau || top < -tau || high < -tau || low > end + tau) return {};

    double weight[3], error = 0; // of the opposite corners
    bool positive = false, negative = false;
    for (size_t n = 0; n < 3; ++n) {
        const Corner &a = c[(n + 1) % 3], &b = c[(n + 2) % 3];
        weight[n] = a.x * b.y - a.y * b.x;
        const double bound = tau * (norm1(a.x, a.y) + norm1(b.x, b.y));
        positive = positive || weight[n] > bound, negative = negative || weight[n] < -bound;
        error += bound;
    }
    if (positive && negative) return {};
    double depth, from, to;
    if (positive || negative) {
        double sum = 0;
        for (double& w : weight) w = negative ? std::max(-w, 0.0) : std::max(w, 0.0), sum += w;
        depth = std::clamp((weight[0] * c[0].z + weight[1] * c[1].z + weight[2] * c[2].z) / sum, low, high);
        const double doubt = std::min(1.0, error / sum) * (high - low);
        from = depth - doubt, to = depth + doubt;
    } else {
        const Depths depths = depths_of_edges(c, 16 * tau);
        depth = depths.first, from = depths.low, to = depths.high;
    }
    if (to < -tau || from > end + tau) return {};
    const dvec3 normal = glm::cross(triangle.corner[1] - triangle.corner[0], triangle.corner[2] - triangle.corner[0]);
    return RayHit{std::clamp(depth / shear.per_t, 0.0, ray.length), normal};
}

std::optional<RayHit> hit_within(double distance, const PlacedRay& ray, const PlacedEllipsoid& e,
                                 double margin) noexcept {
    return approach(distance, ray, NearEllipsoid(e), margin * (ray.reach + e.reach + distance));
}

std::optional<RayHit> hit_within(double distance, const PlacedRay& ray, const PlacedTriangle& triangle,
                                 double margin) noexcept {
    return approach(distance, ray, NearTriangle(triangle), margin * (ray.reach + triangle.reach + distance));
}

} // namespace prolate::query
