#include "builder/winding.hpp"

#include "builder/job.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace prolate {
namespace {

Vec area_normal(const Vec3& a, const Vec3& b, const Vec3& c) {
    return 0.5 * (to_vec(b) - to_vec(a)).cross(to_vec(c) - to_vec(a));
}

Vec centroid(const Vec3& a, const Vec3& b, const Vec3& c) {
    return (to_vec(a) + to_vec(b) + to_vec(c)) / 3;
}

} // namespace

double solid_angle(const Vec& corner_a, const Vec& corner_b, const Vec& corner_c, const Vec& p) {
    const Vec a = corner_a - p, b = corner_b - p, c = corner_c - p;
    const double la = a.norm(), lb = b.norm(), lc = c.norm();
    const double numerator = a.dot(b.cross(c));
    const double denominator = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
    return numerator == 0 && denominator >= 0 ? 0 : 2 * std::atan2(numerator, denominator);
}

Winding::Winding(MeshView mesh) : tree_(mesh), moments_(tree_.nodes().size()) {
    parallel_for(size_t{0}, moments_.size(), [&](size_t n) {
        const TriangleTree::Node& node = tree_.nodes()[n];
        const auto triangles = tree_.triangles().subspan(node.begin, node.end - node.begin);
        Moments& sum = moments_[n];
        sum = {Vec::Zero(), Vec::Zero(), Mat::Zero(), 0};
        double area_sum = 0;
        for (const auto& [a, b, c] : triangles) {
            const Vec normal = area_normal(a, b, c);
            const double area = normal.norm();
            sum.dipole += normal;
            sum.center += area * centroid(a, b, c);
            area_sum += area;
        }
        sum.center = area_sum > 0 ? Vec(sum.center / area_sum) : node.box.center();
        for (const auto& [a, b, c] : triangles) {
            sum.moment += area_normal(a, b, c) * (centroid(a, b, c) - sum.center).transpose();
            for (const Vec3& v : {a, b, c}) sum.radius = std::max(sum.radius, (to_vec(v) - sum.center).norm());
        }
    });
}

double Winding::operator()(const Vec& p, double accuracy) const {
    double angle = 0;
    const auto nodes = tree_.nodes();
    uint32_t stack[TriangleTree::kMaxDepth];
    int top = 0;
    if (!nodes.empty()) stack[top++] = 0;
    while (top > 0) {
        const uint32_t index = stack[--top];
        const Moments& far = moments_[index];
        const Vec d = far.center - p;
        const double distance = d.norm();
        if (distance > accuracy * far.radius) {
            // n . K(d + e) ~ n . K(d) + n . (dK/dd) e with K(d) = d / |d|^3.
            const double square = distance * distance, cube = distance * square;
            angle += (far.dipole.dot(d) + far.moment.trace() - 3 * d.dot(far.moment * d) / square) / cube;
        } else if (const TriangleTree::Node& node = nodes[index]; node.right == 0) {
            for (const auto& [a, b, c] : tree_.triangles().subspan(node.begin, node.end - node.begin))
                angle += solid_angle(to_vec(a), to_vec(b), to_vec(c), p);
        } else {
            stack[top++] = node.right;
            stack[top++] = index + 1;
        }
    }
    return angle / (4 * std::numbers::pi);
}

std::optional<double> Winding::whole(const Vec& p) const {
    for (const double accuracy : {2.0, 4.0, 16.0}) {
        const double number = (*this)(p, accuracy), nearest = std::round(number);
        if (std::abs(number - nearest) < 0.1) return nearest;
    }
    return {};
}

} // namespace prolate
