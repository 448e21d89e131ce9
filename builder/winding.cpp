#include "builder/winding.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace prolate {
namespace {

constexpr uint32_t kLeafTriangles = 8;

} // namespace

double solid_angle(const Vec& corner_a, const Vec& corner_b, const Vec& corner_c, const Vec& p) {
    const Vec a = corner_a - p, b = corner_b - p, c = corner_c - p;
    const double la = a.norm(), lb = b.norm(), lc = c.norm();
    const double numerator = a.dot(b.cross(c));
    const double denominator = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
    return numerator == 0 && denominator >= 0 ? 0 : 2 * std::atan2(numerator, denominator);
}

Winding::Winding(MeshView mesh) {
    corners_.reserve(mesh.triangles.size());
    for (const Triangle& t : mesh.triangles)
        corners_.push_back({to_vec(mesh.vertices[t[0]]), to_vec(mesh.vertices[t[1]]), to_vec(mesh.vertices[t[2]])});
    if (!corners_.empty()) build(0, static_cast<uint32_t>(corners_.size()));
}

void Winding::build(uint32_t begin, uint32_t end) {
    const auto index = static_cast<uint32_t>(nodes_.size());
    nodes_.emplace_back();
    Node node{Vec::Zero(), Vec::Zero(), Mat::Zero(), 0, begin, end, 0};
    Box box;
    double area_sum = 0;
    for (uint32_t i = begin; i < end; ++i) {
        const auto& [a, b, c] = corners_[i];
        const Vec normal = 0.5 * (b - a).cross(c - a);
        const double area = normal.norm();
        node.dipole += normal;
        node.center += area / 3 * (a + b + c);
        area_sum += area;
        for (const Vec& v : corners_[i]) box.add(v);
    }
    node.center = area_sum > 0 ? Vec(node.center / area_sum) : box.center();
    for (uint32_t i = begin; i < end; ++i) {
        const auto& [a, b, c] = corners_[i];
        node.moment += 0.5 * (b - a).cross(c - a) * ((a + b + c) / 3 - node.center).transpose();
        for (const Vec& v : corners_[i]) node.radius = std::max(node.radius, (v - node.center).norm());
    }
    if (end - begin > kLeafTriangles) {
        int axis = 0;
        box.size().maxCoeff(&axis);
        const uint32_t middle = begin + (end - begin) / 2;
        const auto key = [axis](const std::array<Vec, 3>& t) { return t[0][axis] + t[1][axis] + t[2][axis]; };
        // A total order, so that the tree does not depend on the library's nth_element.
        const auto before = [&](const std::array<Vec, 3>& s, const std::array<Vec, 3>& t) {
            if (key(s) != key(t)) return key(s) < key(t);
            for (size_t i = 0; i < 3; ++i)
                for (int k = 0; k < 3; ++k)
                    if (s[i][k] != t[i][k]) return s[i][k] < t[i][k];
            return false;
        };
        std::nth_element(corners_.begin() + begin, corners_.begin() + middle, corners_.begin() + end, before);
        build(begin, middle);
        node.right = static_cast<uint32_t>(nodes_.size());
        build(middle, end);
    }
    nodes_[index] = node;
}

double Winding::operator()(const Vec& p, double accuracy) const {
    double angle = 0;
    uint32_t stack[64]; // the tree is balanced: its depth is at most 32
    int top = 0;
    if (!nodes_.empty()) stack[top++] = 0;
    while (top > 0) {
        const uint32_t index = stack[--top];
        const Node& node = nodes_[index];
        const Vec d = node.center - p;
        const double distance = d.norm();
        if (distance > accuracy * node.radius) {
            // n . K(d + e) ~ n . K(d) + n . (dK/dd) e with K(d) = d / |d|^3.
            const double cube = distance * distance * distance;
            angle +=
                (node.dipole.dot(d) + node.moment.trace() - 3 * d.dot(node.moment * d) / (distance * distance)) / cube;
        } else if (node.right == 0) {
            for (uint32_t i = node.begin; i < node.end; ++i)
                angle += solid_angle(corners_[i][0], corners_[i][1], corners_[i][2], p);
        } else {
            stack[top++] = node.right;
            stack[top++] = index + 1;
        }
    }
    return angle / (4 * std::numbers::pi);
}

} // namespace prolate
