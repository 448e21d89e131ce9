// Rings of equal latitude: ring r from a pole to the equator has 4 r points, equally spaced. So no edge is twice as
// long as another, and each octant of the sphere is cut like a face of a refined octahedron.
#include "cli/export/sphere.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace prolate::cli {
namespace {

constexpr double kRounding = 1 + 0x1p-40; // more than that of what is computed below

// A triangle with the unit normal n lies at n.v = h. If each corner moves out by at least 1 / h, all its points have
// n.x >= 1, and |x| >= 1.
void move_out(SphereMesh& mesh) {
    using Point = std::array<double, 3>;
    std::vector<double> scale(mesh.vertices.size(), 1);
    for (const auto& [a, b, c] : mesh.triangles) {
        const Point &p = mesh.vertices[a], &q = mesh.vertices[b], &r = mesh.vertices[c];
        const Point d{q[0] - p[0], q[1] - p[1], q[2] - p[2]}, e{r[0] - p[0], r[1] - p[1], r[2] - p[2]};
        const Point n{d[1] * e[2] - d[2] * e[1], d[2] * e[0] - d[0] * e[2], d[0] * e[1] - d[1] * e[0]};
        const double height = (n[0] * p[0] + n[1] * p[1] + n[2] * p[2]) / std::hypot(n[0], n[1], n[2]);
        for (const uint32_t corner : {a, b, c}) scale[corner] = std::max(scale[corner], kRounding / height);
    }
    for (size_t i = 0; i < scale.size(); ++i)
        for (double& x : mesh.vertices[i]) x *= scale[i];
}

} // namespace

SphereMesh sphere_mesh(uint32_t segments, Facets facets) {
    const uint32_t edge = std::max(1u, (segments + 3) / 4); // of the octahedron, in parts
    SphereMesh mesh;
    const auto points = [edge](uint32_t ring) { return std::max(1u, 4 * std::min(ring, 2 * edge - ring)); };
    // sin and cos of a right angle's part k / n, exact at its ends: poles and coordinate circles are where they belong.
    const auto part = [](uint32_t k, uint32_t n) {
        const double angle = std::numbers::pi / 2 * k / n;
        return k == 0   ? std::pair(0.0, 1.0)
               : k == n ? std::pair(1.0, 0.0)
                        : std::pair(std::sin(angle), std::cos(angle));
    };
    std::vector<uint32_t> first; // vertex of each ring
    for (uint32_t ring = 0; ring <= 2 * edge; ++ring) {
        first.push_back(static_cast<uint32_t>(mesh.vertices.size()));
        const uint32_t from_pole = std::min(ring, 2 * edge - ring);
        const auto [radius, height] = part(from_pole, edge);
        for (uint32_t i = 0; i < points(ring); ++i) {
            const auto [s, c] = from_pole ? part(i % from_pole, from_pole) : std::pair(0.0, 1.0);
            const uint32_t quarter = from_pole ? i / from_pole : 0;
            const double x[] = {c, -s, -c, s}, y[] = {s, c, -s, -c};
            mesh.vertices.push_back({radius * x[quarter], radius * y[quarter], ring <= edge ? height : -height});
        }
    }
    // Between a ring and the next one farther from its pole, which has one point more in each quarter.
    for (uint32_t ring = 0; ring < 2 * edge; ++ring) {
        const bool north = ring < edge;
        const uint32_t inner = north ? ring : ring + 1, outer = north ? ring + 1 : ring;
        const uint32_t sides = points(outer) / 4;
        const auto at = [&](uint32_t which, uint32_t i) { return first[which] + i % points(which); };
        const auto add = [&](uint32_t a, uint32_t b, uint32_t c) {
            mesh.triangles.push_back(north ? std::array{a, b, c} : std::array{a, c, b});
        };
        for (uint32_t quarter = 0; quarter < 4; ++quarter)
            for (uint32_t i = 0; i < sides; ++i) {
                const uint32_t in = quarter * (sides - 1) + i, out = quarter * sides + i;
                add(at(inner, in), at(outer, out), at(outer, out + 1));
                if (i + 1 < sides) add(at(inner, in), at(outer, out + 1), at(inner, in + 1));
            }
    }
    if (facets == Facets::outer) move_out(mesh);
    return mesh;
}

// A corner at x = c + L w moves by at most 2^-bits sqrt(3) |x|, |x| <= |c| + r1 |w|, and all points of a triangle by no
// more than its corners. Where the ellipsoid is the unit ball, that is 1 / r3 times as much, at most, which the growth
// pays for twice.
double growth_for_rounding(const Ellipsoid& e, const SphereMesh& sphere, int bits) {
    const PrincipalAxes axes = principal_axes(e);
    double farthest = 0;
    for (const auto& w : sphere.vertices) farthest = std::max(farthest, std::hypot(w[0], w[1], w[2]));
    const double reach = std::hypot(e.center.x, e.center.y, e.center.z) + axes.radii[0] * farthest;
    return 1 + std::ldexp(4, -bits) * reach / axes.radii[2];
}

} // namespace prolate::cli
