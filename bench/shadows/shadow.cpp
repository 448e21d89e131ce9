// A triangle's shadow is a triangle: its corners' projections. An ellipsoid's is found in its own coordinates, where it
// is the unit ball: with the light at p and the pixel at p + d, the line meets the ball if
//
//     F = (p.d)^2 - (d.d) (p.p - 1) >= 0,
//
// and d is linear in the pixel's place, so along a row of pixels F is a quadratic, and the row's dark part is what lies
// between its roots. The line from the light enters at t = (-(p.d) - sqrt(F)) / (d.d), which must not be beyond the
// pixel, t <= 1. With double precision a pixel errs only if its center is within about 1e-12 of the border.
#include "bench/shadows/shadow.hpp"

#include <algorithm>
#include <cmath>

namespace prolate::bench {
namespace {

using glm::dmat3;
using glm::dvec2;
using glm::dvec3;

// Projects points onto the ground, in pixels from its corner.
class Projection {
public:
    Projection(const dvec3& light, const Ground& g)
        : light_(light), ground_(g), height_(glm::dot(light - g.corner, g.up)), scale_(1 / glm::dot(g.right, g.right)) {
    }
    dvec2 operator()(const dvec3& p) const {
        const dvec3 d = p - light_, on = light_ + d * (height_ / -glm::dot(d, ground_.up)) - ground_.corner;
        return scale_ * dvec2(glm::dot(on, ground_.right), glm::dot(on, ground_.down));
    }

private:
    dvec3 light_;
    const Ground& ground_;
    double height_, scale_;
};

dvec3 to_dvec3(const Vec3& v) {
    return {v.x, v.y, v.z};
}

dmat3 factor_of(const Ellipsoid& e) {
    return {e.l11, e.l21, e.l31, 0, e.l22, e.l32, 0, 0, e.l33}; // column by column
}

void add(Extent& extent, const dvec2& p) {
    extent.add({p.x, p.x, p.y, p.y});
}

// The shadow of a box around the ellipsoid.
Extent extent_of(const Ellipsoid& e, const Projection& project) {
    const dmat3 l = factor_of(e);
    Extent out;
    for (int corner = 0; corner < 8; ++corner)
        add(out,
            project(to_dvec3(e.center) + l * dvec3(corner & 1 ? 1 : -1, corner & 2 ? 1 : -1, corner & 4 ? 1 : -1)));
    return out;
}

// The pixels whose centers lie in low ... high, of `count`.
std::pair<int, int> pixels(double low, double high, int count) {
    const double first = std::ceil(low - 0.5), last = std::floor(high - 0.5);
    return {static_cast<int>(std::clamp(first, 0.0, double(count))),
            static_cast<int>(std::clamp(last, -1.0, count - 1.0))};
}

void fill_triangle(const dvec2 (&p)[3], const Ground& g, Mask& mask) {
    const auto [x0, x1] = pixels(std::min({p[0].x, p[1].x, p[2].x}), std::max({p[0].x, p[1].x, p[2].x}), g.columns);
    const auto [y0, y1] = pixels(std::min({p[0].y, p[1].y, p[2].y}), std::max({p[0].y, p[1].y, p[2].y}), g.rows);
    const auto cross = [](const dvec2& a, const dvec2& b) { return a.x * b.y - a.y * b.x; };
    const double turn = cross(p[1] - p[0], p[2] - p[0]) < 0 ? -1 : 1;
    for (int y = y0; y <= y1; ++y)
        for (int x = x0; x <= x1; ++x) {
            const dvec2 c(x + 0.5, y + 0.5);
            bool inside = true;
            for (int i = 0; i < 3; ++i) inside &= turn * cross(p[(i + 1) % 3] - p[i], c - p[i]) >= 0;
            if (inside) mask[static_cast<size_t>(y) * g.columns + x] = 1;
        }
}

} // namespace

dvec3 Lamp::point(int i, int j, int n) const {
    return center + ((i + 0.5) / n - 0.5) * side + ((j + 0.5) / n - 0.5) * other_side;
}

void Extent::add(const Extent& e) {
    x0 = std::min(x0, e.x0), x1 = std::max(x1, e.x1), y0 = std::min(y0, e.y0), y1 = std::max(y1, e.y1);
}

void cast_shadow(MeshView mesh, const dvec3& light, const Ground& ground, Mask& mask) {
    const Projection project(light, ground);
    std::vector<dvec2> corners;
    corners.reserve(mesh.vertices.size());
    for (const Vec3& v : mesh.vertices) corners.push_back(project(to_dvec3(v)));
    for (const Triangle& t : mesh.triangles) fill_triangle({corners[t[0]], corners[t[1]], corners[t[2]]}, ground, mask);
}

void cast_shadow(std::span<const Ellipsoid> cover, const dvec3& light, const Ground& g, Mask& mask) {
    const Projection project(light, g);
    for (const Ellipsoid& e : cover) {
        const Extent extent = extent_of(e, project);
        const auto [y0, y1] = pixels(extent.y0, extent.y1, g.rows);
        const dmat3 inverse = glm::inverse(factor_of(e));
        const dvec3 p = inverse * (light - to_dvec3(e.center)), step = inverse * g.right;
        const double beyond = glm::dot(p, p) - 1, ps = glm::dot(p, step), ss = glm::dot(step, step);
        for (int y = y0; y <= y1; ++y) {
            const dvec3 first = inverse * (g.corner + 0.5 * g.right + (y + 0.5) * g.down - light); // d of pixel 0
            const double pf = glm::dot(p, first), fs = glm::dot(first, step), ff = glm::dot(first, first);
            // F(x) = a x^2 + 2 b x + c
            const double a = ps * ps - ss * beyond, b = pf * ps - fs * beyond, c = pf * pf - ff * beyond;
            const double quarter = b * b - a * c;
            if (!(a < 0) || !(quarter >= 0)) continue; // a >= 0 only if the ellipsoid reaches as high as the light
            const double root = std::sqrt(quarter);
            const auto [x0, x1] = pixels((b - root) / -a + 0.5, (b + root) / -a + 0.5, g.columns);
            for (int x = x0; x <= x1; ++x) {
                const double pd = pf + x * ps, dd = ff + x * (2 * fs + x * ss), f = c + x * (2 * b + x * a);
                if (-pd - std::sqrt(std::max(0.0, f)) <= dd) mask[static_cast<size_t>(y) * g.columns + x] = 1;
            }
        }
    }
}

Extent shadow_extent(MeshView mesh, const dvec3& light, const Ground& ground) {
    const Projection project(light, ground);
    Extent out;
    for (const Vec3& v : mesh.vertices) add(out, project(to_dvec3(v)));
    return out;
}

Extent shadow_extent(std::span<const Ellipsoid> cover, const dvec3& light, const Ground& ground) {
    const Projection project(light, ground);
    Extent out;
    for (const Ellipsoid& e : cover) out.add(extent_of(e, project));
    return out;
}

Likeness likeness(const Shadow& a, const Shadow& b) {
    double both = 0, either = 0, sum = 0, seen = 0;
    for (size_t i = 0; i < a.darkness.size(); ++i) {
        both += a.from_center[i] & b.from_center[i], either += a.from_center[i] | b.from_center[i];
        sum += std::abs(a.darkness[i] - b.darkness[i]), seen += a.darkness[i] > 0 || b.darkness[i] > 0;
    }
    return {both / either, sum / seen};
}

} // namespace prolate::bench
