#include "query/inside/crossing.hpp"

#include "query/triangle/placed.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace prolate::query {
namespace {

using glm::dvec3;

int sign_of(double x) {
    return (x > 0) - (x < 0);
}

// Sign of a b - c d, exactly. Rounding keeps the order of the products; the error of each is a double.
int sign_of_difference(double a, double b, double c, double d) {
    const double ab = a * b, cd = c * d;
    if (ab != cd) return sign_of(ab - cd);
    const double ab_error = std::fma(a, b, -ab), cd_error = std::fma(c, d, -cd);
    return (ab_error > cd_error) - (ab_error < cd_error);
}

// On which side of the projected edge from a to b the origin lies: +1 left, -1 right; 0 only if a and b coincide there.
int side(const dvec3& a, const dvec3& b) {
    if (const int sign = sign_of_difference(a.x, b.y, a.y, b.x); sign != 0) return sign;
    // Of (a.x - t)(b.y - t^2) - (a.y - t^2)(b.x - t) the leading term.
    return a.y != b.y ? sign_of(a.y - b.y) : sign_of(b.x - a.x);
}

// An exact sum of doubles: parts of growing size that do not overlap, so that the last one that is not zero decides.
class Sum {
public:
    void add(double x) {
        for (size_t i = 0; i < size_; ++i) {
            const double s = x + parts_[i], from_part = s - x;
            parts_[i] = (x - (s - from_part)) + (parts_[i] - from_part);
            x = s;
        }
        parts_[size_++] = x;
    }
    void add_product(double a, double b) {
        const double ab = a * b;
        add(std::fma(a, b, -ab));
        add(ab);
    }
    int sign() const {
        for (size_t i = size_; i-- > 0;)
            if (parts_[i] != 0) return sign_of(parts_[i]);
        return 0;
    }

private:
    std::array<double, 24> parts_; // six triple products of four terms each
    size_t size_ = 0;
};

// Sign of a.(b x c).
int sign_of_determinant(const dvec3& a, const dvec3& b, const dvec3& c) {
    Sum sum;
    const auto add_triple = [&sum](double x, double y, double z) { // x y z
        const double xy = x * y;
        sum.add_product(std::fma(x, y, -xy), z);
        sum.add_product(xy, z);
    };
    add_triple(a.x, b.y, c.z), add_triple(b.x, c.y, a.z), add_triple(c.x, a.y, b.z);
    add_triple(-a.y, b.x, c.z), add_triple(-b.y, c.x, a.z), add_triple(-c.y, a.x, b.z);
    return sum.sign();
}

// How the ray from the origin along +z crosses the triangle: +1 outwards, -1 inwards, 0 not at all.
int crossing(const dvec3& a, const dvec3& b, const dvec3& c) {
    const auto [left, right] = std::minmax({a.x, b.x, c.x});
    const auto [bottom, top] = std::minmax({a.y, b.y, c.y});
    if (left > 0 || right < 0 || bottom > 0 || top < 0) return 0;
    const int turn = side(a, b);
    if (turn == 0 || side(b, c) != turn || side(c, a) != turn) return 0;
    const auto [low, high] = std::minmax({a.z, b.z, c.z});
    if (low > 0) return turn;
    if (high < 0) return 0;
    return sign_of_determinant(a, b, c) == turn ? turn : 0;
}

} // namespace

int64_t crossings(const TreeView& tree, const TriangleRange& triangles, const dvec3& origin,
                  const AxisDirection& direction) noexcept {
    // A turn to +z: a cyclic exchange, and for the opposite direction another half turn.
    const auto z = static_cast<glm::length_t>(direction.axis);
    glm::length_t x = (z + 1) % 3, y = (z + 2) % 3;
    if (direction.negative) std::swap(x, y);
    const double sign = direction.negative ? -1 : 1;
    const auto corner = [&](uint32_t v) {
        const dvec3 d = position(tree, v) - origin;
        return dvec3(d[x], d[y], sign * d[z]);
    };
    int64_t sum = 0;
    for (uint32_t t = triangles.first; t < triangles.first + triangles.count; ++t) {
        const auto [a, b, c] = tree.triangle(t);
        sum += crossing(corner(a), corner(b), corner(c));
    }
    return sum;
}

} // namespace prolate::query
