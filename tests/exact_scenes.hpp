// Exact trees over meshes, without the builder: triangles split at the median of their longest extent again and again,
// ellipsoids of the corners' covariance.
#pragma once

#include "tests/scenes.hpp"

#include <prolate/mesh.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

namespace prolate::scenes {

struct ExactOptions {
    uint32_t degree = 8;
    uint32_t leaf_triangles = 4;
    bool closed = true;
    double shrink = 1; ///< below 1: nodes do not enclose (to show that the tests notice)
};

/// An exact tree and its mesh in the tree's order.
struct ExactScene {
    Mesh mesh;
    std::vector<std::byte> bytes;
};

/// Puts one vertex of each connected part first; returns how many there are.
inline uint32_t components_first(Mesh& mesh) {
    std::vector<uint32_t> parent(mesh.vertices.size());
    std::iota(parent.begin(), parent.end(), 0u);
    const auto find = [&](uint32_t v) {
        while (parent[v] != v) v = parent[v] = parent[parent[v]];
        return v;
    };
    for (const Triangle& t : mesh.triangles)
        for (size_t i = 1; i < 3; ++i) parent[find(t[i])] = find(t[0]);
    std::vector<uint32_t> order(mesh.vertices.size()), place(mesh.vertices.size());
    std::iota(order.begin(), order.end(), 0u);
    const auto middle = std::stable_partition(order.begin(), order.end(), [&](uint32_t v) { return find(v) == v; });
    const auto count = static_cast<uint32_t>(middle - order.begin());
    std::vector<Vec3> vertices;
    for (const uint32_t v : order)
        place[v] = static_cast<uint32_t>(vertices.size()), vertices.push_back(mesh.vertices[v]);
    for (Triangle& t : mesh.triangles)
        for (uint32_t& v : t) v = place[v];
    mesh.vertices = std::move(vertices);
    return count;
}

inline ExactScene exact_tree(Mesh mesh, const ExactOptions& options = {}) {
    const uint32_t components = components_first(mesh);
    const auto corner = [&](uint32_t t, size_t i) {
        const Vec3 v = mesh.vertices[mesh.triangles[t][i]];
        return Point{v.x, v.y, v.z};
    };
    Point low{HUGE_VAL, HUGE_VAL, HUGE_VAL}, high{-HUGE_VAL, -HUGE_VAL, -HUGE_VAL};
    for (const Triangle& t : mesh.triangles)
        for (const uint32_t v : t) {
            const Point p{mesh.vertices[v].x, mesh.vertices[v].y, mesh.vertices[v].z};
            for (size_t i = 0; i < 3; ++i) low[i] = std::min(low[i], p[i]), high[i] = std::max(high[i], p[i]);
        }
    const format::Lattice lattice = format::lattice_for(low.data(), high.data());
    const double step = std::ldexp(1.0, lattice.step_exponent);

    std::vector<uint32_t> order(mesh.triangles.size());
    std::iota(order.begin(), order.end(), 0u);
    struct Part {
        size_t begin, end;
    };
    const auto size = [](const Part& p) { return p.end - p.begin; };
    const auto split = [&](const Part& whole, std::vector<Part>& out) {
        std::vector<Part> parts{whole};
        while (parts.size() < options.degree) {
            Part& largest = *std::ranges::max_element(parts, {}, size);
            if (size(largest) <= options.leaf_triangles) break;
            const auto middle_of = [&](uint32_t t, size_t i) {
                return corner(t, 0)[i] + corner(t, 1)[i] + corner(t, 2)[i];
            };
            const auto begin = order.begin() + static_cast<ptrdiff_t>(largest.begin),
                       end = order.begin() + static_cast<ptrdiff_t>(largest.end), middle = begin + (end - begin) / 2;
            size_t axis = 0;
            double extent = -1;
            for (size_t i = 0; i < 3; ++i) {
                const auto [a, b] = std::minmax_element(
                    begin, end, [&](uint32_t s, uint32_t t) { return middle_of(s, i) < middle_of(t, i); });
                const double e = middle_of(*b, i) - middle_of(*a, i);
                if (e > extent) extent = e, axis = i;
            }
            std::nth_element(begin, middle, end,
                             [&](uint32_t s, uint32_t t) { return middle_of(s, axis) < middle_of(t, axis); });
            const auto at = static_cast<size_t>(middle - order.begin());
            const Part upper{at, largest.end};
            largest.end = at;
            parts.push_back(upper);
        }
        out.insert(out.end(), parts.begin(), parts.end());
        return static_cast<uint8_t>(parts.size());
    };
    const auto node_of = [&](const Part& part) {
        Point mean{};
        const double count = 3 * static_cast<double>(size(part));
        const auto for_each = [&](const auto& visit) {
            for (size_t k = part.begin; k < part.end; ++k)
                for (size_t i = 0; i < 3; ++i) visit(corner(order[k], i));
        };
        for_each([&](const Point& p) {
            for (size_t i = 0; i < 3; ++i) mean[i] += p[i] / count;
        });
        std::array<Point, 3> q{};
        for_each([&](const Point& p) {
            for (size_t i = 0; i < 3; ++i)
                for (size_t j = 0; j < 3; ++j) q[i][j] += (p[i] - mean[i]) * (p[j] - mean[j]) / count;
        });
        const double flat = 1e-4 * (q[0][0] + q[1][1] + q[2][2]) + step * step; // no flat nodes
        std::array<double, 6> factor{}; // by Cholesky, in double: sizes may lie beyond a float's squares
        const double l11 = std::sqrt(q[0][0] + flat), l21 = q[1][0] / l11, l31 = q[2][0] / l11;
        const double l22 = std::sqrt(std::max(q[1][1] + flat - l21 * l21, 0.5 * flat)),
                     l32 = (q[2][1] - l31 * l21) / l22;
        const double l33 = std::sqrt(std::max(q[2][2] + flat - l31 * l31 - l32 * l32, 0.5 * flat));
        factor = {l11, l21, l22, l31, l32, l33};
        double scale = 0.1;
        const auto radial = [&](const Point& p) {
            const double u = (p[0] - mean[0]) / l11, v = (p[1] - mean[1] - l21 * u) / l22,
                         w = (p[2] - mean[2] - l31 * u - l32 * v) / l33;
            return std::sqrt(u * u + v * v + w * w);
        };
        for_each([&](const Point& p) { scale = std::max(scale, radial(p)); });
        format::PackedNode node;
        for (size_t i = 0; i < 3; ++i) {
            double from = HUGE_VAL, to = -HUGE_VAL;
            for_each([&](const Point& p) { from = std::min(from, p[i]), to = std::max(to, p[i]); });
            const double shrink = (1 - options.shrink) * (to - from) / 2;
            node.box_low[i] = from + shrink, node.box_high[i] = to - shrink;
        }
        for (;; scale *= 1.01) {
            std::array<double, 6> scaled = factor;
            for (double& l : scaled) l *= scale * options.shrink;
            format::quantise(node, lattice, mean.data(), scaled.data());
            bool encloses = true;
            for_each([&](const Point& p) {
                encloses = encloses && radial_squared(format::decode(node, lattice), p.data()) < 0.9999;
            });
            if (options.shrink < 1 || encloses) return node;
        }
    };

    std::vector<format::PackedLevel> levels;
    std::vector<Triangle> sorted;
    std::vector<Part> parts{{0, order.size()}};
    while (!parts.empty()) {
        format::PackedLevel level;
        std::vector<Part> next;
        for (const Part& part : parts) {
            format::PackedNode node = node_of(part);
            if (size(part) > options.leaf_triangles) {
                node.child_count = split(part, next);
            } else {
                node.triangle_count = static_cast<uint8_t>(size(part));
                for (size_t k = part.begin; k < part.end; ++k) sorted.push_back(mesh.triangles[order[k]]);
            }
            level.nodes.push_back(node);
        }
        levels.push_back(std::move(level));
        parts = std::move(next);
    }
    BakeInfo info;
    info.exact = true;
    info.surface_mode = !options.closed;
    mesh.triangles = std::move(sorted);
    auto bytes = format::encode(info, options.degree, lattice, levels, {mesh.vertices, mesh.triangles, components});
    return {std::move(mesh), std::move(bytes)};
}

} // namespace prolate::scenes
