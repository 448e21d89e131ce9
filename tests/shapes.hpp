// Meshes whose geometry is known exactly, for tests.
#pragma once

#include <prolate/mesh.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <numbers>
#include <utility>

namespace prolate::shapes {

inline void append(Mesh& to, const Mesh& other) {
    const auto base = static_cast<uint32_t>(to.vertices.size());
    to.vertices.insert(to.vertices.end(), other.vertices.begin(), other.vertices.end());
    for (const Triangle& t : other.triangles) to.triangles.push_back({t[0] + base, t[1] + base, t[2] + base});
}

/// v -> scale * v + offset, for every vertex.
inline Mesh moved(Mesh mesh, Vec3 offset, float scale = 1) {
    for (Vec3& v : mesh.vertices) v = {scale * v.x + offset.x, scale * v.y + offset.y, scale * v.z + offset.z};
    return mesh;
}

/// The same surface, inside out.
inline Mesh inverted(Mesh mesh) {
    for (Triangle& t : mesh.triangles) std::swap(t[1], t[2]);
    return mesh;
}

/// Closed box [0, x] x [0, y] x [0, z], 12 triangles.
inline Mesh box(float x = 1, float y = 1, float z = 1) {
    Mesh mesh;
    for (uint32_t i = 0; i < 8; ++i) mesh.vertices.push_back({i & 1 ? x : 0.0f, i & 2 ? y : 0.0f, i & 4 ? z : 0.0f});
    constexpr uint32_t kQuads[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4},
                                       {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
    for (const auto& q : kQuads) {
        mesh.triangles.push_back({q[0], q[1], q[2]});
        mesh.triangles.push_back({q[0], q[2], q[3]});
    }
    return mesh;
}

/// Closed tetrahedron with corners at the origin and the unit points: volume 1/6.
inline Mesh tetrahedron() {
    return {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}}};
}

/// Unit sphere by `subdivisions` of an icosahedron.
inline Mesh icosphere(int subdivisions) {
    const float a = 0.525731112f, b = 0.850650808f;
    Mesh mesh{{{-a, b, 0},
               {a, b, 0},
               {-a, -b, 0},
               {a, -b, 0},
               {0, -a, b},
               {0, a, b},
               {0, -a, -b},
               {0, a, -b},
               {b, 0, -a},
               {b, 0, a},
               {-b, 0, -a},
               {-b, 0, a}},
              {{0, 11, 5},  {0, 5, 1},  {0, 1, 7},  {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
               {11, 10, 2}, {10, 7, 6}, {7, 1, 8},  {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
               {3, 8, 9},   {4, 9, 5},  {2, 4, 11}, {6, 2, 10}, {8, 6, 7},   {9, 8, 1}}};
    for (int s = 0; s < subdivisions; ++s) {
        std::map<std::pair<uint32_t, uint32_t>, uint32_t> middle;
        const auto between = [&](uint32_t i, uint32_t j) {
            const auto [it, fresh] = middle.try_emplace(std::minmax(i, j), static_cast<uint32_t>(mesh.vertices.size()));
            if (fresh) {
                const Vec3 p = mesh.vertices[i], q = mesh.vertices[j];
                const Vec3 m{p.x + q.x, p.y + q.y, p.z + q.z};
                const float n = std::sqrt(m.x * m.x + m.y * m.y + m.z * m.z);
                mesh.vertices.push_back({m.x / n, m.y / n, m.z / n});
            }
            return it->second;
        };
        std::vector<Triangle> finer;
        for (const Triangle& t : mesh.triangles) {
            const uint32_t u = between(t[0], t[1]), v = between(t[1], t[2]), w = between(t[2], t[0]);
            finer.insert(finer.end(), {{t[0], u, w}, {t[1], v, u}, {t[2], w, v}, {u, v, w}});
        }
        mesh.triangles = std::move(finer);
    }
    return mesh;
}

/// Closed torus around z with the radii `major` and `minor`; its volume tends to 2 pi^2 major minor^2.
inline Mesh torus(float major, float minor, uint32_t around, uint32_t across) {
    Mesh mesh;
    for (uint32_t i = 0; i < around; ++i)
        for (uint32_t j = 0; j < across; ++j) {
            const float u = 2 * std::numbers::pi_v<float> * static_cast<float>(i) / static_cast<float>(around);
            const float v = 2 * std::numbers::pi_v<float> * static_cast<float>(j) / static_cast<float>(across);
            const float r = major + minor * std::cos(v);
            mesh.vertices.push_back({r * std::cos(u), r * std::sin(u), minor * std::sin(v)});
        }
    const auto at = [&](uint32_t i, uint32_t j) { return i % around * across + j % across; };
    for (uint32_t i = 0; i < around; ++i)
        for (uint32_t j = 0; j < across; ++j) {
            mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
            mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
        }
    return mesh;
}

/// Flat open sheet [0, x] x [0, y] in the plane z = 0, n x n quads.
inline Mesh sheet(float x, float y, uint32_t n) {
    Mesh mesh;
    for (uint32_t i = 0; i <= n; ++i)
        for (uint32_t j = 0; j <= n; ++j)
            mesh.vertices.push_back({x * static_cast<float>(i) / static_cast<float>(n),
                                     y * static_cast<float>(j) / static_cast<float>(n), 0});
    for (uint32_t i = 0; i < n; ++i)
        for (uint32_t j = 0; j < n; ++j) {
            const uint32_t a = i * (n + 1) + j, b = a + n + 1;
            mesh.triangles.push_back({a, b, b + 1});
            mesh.triangles.push_back({a, b + 1, a + 1});
        }
    return mesh;
}

/// Two balls apart: closed, two components.
inline Mesh two_pieces() {
    Mesh mesh = icosphere(2);
    append(mesh, moved(icosphere(2), {5, 0, 0}, 0.5f));
    return mesh;
}

/// A shell: the unit ball less one of radius 0.8.
inline Mesh hollow_ball() {
    Mesh mesh = icosphere(3);
    append(mesh, inverted(moved(icosphere(3), {}, 0.8f)));
    return mesh;
}

/// The unit box without its last face.
inline Mesh open_box() {
    Mesh mesh = box();
    mesh.triangles.resize(10);
    return mesh;
}

/// Volume enclosed by a closed mesh (divergence theorem).
inline double enclosed_volume(const Mesh& mesh) {
    double six = 0;
    for (const Triangle& t : mesh.triangles) {
        const Vec3 a = mesh.vertices[t[0]], b = mesh.vertices[t[1]], c = mesh.vertices[t[2]];
        six += double{a.x} * (double{b.y} * c.z - double{b.z} * c.y) +
               double{a.y} * (double{b.z} * c.x - double{b.x} * c.z) +
               double{a.z} * (double{b.x} * c.y - double{b.y} * c.x);
    }
    return six / 6;
}

} // namespace prolate::shapes
