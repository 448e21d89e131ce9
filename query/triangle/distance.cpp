#include "query/triangle/distance.hpp"

#include "query/triangle/pair.hpp"

#include <cmath>
#include <limits>
#include <optional>

namespace prolate::query {
namespace {

using glm::dvec3;

// A lower bound of so many times the margin is beyond doubt: triangles that are farther apart are found to be.
constexpr double kDoubtful = 32;

// The point of a triangle below or above x, if there is one: from the areas of the triangles that x makes with its
// edges.
std::optional<dvec3> foot(const dvec3& x, const dvec3 (&corner)[3], const dvec3 (&edge)[3], const dvec3& normal) {
    double weight[3];
    for (size_t i = 0; i < 3; ++i) {
        weight[(i + 2) % 3] = glm::dot(normal, glm::cross(edge[i], x - corner[i]));
        if (!(weight[(i + 2) % 3] >= 0)) return std::nullopt;
    }
    const double sum = weight[0] + weight[1] + weight[2];
    if (!(sum > 0)) return std::nullopt;
    return weight[0] / sum * corner[0] + weight[1] / sum * corner[1] + weight[2] / sum * corner[2];
}

class TriangleDistanceSearch {
public:
    explicit TriangleDistanceSearch(const TrianglePair& pair) : pair_(pair), x_(pair.p[0]), y_(pair.q[0]) {}

    void run() {
        if (!edges_settle() && !faces_settle()) pair_.any_direction([&](const dvec3& n) { return bound_by(n); });
    }
    TriangleDistance result(double bound) const {
        return {.lower = lower(bound),
                .upper = std::isfinite(square_) ? std::sqrt(square_) + bound : std::numeric_limits<double>::infinity(),
                .on_a = pair_.origin + x_,
                .on_b = pair_.origin + y_,
                .normal = normal_};
    }

private:
    double lower(double bound) const {
        const double least = gap_ / length_ - bound;
        return least > 0 ? least : 0; // a NaN, too
    }
    // Is the lower bound as good as the upper one, once n is considered?
    bool bound_by(const dvec3& n) {
        const double gap = pair_.gap(n), length = glm::length(n);
        if (gap * length_ > gap_ * length) {
            gap_ = gap, length_ = length;
            normal_ = pair_.leads_from_a(n) ? n : -n;
        }
        return gap_ > kTightBound * std::sqrt(square_) * length_;
    }
    // The same for points x of A and y of B.
    bool settles(const dvec3& x, const dvec3& y) {
        const dvec3 n = y - x;
        const double square = glm::dot(n, n);
        if (!(square < square_)) return false;
        square_ = square, x_ = x, y_ = y;
        return bound_by(n);
    }
    bool edges_settle() {
        for (size_t i = 0; i < 3; ++i)
            for (size_t j = 0; j < 3; ++j) {
                const auto [s, t] = closest(pair_.d[i], pair_.e[j], pair_.p[i] - pair_.q[j]);
                if (settles(pair_.p[i] + s * pair_.d[i], pair_.q[j] + t * pair_.e[j])) return true;
            }
        return false;
    }
    bool faces_settle() {
        // The corner i, and where the edge from i crosses the plane of the other triangle.
        const auto one_way = [](const dvec3(&x)[3], const dvec3(&edge)[3], const dvec3& y, const dvec3& normal,
                                auto&& use) {
            for (size_t i = 0; i < 3; ++i) {
                if (use(x[i])) return true;
                const double height = glm::dot(normal, x[i] - y), next = glm::dot(normal, x[(i + 1) % 3] - y);
                if (height * next < 0 && use(x[i] + height / (height - next) * edge[i])) return true;
            }
            return false;
        };
        return one_way(pair_.p, pair_.d, pair_.q[0], pair_.normal_b,
                       [&](const dvec3& x) {
                           const auto y = foot(x, pair_.q, pair_.e, pair_.normal_b);
                           return y && settles(x, *y);
                       }) ||
               one_way(pair_.q, pair_.e, pair_.p[0], pair_.normal_a, [&](const dvec3& y) {
                   const auto x = foot(y, pair_.p, pair_.d, pair_.normal_a);
                   return x && settles(*x, y);
               });
    }

    const TrianglePair& pair_;
    double square_ = std::numeric_limits<double>::infinity(); // |y - x|^2 of the nearest points so far
    dvec3 x_, y_;
    double gap_ = 0, length_ = 1; // gap(n) and |n| of the best direction so far, which is
    dvec3 normal_{0, 0, 0};       // or its opposite
};

} // namespace

TriangleDistance distance(const PlacedTriangle& a, const PlacedTriangle& b, double margin) noexcept {
    const TrianglePair pair(a, b);
    TriangleDistanceSearch search(pair);
    search.run();
    const double bound = margin * (a.reach + b.reach);
    TriangleDistance out = search.result(bound);
    if (!(out.lower > kDoubtful * bound)) // its directions are others than those of separated()
        out.lower = separated(a, b, 0, margin) ? std::max(out.lower, std::numeric_limits<double>::min()) : 0;
    return out;
}

double gap_along(const PlacedTriangle& a, const PlacedTriangle& b, const dvec3& n) noexcept {
    double high = glm::dot(n, a.corner[0]), low = glm::dot(n, b.corner[0]);
    for (size_t i = 1; i < 3; ++i)
        high = std::max(high, glm::dot(n, a.corner[i])), low = std::min(low, glm::dot(n, b.corner[i]));
    return ((low - high) - kSeparationMargin * (a.reach + b.reach)) * (1 - 0x1p-50);
}

} // namespace prolate::query
