// Seeded pairs of triangles near contact, in families, placed as a query places them; shared by the tests of what
// query/ knows of two triangles.
#pragma once

#include "query/triangle/placed.hpp"
#include "src/format.hpp"
#include "tests/reference.hpp"
#include "tests/scenes.hpp"

#include <array>
#include <cmath>
#include <ostream>
#include <string>
#include <vector>

namespace prolate::triangle_pairs {

using scenes::Point;
using scenes::Random;

// A tree of one leaf with the given triangles.
inline std::vector<std::byte> leaf_of(const std::vector<Vec3>& vertices, const std::vector<Triangle>& triangles) {
    BakeInfo info;
    info.exact = true;
    format::PackedNode node{.diagonal = {60000, 60000, 60000}, .exponent = 40};
    node.triangle_count = static_cast<uint8_t>(triangles.size());
    const format::PackedLevel root{{node}};
    return format::encode(info, 2, {.step_exponent = 24}, std::span(&root, 1), {vertices, triangles, 1});
}

using Corners = std::array<Vec3, 3>;

struct Pair {
    Corners a, b;
    Pose pose_a, pose_b;
};

inline reference::Corners reference_a(const Pair& p) {
    return reference::placed(p.a, p.pose_a, p.pose_a.translation);
}
inline reference::Corners reference_b(const Pair& p) {
    return reference::placed(p.b, p.pose_b, p.pose_a.translation);
}
inline reference::Real distance(const Pair& p) {
    return reference::distance(reference_a(p), reference_b(p));
}
// S of the error analysis.
inline double size(const Pair& p) {
    double largest[2] = {};
    for (size_t i = 0; i < 3; ++i) {
        const auto length = [](const Vec3& v) {
            return std::sqrt(double{v.x} * v.x + double{v.y} * v.y + double{v.z} * v.z);
        };
        largest[0] = std::max(largest[0], length(p.a[i])), largest[1] = std::max(largest[1], length(p.b[i]));
    }
    const double d[3] = {double{p.pose_b.translation.x} - p.pose_a.translation.x,
                         double{p.pose_b.translation.y} - p.pose_a.translation.y,
                         double{p.pose_b.translation.z} - p.pose_a.translation.z};
    return largest[0] + largest[1] + std::sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
}

struct Family {
    const char* name;
    double thinnest; // smallest height of a triangle over its length
    double offset;   // of the triangles from their bodies' origins, in lengths
    bool coplanar;
};
inline void PrintTo(const Family& family, std::ostream* out) {
    *out << family.name;
}

inline Corners random_triangle(Random& random, const Family& family) {
    const double length = random.log_in(0.1, 10), width = length * random.log_in(family.thinnest, 1);
    const double slide = random.in(-0.5, 1.5);
    const Point p[3] = {{0, 0, 0}, {length, 0, 0}, {slide * length, width, 0}};
    const Quat turn = family.coplanar ? Quat{0, 0, static_cast<float>(random.in(-1, 1)), 1} : random.rotation();
    const Point at = random.in_ball();
    Corners out;
    for (size_t i = 0; i < 3; ++i) {
        Point q = scenes::rotate(turn, p[i]);
        for (size_t k = 0; k < 3; ++k) q[k] += family.offset * at[k];
        if (family.coplanar) q[2] = 0.25;
        out[i] = scenes::to_float(q);
    }
    return out;
}

// A point of a corner, an edge or the face.
inline Point feature_point(Random& random, const Corners& t) {
    double w[3] = {random.unit(), random.unit(), random.unit()};
    const uint32_t zero = random.below(3), kind = random.below(3);
    if (kind < 2) w[zero] = 0;
    if (kind < 1) w[(zero + 1) % 3] = 0;
    const double sum = w[0] + w[1] + w[2];
    Point out{};
    for (size_t i = 0; i < 3; ++i) {
        out[0] += w[i] / sum * double{t[i].x};
        out[1] += w[i] / sum * double{t[i].y};
        out[2] += w[i] / sum * double{t[i].z};
    }
    return out;
}

// Two triangles of which a point of one lies at a small distance from a point of the other.
inline Pair near_contact(Random& random, const Family& family) {
    Pair p{random_triangle(random, family), random_triangle(random, family), {}, {}};
    const Point on_a = feature_point(random, p.a), on_b = feature_point(random, p.b);
    Point way = random.direction();
    if (family.coplanar)
        way[2] = 0; // and no rotation, which would not be exact
    else
        p.pose_a.rotation = random.rotation(), p.pose_b.rotation = random.rotation();
    const Point a = scenes::rotate(p.pose_a.rotation, on_a), b = scenes::rotate(p.pose_b.rotation, on_b);
    const double gap = random.log_in(1e-9, 1);
    p.pose_b.translation =
        scenes::to_float({a[0] - b[0] + gap * way[0], a[1] - b[1] + gap * way[1], a[2] - b[2] + gap * way[2]});
    return p;
}

// The same pair in another unit. Rounding the corners moves it a little: take it for a pair of its own.
inline Pair scaled(Pair p, double scale) {
    const auto change = [scale](Vec3& v) { v = scenes::to_float({scale * v.x, scale * v.y, scale * v.z}); };
    for (Vec3& v : p.a) change(v);
    for (Vec3& v : p.b) change(v);
    change(p.pose_a.translation), change(p.pose_b.translation);
    return p;
}

const Family kFamilies[] = {{"round", 0.3, 0, false},
                            {"slivers", 1e-6, 0, false},
                            {"far_from_the_origin", 0.1, 1e3, false},
                            {"coplanar", 0.01, 0, true}};

} // namespace prolate::triangle_pairs
