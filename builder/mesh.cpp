// clean(): welds and diagnoses a triangle mesh.
//
// Vertices are merged by exact position (-0 equals +0). Nothing is ever dropped that could lose a point of the surface:
//  - a triangle with a repeated corner is a segment or a point. It goes if that lies in a triangle that stays. The
//    edge balance does not change: its two edges a->b and b->a cancel.
//  - a triangle with three distinct collinear corners stays. It costs nothing, and in a closed mesh it often closes
//    the seam between one long edge and two short ones.
//
// Vertices that nearly coincide are joined only at open edges, and only if all edges cancel thereafter: to know an
// inside is worth a little move. Corner by corner a triangle then moves by the weld distance at most, and so do all its
// points, for they are convex combinations of its corners; the cover holds a margin of that width around the surface.
//
// By sorting numbers, so O(n) for every input, and the same result everywhere: vertices and triangles keep their order.
// Known limit: duplicated triangles stay.
#include "builder/mesh.hpp"

#include "builder/eigen.hpp"
#include "builder/job.hpp"
#include "builder/radix_sort.hpp"
#include "builder/shells.hpp"

#include "src/hash.hpp"

#include <prolate/tree.hpp>

#include <Eigen/Geometry>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <new>
#include <stdexcept>
#include <unordered_map>

namespace prolate {
namespace {

constexpr uint32_t kNoVertex = std::numeric_limits<uint32_t>::max();
constexpr const char* kNoArea = "the mesh has no triangle with an area";
constexpr double kSmallest = 1e-24; // diagonal: a leaf of kThinnestNodeOfMesh needs an exponent that the format has
constexpr float kWeldSpacings = 8;  // of kDefaultWeld

bool is_finite(const Vec3& v) {
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}
bool within_limit(const Vec3& v) {
    return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)}) <= kLargestCoordinate;
}

// For each vertex, the first vertex at the same position.
std::vector<uint32_t> representatives(std::span<const Vec3> vertices) {
    struct Key {
        std::array<uint32_t, 3> position;
        uint32_t index;
    };
    // Adding +0 turns -0 into +0 and leaves every other number alone.
    const auto bits = [](float coordinate) { return std::bit_cast<uint32_t>(coordinate + 0.0f); };
    std::vector<Key> keys(vertices.size());
    for (uint32_t i = 0; i < keys.size(); ++i)
        keys[i] = {{bits(vertices[i].x), bits(vertices[i].y), bits(vertices[i].z)}, i};
    for (size_t k = 3; k-- > 0;) radix_sort(keys, [k](const Key& key) { return uint64_t{key.position[k]}; });
    std::vector<uint32_t> first(vertices.size());
    for (size_t i = 0; i < keys.size(); ++i) {
        const bool same = i > 0 && keys[i].position == keys[i - 1].position;
        first[keys[i].index] = same ? first[keys[i - 1].index] : keys[i].index;
    }
    return first;
}

bool has_repeated_corner(const Triangle& t) {
    return t[0] == t[1] || t[1] == t[2] || t[2] == t[0];
}

// The cross product of two sides is exactly zero in double precision.
bool is_collinear(std::span<const Vec3> vertices, const Triangle& t) {
    const Vec3 &a = vertices[t[0]], &b = vertices[t[1]], &c = vertices[t[2]];
    const double u[3] = {double{b.x} - a.x, double{b.y} - a.y, double{b.z} - a.z};
    const double v[3] = {double{c.x} - a.x, double{c.y} - a.y, double{c.z} - a.z};
    return u[1] * v[2] == u[2] * v[1] && u[2] * v[0] == u[0] * v[2] && u[0] * v[1] == u[1] * v[0];
}

// One side of a triangle, as an undirected edge and the direction it is run through.
struct Side {
    uint32_t low, high;
    int32_t sign;
};
bool before(const Side& a, const Side& b) {
    return a.low != b.low ? a.low < b.low : a.high < b.high;
}

// All sides of the triangles without a repeated corner, sorted by edge.
std::vector<Side> sorted_sides(std::span<const Triangle> triangles) {
    std::vector<Side> sides;
    sides.reserve(3 * triangles.size());
    for (const Triangle& t : triangles) {
        if (has_repeated_corner(t)) continue;
        for (size_t i = 0; i < 3; ++i) {
            const uint32_t from = t[i], to = t[(i + 1) % 3];
            sides.push_back({std::min(from, to), std::max(from, to), from < to ? 1 : -1});
        }
    }
    radix_sort(sides, [](const Side& s) { return uint64_t{s.low} << 32 | s.high; });
    return sides;
}

// Calls visit(side, balance of directions, number of sides) for each edge.
template <class Visit> void for_each_edge(std::span<const Side> sides, Visit&& visit) {
    for (size_t i = 0, end = 0; i < sides.size(); i = end) {
        int64_t balance = 0;
        for (end = i; end < sides.size() && !before(sides[i], sides[end]); ++end) balance += sides[end].sign;
        visit(sides[i], balance, end - i);
    }
}

void classify_edges(std::span<const Side> sides, MeshReport& report) {
    report.open_edges = report.non_manifold_edges = 0;
    for_each_edge(sides, [&](const Side&, int64_t balance, size_t count) {
        report.open_edges += balance != 0;
        report.non_manifold_edges += count >= 3;
    });
    report.closed = report.open_edges == 0;
}

double distance(const Vec3& a, const Vec3& b) {
    return std::hypot(double{a.x} - b.x, double{a.y} - b.y, double{a.z} - b.z);
}

// For each vertex the one that it joins: the nearest earlier one that stays, within `tolerance`; itself if there is
// none, or if it is on no open edge. Those that stay are farther apart than the tolerance, so a cell has but a few.
std::vector<uint32_t> joined_vertices(std::span<const Vec3> vertices, std::span<const Side> sides, double tolerance) {
    std::vector<uint32_t> to(vertices.size());
    for (uint32_t i = 0; i < to.size(); ++i) to[i] = i;
    std::vector<bool> at_open_edge(vertices.size());
    for_each_edge(sides, [&](const Side& side, int64_t balance, size_t) {
        if (balance != 0) at_open_edge[side.low] = at_open_edge[side.high] = true;
    });
    using Cell = std::array<int64_t, 3>;
    struct Hash {
        size_t operator()(const Cell& cell) const { return hash_bytes(std::as_bytes(std::span(cell))); }
    };
    std::unordered_map<Cell, std::vector<uint32_t>, Hash> staying;
    // Coordinates of cells, as far as they fit: beyond, a cell has more vertices in it, and nothing else changes.
    const auto cell_of = [tolerance](float x) {
        return static_cast<int64_t>(std::clamp(std::floor(x / tolerance), -9e15, 9e15));
    };
    for (uint32_t v = 0; v < vertices.size(); ++v) {
        if (!at_open_edge[v]) continue;
        checkpoint();
        const Cell own = {cell_of(vertices[v].x), cell_of(vertices[v].y), cell_of(vertices[v].z)};
        double nearest = tolerance;
        for (int64_t n = 0; n < 27; ++n) {
            const auto found = staying.find({own[0] + n % 3 - 1, own[1] + n / 3 % 3 - 1, own[2] + n / 9 - 1});
            if (found == staying.end()) continue;
            for (const uint32_t other : found->second)
                if (const double d = distance(vertices[v], vertices[other]); d <= nearest) nearest = d, to[v] = other;
        }
        if (to[v] == v) staying[own].push_back(v);
    }
    return to;
}

double default_weld_of(std::span<const Vec3> vertices, std::span<const Triangle> triangles) {
    float largest = 0;
    for (const Triangle& t : triangles)
        for (const uint32_t corner : t) {
            const Vec3& v = vertices[corner];
            largest = std::max({largest, std::abs(v.x), std::abs(v.y), std::abs(v.z)});
        }
    return default_weld(largest);
}

// Joins what closes the mesh, if anything does: changes triangles, sides and report.
void close_by_welding(std::span<const Vec3> vertices, double tolerance, std::vector<Triangle>& triangles,
                      std::vector<Side>& sides, std::vector<uint32_t>& representative, MeshReport& report) {
    const std::vector<uint32_t> to = joined_vertices(vertices, sides, tolerance);
    std::vector<Triangle> joined = triangles;
    for (Triangle& t : joined)
        for (uint32_t& corner : t) corner = to[corner];
    std::vector<Side> new_sides = sorted_sides(joined);
    MeshReport closed = report;
    classify_edges(new_sides, closed);
    if (!closed.closed || new_sides.empty()) return;
    for (uint32_t v = 0; v < to.size(); ++v) {
        if (to[v] == v) continue;
        ++closed.welded_vertices;
        closed.weld_distance = std::max(closed.weld_distance, distance(vertices[v], vertices[to[v]]));
    }
    for (uint32_t& r : representative) r = to[r];
    triangles = std::move(joined), sides = std::move(new_sides), report = closed;
}

// Does the segment or point of a triangle with a repeated corner lie in a triangle without one?
bool is_redundant(const Triangle& t, std::span<const Side> sides, const std::vector<bool>& is_corner) {
    const auto [low, high] = std::minmax({t[0], t[1], t[2]});
    if (low == high) return is_corner[low];
    return std::binary_search(sides.begin(), sides.end(), Side{low, high, 0}, before);
}

// Numbers the used vertices in order and drops the others.
void drop_unused(Mesh& mesh, MeshReport& report, std::span<const uint32_t> representative) {
    std::vector<uint32_t> number(mesh.vertices.size(), kNoVertex);
    for (const Triangle& t : mesh.triangles)
        for (const uint32_t corner : t) number[corner] = 0;
    uint32_t used = 0;
    for (uint32_t i = 0; i < number.size(); ++i) {
        if (number[i] != kNoVertex) {
            mesh.vertices[used] = mesh.vertices[i];
            number[i] = used++;
        } else if (representative[i] == i) {
            ++report.unused_vertices;
        }
    }
    mesh.vertices.resize(used);
    for (Triangle& t : mesh.triangles)
        for (uint32_t& corner : t) corner = number[corner];
}

// Of the box of all that triangles use.
std::array<double, 3> box_size(MeshView mesh) {
    Vec3 low = mesh.vertices[mesh.triangles[0][0]], high = low;
    for (const Triangle& t : mesh.triangles)
        for (const uint32_t corner : t) {
            const Vec3& v = mesh.vertices[corner];
            low = {std::min(low.x, v.x), std::min(low.y, v.y), std::min(low.z, v.z)};
            high = {std::max(high.x, v.x), std::max(high.y, v.y), std::max(high.z, v.z)};
        }
    return {double{high.x} - low.x, double{high.y} - low.y, double{high.z} - low.z};
}

// The triangles with the corners that they were merged and joined to; but for those that are redundant.
void keep_triangles(std::span<const Triangle> welded, MeshView input, std::span<const Side> sides, CleanMesh& out) {
    std::vector<bool> is_corner(input.vertices.size());
    for (const Side& side : sides) is_corner[side.low] = is_corner[side.high] = true;
    for (const Triangle& t : welded) {
        const bool repeated = has_repeated_corner(t);
        out.report.degenerate_triangles += repeated || is_collinear(input.vertices, t);
        if (!repeated || !is_redundant(t, sides, is_corner)) out.mesh.triangles.push_back(t);
    }
}

Result<CleanMesh> clean_or_throw(MeshView input, float weld) {
    if (std::isnan(weld)) return Error{ErrorCode::bad_options, "the weld tolerance must be a length"};
    if (const auto sound = check_mesh(input); !sound) return sound.error();
    CleanMesh out;
    MeshReport& report = out.report;
    report.input_vertices = static_cast<uint32_t>(input.vertices.size());
    report.input_triangles = static_cast<uint32_t>(input.triangles.size());

    std::vector<uint32_t> representative = representatives(input.vertices);
    for (uint32_t i = 0; i < representative.size(); ++i) report.merged_vertices += representative[i] != i;
    std::vector<Triangle> welded(input.triangles.begin(), input.triangles.end());
    for (Triangle& t : welded)
        for (uint32_t& corner : t) corner = representative[corner];
    std::vector<Side> sides = sorted_sides(welded);
    classify_edges(sides, report);
    if (!report.closed && weld != 0) {
        const double tolerance = weld > 0 ? double{weld} : default_weld_of(input.vertices, welded);
        close_by_welding(input.vertices, tolerance, welded, sides, representative, report);
    }
    keep_triangles(welded, input, sides, out);
    if (report.degenerate_triangles == report.input_triangles) return Error{ErrorCode::bad_mesh, kNoArea};

    out.mesh.vertices.assign(input.vertices.begin(), input.vertices.end());
    // -0 and +0 were merged; which of them came first must not show in the result.
    for (Vec3& v : out.mesh.vertices) v = {v.x + 0.0f, v.y + 0.0f, v.z + 0.0f};
    drop_unused(out.mesh, report, representative);
    out.mesh.placement = input.placement;
    report.size = box_size(out.mesh.view());
    const TurnedShells shells = turn_shells(out.mesh);
    report.turned_shells = shells.turned;
    if (report.closed && !shells.has_volume && encloses_nothing(out.mesh)) report.closed = false;
    return out;
}

} // namespace

double default_weld(float largest_coordinate) noexcept {
    return double{kWeldSpacings} * (double{std::nextafter(largest_coordinate, HUGE_VALF)} - double{largest_coordinate});
}

Result<void> check_mesh(MeshView mesh) {
    constexpr size_t kMost = kNoVertex - 1;
    if (mesh.triangles.empty()) return Error{ErrorCode::bad_mesh, "the mesh has no triangles"};
    if (mesh.vertices.size() > kMost || mesh.triangles.size() > kMost)
        return Error{ErrorCode::bad_mesh, "the mesh has too many vertices or triangles (2^32 or more)"};
    for (size_t i = 0; i < mesh.vertices.size(); ++i) {
        if (!is_finite(mesh.vertices[i])) return Error{ErrorCode::bad_mesh, "vertex coordinate is not finite", i};
        if (!within_limit(mesh.vertices[i]))
            return Error{ErrorCode::bad_mesh, "vertex coordinate beyond 1.9e22 m (2^74); give the mesh in another unit",
                         i};
    }
    for (size_t i = 0; i < mesh.triangles.size(); ++i)
        for (const uint32_t corner : mesh.triangles[i])
            if (corner >= mesh.vertices.size())
                return Error{ErrorCode::bad_mesh, "triangle names a vertex that does not exist", i};
    const auto has_area = [&mesh](const Triangle& t) { return !is_collinear(mesh.vertices, t); };
    if (std::none_of(mesh.triangles.begin(), mesh.triangles.end(), has_area))
        return Error{ErrorCode::bad_mesh, kNoArea};
    const auto size = box_size(mesh);
    if (std::hypot(size[0], size[1], size[2]) < kSmallest)
        return Error{ErrorCode::bad_mesh, "the mesh is less than 1e-24 m across; give it in another unit"};
    return {};
}

double surface_area(MeshView mesh) {
    double area = 0;
    for (const Triangle& t : mesh.triangles) {
        const Vec a = to_vec(mesh.vertices[t[0]]);
        area += 0.5 * (to_vec(mesh.vertices[t[1]]) - a).cross(to_vec(mesh.vertices[t[2]]) - a).norm();
    }
    return area;
}

Result<CleanMesh> clean(MeshView mesh, float weld, const std::function<bool()>& go_on) {
    try {
        if (!go_on) return clean_or_throw(mesh, weld); // for the job that this thread works for, if any
        return Job(0, go_on).run([&] { return clean_or_throw(mesh, weld); });
    } catch (const Cancelled&) {
        return Error{ErrorCode::cancelled, "cancelled"};
    } catch (const std::bad_alloc&) {
    } catch (const std::length_error&) {
    }
    return Error{ErrorCode::out_of_memory, "the mesh does not fit into memory"};
}

uint64_t hash(MeshView mesh) noexcept {
    static_assert(sizeof(Placement) == 6 * sizeof(double));
    return hash_bytes(std::as_bytes(std::span(&mesh.placement, 1)),
                      hash_bytes(std::as_bytes(mesh.triangles), hash_bytes(std::as_bytes(mesh.vertices))));
}

} // namespace prolate
