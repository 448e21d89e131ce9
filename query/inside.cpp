#include "query/inside.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>

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
    const int turn = side(a, b);
    if (turn == 0 || side(b, c) != turn || side(c, a) != turn) return 0;
    const auto [low, high] = std::minmax({a.z, b.z, c.z});
    if (low > 0) return turn;
    if (high < 0) return 0;
    return sign_of_determinant(a, b, c) == turn ? turn : 0;
}

// Does the ray from `p` along +z miss the box of the ellipsoid?
bool misses(const Ellipsoid& e, const PlacedPoint& p) {
    const PlacedEllipsoid placed = place(e);
    const double slack = kSeparationMargin * (p.reach + placed.reach);
    const dvec3 r = placed.center - p.position;
    const auto half = [&](double l1, double l2, double l3) { return std::sqrt(l1 * l1 + l2 * l2 + l3 * l3) + slack; };
    return std::abs(r.x) > half(e.l11, 0, 0) || std::abs(r.y) > half(e.l21, e.l22, 0) ||
           r.z < -half(e.l31, e.l32, e.l33);
}

} // namespace

PlacedPoint place(const Vec3& p, const RelativePose& to_frame) noexcept {
    const dvec3 exact{p.x, p.y, p.z};
    return {to_frame.rotation * exact + to_frame.translation, glm::length(exact) + to_frame.distance};
}

std::optional<int64_t> winding_number(const TreeView& tree, const PlacedPoint& point, uint64_t& tests,
                                      uint64_t most_tests) noexcept {
    const auto corner = [&](uint32_t v) {
        const Vec3 p = tree.vertex(v);
        return dvec3(p.x, p.y, p.z) - point.position;
    };
    int64_t winding = 0;
    struct {
        uint32_t next, end;
    } stack[kMaxLevels] = {{0, 1}}; // siblings still to be looked at
    for (uint32_t depth = 0;;) {
        if (stack[depth].next == stack[depth].end) {
            if (depth == 0) return winding;
            --depth;
            continue;
        }
        const uint32_t node = stack[depth].next++;
        if (tests >= most_tests) return {};
        ++tests;
        if (misses(tree.ellipsoid(node), point)) continue;
        if (const ChildRange children = tree.children(node); children.count > 0) {
            stack[++depth] = {children.first, children.first + children.count};
            continue;
        }
        const TriangleRange triangles = tree.triangles(node);
        for (uint32_t t = triangles.first; t < triangles.first + triangles.count; ++t) {
            const auto [a, b, c] = tree.triangle(t);
            winding += crossing(corner(a), corner(b), corner(c));
        }
    }
}

} // namespace prolate::query
