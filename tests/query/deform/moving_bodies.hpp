// Bodies that deform for tests: meshes with smooth modes, and trees of them.
#pragma once

#include "query/triangle/placed.hpp"
#include "tests/builder/bakes.hpp"
#include "tests/scenes.hpp"
#include "tests/shapes.hpp"

#include <prolate/modes.hpp>

#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <utility>
#include <vector>

namespace prolate::moving {

using scenes::Point, scenes::Random;

// Smooth modes: waves along random directions, of about the size of `amplitude`; the first bends.
struct Moving {
    Moving(Mesh surface, uint32_t modes, double amplitude, uint64_t seed) : mesh(std::move(surface)) {
        Random random(seed);
        for (uint32_t m = 0; m < modes; ++m) {
            const Point along = random.direction(), to = random.direction();
            const double phase = random.in(0, 6), waves = random.in(0.5, 3);
            for (const Vec3& v : mesh.vertices) {
                const double at = along[0] * v.x + along[1] * v.y + along[2] * v.z;
                const double by = amplitude * (m == 0 ? at * at : std::sin(waves * at + phase));
                for (const double x : to) displacements.push_back(static_cast<float>(by * x));
            }
            ranges.push_back(static_cast<float>(random.in(0.5, 2)));
        }
    }
    Modes modes() const { return {displacements, ranges}; }
    std::vector<float> random_q(Random& random) const {
        std::vector<float> q;
        for (const float r : ranges)
            q.push_back(random.below(8) == 0 ? (random.below(2) ? r : -r) : static_cast<float>(random.in(-1, 1)) * r);
        return q;
    }
    Point moved(uint32_t v, const std::vector<float>& q) const {
        const Vec3& x = mesh.vertices[v];
        Point out{x.x, x.y, x.z};
        for (size_t m = 0; m < q.size(); ++m)
            for (size_t i = 0; i < 3; ++i)
                out[i] += double{q[m]} * displacements[3 * (m * mesh.vertices.size() + v) + i];
        return out;
    }
    Tree bake(bool exact, uint32_t ellipsoids = 16) const {
        BuildOptions options = quick(0);
        options.exact = exact, options.threads = 1, options.degree = exact ? 8 : 4;
        if (!exact) options.ellipsoids = ellipsoids;
        const Build built = must_build(mesh, options);
        auto out = add_modes(built.tree.view(), mesh.view(), modes());
        if (!out) throw std::runtime_error(out.error().what);
        return std::move(*out);
    }

    Mesh mesh;
    std::vector<float> displacements, ranges;
};

inline const Moving& torus() {
    static const Moving out(shapes::torus(1, 0.3f, 20, 10), 4, 0.15, 1);
    return out;
}
inline const Moving& ball() {
    static const Moving out(shapes::icosphere(2), 3, 0.2, 2);
    return out;
}
inline const Tree& torus_cover() {
    static const Tree out = torus().bake(false);
    return out;
}
inline const Tree& torus_exact() {
    static const Tree out = torus().bake(true);
    return out;
}
inline const Tree& ball_cover() {
    static const Tree out = ball().bake(false, 10);
    return out;
}
inline const Tree& ball_exact() {
    static const Tree out = ball().bake(true);
    return out;
}

// The deformed triangles of a body in the world, all of them.
inline std::vector<query::PlacedTriangle> placed(const Moving& body, const std::vector<float>& q, const Pose& pose) {
    std::vector<query::PlacedTriangle> out;
    for (const Triangle& t : body.mesh.triangles) {
        query::PlacedTriangle p{};
        for (size_t c = 0; c < 3; ++c) {
            const Point x = scenes::rotate(pose.rotation, body.moved(t[c], q));
            p.corner[c] = {x[0] + pose.translation.x, x[1] + pose.translation.y, x[2] + pose.translation.z};
        }
        p.reach = 4;
        out.push_back(p);
    }
    return out;
}

inline Pose near_pose(Random& random, double most) {
    const Point d = random.direction();
    const double r = random.in(0, most);
    return {scenes::to_float({r * d[0], r * d[1], r * d[2]}), random.rotation()};
}

} // namespace prolate::moving
