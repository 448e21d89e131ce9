#include <prolate/primitives.hpp>

#include "src/format.hpp"
#include "src/symmetric3.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <map>
#include <new>
#include <numeric>
#include <utility>
#include <vector>

namespace prolate {
namespace {

using format::PackedLevel;
using format::PackedNode;

constexpr uint32_t kDegree = 8, kLeafTriangles = 4;

Error bad_size() {
    return {ErrorCode::bad_options, "a primitive's numbers must be finite and above 0, and within the format's range"};
}

std::array<double, 3> to_doubles(const Vec3& v) {
    return {v.x, v.y, v.z};
}

// Makes an exact tree of a few triangles: parts are halved at the median of their longest extent until there are
// kDegree, and each is held by the ellipsoid around its box.
class PolyhedronTree {
public:
    PolyhedronTree(std::vector<Vec3> vertices, std::vector<Triangle> triangles)
        : vertices_(std::move(vertices)), triangles_(std::move(triangles)) {}

    /// `closed`: it bounds a solid. `size`: its nodes need be no smaller than a small part of that.
    Result<Tree> make(bool closed = true, double size = 0) {
        const Box box = box_of({0, static_cast<uint32_t>(triangles_.size())});
        lattice_ = format::lattice_for(box.low.data(), box.high.data(), size);
        std::vector<PackedLevel> levels;
        std::vector<Part> parts{{0, static_cast<uint32_t>(triangles_.size())}};
        std::vector<Triangle> sorted;
        while (!parts.empty()) {
            std::vector<Part> next;
            levels.emplace_back();
            for (const Part& part : parts) {
                PackedNode node;
                if (!hold(node, part)) return bad_size();
                if (part.size() > kLeafTriangles) {
                    node.child_count = split(part, next);
                } else {
                    node.triangle_count = static_cast<uint8_t>(part.size());
                    sorted.insert(sorted.end(), triangles_.begin() + part.begin, triangles_.begin() + part.end);
                }
                levels.back().nodes.push_back(node);
            }
            parts = std::move(next);
        }
        BakeInfo info;
        info.exact = true, info.surface_mode = !closed;
        auto tree = Tree::open(format::encode(info, kDegree, lattice_, levels, {vertices_, sorted, 1}));
        return tree ? std::move(tree) : Result<Tree>(bad_size());
    }

private:
    struct Part {
        uint32_t begin, end; // of triangles_
        uint32_t size() const { return end - begin; }
    };
    struct Box {
        std::array<double, 3> low{HUGE_VAL, HUGE_VAL, HUGE_VAL}, high{-HUGE_VAL, -HUGE_VAL, -HUGE_VAL};
        size_t longest() const {
            size_t axis = 0;
            for (size_t i = 1; i < 3; ++i)
                if (high[i] - low[i] > high[axis] - low[axis]) axis = i;
            return axis;
        }
    };

    template <class Visit> void for_each_corner(const Part& part, Visit&& visit) const {
        for (uint32_t t = part.begin; t < part.end; ++t)
            for (const uint32_t v : triangles_[t]) visit(to_doubles(vertices_[v]));
    }
    Box box_of(const Part& part) const {
        Box box;
        for_each_corner(part, [&](const std::array<double, 3>& p) {
            for (size_t i = 0; i < 3; ++i)
                box.low[i] = std::min(box.low[i], p[i]), box.high[i] = std::max(box.high[i], p[i]);
        });
        return box;
    }

    uint8_t split(const Part& whole, std::vector<Part>& out) {
        std::vector<Part> parts{whole};
        while (parts.size() < kDegree) {
            Part& largest = *std::ranges::max_element(parts, {}, &Part::size);
            if (largest.size() <= kLeafTriangles) break;
            const size_t axis = box_of(largest).longest();
            const auto middle = [&](const Triangle& t) {
                return to_doubles(vertices_[t[0]])[axis] + to_doubles(vertices_[t[1]])[axis] +
                       to_doubles(vertices_[t[2]])[axis];
            };
            std::stable_sort(triangles_.begin() + largest.begin, triangles_.begin() + largest.end,
                             [&](const Triangle& s, const Triangle& t) { return middle(s) < middle(t); });
            const uint32_t at = largest.begin + largest.size() / 2, end = std::exchange(largest.end, at);
            parts.push_back({at, end});
        }
        out.insert(out.end(), parts.begin(), parts.end());
        return static_cast<uint8_t>(parts.size());
    }

    // The node of a part, as decoded. False if none is large enough.
    bool hold(PackedNode& node, const Part& part) const {
        constexpr double kThinnest = 0x1p-10, kRoom = 1 - 0x1p-16; // of the longest semi-axis; of |u|^2
        const Box box = box_of(part);
        double center[3], half[3];
        const size_t axis = box.longest();
        // Centers are rounded to the lattice.
        const double thinnest =
            std::max(kThinnest * (box.high[axis] - box.low[axis]), power_of_two(lattice_.step_exponent));
        for (size_t i = 0; i < 3; ++i) {
            center[i] = 0.5 * (box.low[i] + box.high[i]);
            half[i] = std::sqrt(0.75) * std::max(box.high[i] - box.low[i], thinnest); // the least ellipsoid around it
            node.box_low[i] = box.low[i], node.box_high[i] = box.high[i];
        }
        for (double scale = 1; scale < 16; scale *= 1.01) {
            const double factor[6] = {scale * half[0], 0, scale * half[1], 0, 0, scale * half[2]};
            format::quantise(node, lattice_, center, factor);
            const Ellipsoid e = format::decode(node, lattice_);
            bool holds = true;
            for_each_corner(
                part, [&](const std::array<double, 3>& p) { holds = holds && radial_squared(e, p.data()) < kRoom; });
            if (holds) return true;
        }
        return false;
    }

    std::vector<Vec3> vertices_;
    std::vector<Triangle> triangles_;
    format::Lattice lattice_;
};

Result<Tree> tree_of(std::vector<Vec3> vertices, std::vector<Triangle> triangles, bool closed = true, double size = 0) {
    try {
        for (const Vec3& v : vertices)
            for (const float x : {v.x, v.y, v.z})
                if (!(std::abs(x) <= kLargestCoordinate)) return bad_size();
        return PolyhedronTree(std::move(vertices), std::move(triangles)).make(closed, size);
    } catch (const std::bad_alloc&) {
        return Error{ErrorCode::out_of_memory, "there is not enough memory"};
    }
}

bool is_length(float x) {
    return x > 0 && std::isfinite(x);
}

using Vector = std::array<double, 3>;
Vector minus(const Vector& a, const Vector& b) {
    return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
Vector cross(const Vector& a, const Vector& b) {
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
double dot(const Vector& a, const Vector& b) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

// Do the triangles bound a convex solid?
Result<void> check_convex(std::span<const Vec3> points, std::span<const Triangle> triangles) {
    const auto bad = [](const char* what, size_t where) { return Error{ErrorCode::bad_mesh, what, where}; };
    constexpr double kBeyond = 1e-5; // of the size
    if (triangles.size() < 4) return bad("a convex polyhedron has at least four triangles", triangles.size());
    std::map<std::pair<uint32_t, uint32_t>, int> edges; // how often each runs this way
    double size = 0;
    for (size_t t = 0; t < triangles.size(); ++t)
        for (size_t k = 0; k < 3; ++k) {
            const uint32_t from = triangles[t][k], to = triangles[t][(k + 1) % 3];
            if (from >= points.size()) return bad("a triangle names a point that does not exist", t);
            const Vector p = minus(to_doubles(points[from]), to_doubles(points[triangles[0][0]]));
            if (!std::isfinite(dot(p, p))) return bad("a point of a triangle is not finite", t);
            size = std::max(size, std::sqrt(dot(p, p)));
            if (++edges[{from, to}] > 1) return bad("two triangles run along an edge in the same direction", t);
        }
    for (size_t t = 0; t < triangles.size(); ++t) {
        const auto& [a, b, c] = triangles[t];
        for (const auto& [from, to] : {std::pair{b, a}, std::pair{c, b}, std::pair{a, c}})
            if (!edges.contains({from, to})) return bad("the surface is open at an edge of a triangle", t);
        const Vector origin = to_doubles(points[a]);
        const Vector n = cross(minus(to_doubles(points[b]), origin), minus(to_doubles(points[c]), origin));
        const double length = std::sqrt(dot(n, n));
        if (!(length > 0)) return bad("a triangle has no area", t);
        for (const Triangle& other : triangles)
            for (const uint32_t v : other)
                if (dot(n, minus(to_doubles(points[v]), origin)) > kBeyond * size * length)
                    return bad("the surface is not convex: a point lies beyond the plane of a triangle", t);
    }
    return {};
}

} // namespace

Result<Tree> box_tree(const Vec3& half) {
    if (!is_length(half.x) || !is_length(half.y) || !is_length(half.z)) return bad_size();
    std::vector<Vec3> vertices;
    for (uint32_t i = 0; i < 8; ++i)
        vertices.push_back({i & 1 ? half.x : -half.x, i & 2 ? half.y : -half.y, i & 4 ? half.z : -half.z});
    return tree_of(std::move(vertices), {{0, 2, 3},
                                         {0, 3, 1},
                                         {4, 5, 7},
                                         {4, 7, 6},
                                         {0, 1, 5},
                                         {0, 5, 4},
                                         {2, 6, 7},
                                         {2, 7, 3},
                                         {0, 4, 6},
                                         {0, 6, 2},
                                         {1, 3, 7},
                                         {1, 7, 5}});
}

Result<Tree> cylinder_tree(float radius, float half_height, uint32_t sides) {
    if (!is_length(radius) || !is_length(half_height)) return bad_size();
    if (!std::has_single_bit(sides) || sides < 8 || sides > 1024)
        return Error{ErrorCode::bad_options, "the sides of a cylinder's prism must be a power of two, 8 to 1024",
                     sides};
    // Unit vectors around a circle, by halving angles: square roots are the same on all machines, sines are not.
    using Direction = std::array<double, 2>;
    std::vector<Direction> around{{1, 0}, {0, 1}, {-1, 0}, {0, -1}};
    double halved = 0; // the length of the sum of two neighbours, halved: the cosine of half the angle between them
    while (around.size() <= sides) {
        std::vector<Direction> finer;
        for (size_t i = 0; i < around.size(); ++i) {
            const Direction &a = around[i], &b = around[(i + 1) % around.size()];
            const Direction m{0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])};
            halved = std::sqrt(m[0] * m[0] + m[1] * m[1]);
            finer.insert(finer.end(), {a, {m[0] / halved, m[1] / halved}});
        }
        if (around.size() == sides) break;
        around = std::move(finer);
    }
    const double reach = double{radius} / halved * (1 + 0x1p-22); // corners round to floats by less
    std::vector<Vec3> vertices;
    for (const float z : {-half_height, half_height})
        for (const Direction& d : around)
            vertices.push_back({static_cast<float>(reach * d[0]), static_cast<float>(reach * d[1]), z});
    std::vector<Triangle> triangles;
    for (uint32_t i = 0; i < sides; ++i) {
        const uint32_t next = (i + 1) % sides;
        triangles.insert(triangles.end(), {{i, next, sides + next}, {i, sides + next, sides + i}});
    }
    // The ends, from the rim inwards: each round cuts off every second corner, so that most triangles are small.
    for (uint32_t step = 1; 2 * step < sides; step *= 2)
        for (uint32_t i = 0; i < sides; i += 2 * step) {
            const uint32_t middle = i + step, next = (i + 2 * step) % sides;
            triangles.insert(triangles.end(), {{i, next, middle}, {sides + i, sides + middle, sides + next}});
        }
    return tree_of(std::move(vertices), std::move(triangles));
}

Result<Tree> convex_tree(std::span<const Vec3> points, std::span<const Triangle> triangles) {
    try {
        if (const auto convex = check_convex(points, triangles); !convex) return convex.error();
        std::vector<uint32_t> place(points.size(), UINT32_MAX);
        std::vector<Vec3> vertices;
        std::vector<Triangle> used(triangles.begin(), triangles.end());
        for (Triangle& t : used)
            for (uint32_t& v : t) {
                if (place[v] == UINT32_MAX)
                    place[v] = static_cast<uint32_t>(vertices.size()), vertices.push_back(points[v]);
                v = place[v];
            }
        return tree_of(std::move(vertices), std::move(used));
    } catch (const std::bad_alloc&) {
        return Error{ErrorCode::out_of_memory, "there is not enough memory"};
    }
}

namespace {

// By how much the ellipsoid `outer` must grow to hold `inner`: above 1 if it does not yet.
double growth_to_hold(const Ellipsoid& outer, const Ellipsoid& inner) {
    const auto in_ball = [&](double x, double y, double z) {
        const double u = x / outer.l11, v = (y - outer.l21 * u) / outer.l22;
        return Vector{u, v, (z - outer.l31 * u - outer.l32 * v) / outer.l33};
    };
    const Vector columns[3] = {in_ball(inner.l11, inner.l21, inner.l31), in_ball(0, inner.l22, inner.l32),
                               in_ball(0, 0, inner.l33)};
    Matrix3 m;
    for (size_t i = 0; i < 3; ++i)
        for (size_t j = 0; j < 3; ++j) m[i][j] = dot(columns[i], columns[j]);
    const Vector shift = minus(to_doubles(inner.center), to_doubles(outer.center)),
                 away = in_ball(shift[0], shift[1], shift[2]);
    return std::sqrt(eigen_symmetric(m).values[0]) + std::sqrt(dot(away, away));
}

} // namespace

Result<Tree> ellipsoid_tree(const Ellipsoid& e) {
    const double entries[6] = {e.l11, e.l21, e.l22, e.l31, e.l32, e.l33};
    const auto center = to_doubles(e.center);
    for (const double x : entries)
        if (!std::isfinite(x)) return bad_size();
    for (const double x : center)
        if (!(std::abs(x) <= kLargestCoordinate)) return bad_size();
    if (!(e.l11 > 0 && e.l22 > 0 && e.l33 > 0)) return bad_size();
    const double size = std::max(
        {entries[0], std::abs(entries[1]) + entries[2], std::abs(entries[3]) + std::abs(entries[4]) + entries[5]});
    const format::Lattice lattice = format::lattice_for(center.data(), center.data(), size);
    constexpr double kRoom = 1 - 0x1p-30; // for the rounding of the comparison
    try {
        PackedLevel level;
        level.nodes.resize(1);
        double scale = 1;
        constexpr double kMostScale = 2; // beyond, no node of the format is small or large enough
        while (scale < kMostScale) {
            double factor[6];
            std::transform(std::begin(entries), std::end(entries), factor, [&](double x) { return scale * x; });
            format::quantise(level.nodes[0], lattice, center.data(), factor);
            const double growth = growth_to_hold(format::decode(level.nodes[0], lattice), e);
            if (growth <= kRoom) {
                auto tree = Tree::open(format::encode({}, kDegree, lattice, std::span(&level, 1)));
                return tree ? std::move(tree) : Result<Tree>(bad_size());
            }
            scale *= std::max(growth, 1 + 0x1p-18);
        }
        return bad_size();
    } catch (const std::bad_alloc&) {
        return Error{ErrorCode::out_of_memory, "there is not enough memory"};
    }
}

Result<Tree> capsule_tree(const Vec3& a, const Vec3& b, float radius) {
    if (!is_length(radius)) return bad_size();
    auto segment = tree_of({a, b}, {{0, 1, 1}}, false, radius); // a triangle without area
    return segment ? std::move(*segment).rounded(radius) : std::move(segment);
}

Result<Tree> sphere_tree(float radius) {
    return ellipsoid_tree({{0, 0, 0}, radius, 0, radius, 0, 0, radius});
}

} // namespace prolate
