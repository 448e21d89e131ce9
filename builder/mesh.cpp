// clean(): welds and diagnoses a triangle mesh.
//
// Vertices are merged by exact position only (-0 equals +0); a tolerance would move the surface, and the cover is
// promised for the surface as given. So nothing is ever dropped that could lose a point of it:
//  - a triangle with a repeated corner is a segment or a point. It goes if that lies in a triangle that stays. The
//    edge balance does not change: its two edges a->b and b->a cancel.
//  - a triangle with three distinct collinear corners stays. It costs nothing, and in a closed mesh it often closes
//    the seam between one long edge and two short ones.
//
// By sorting, so O(n log n) for every input, and the same result everywhere: vertices and triangles keep their order.
// Known limits: nearly equal positions are not merged (such a mesh is reported as open); duplicated triangles stay.
#include <prolate/mesh.hpp>

#include "src/hash.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <new>
#include <stdexcept>

namespace prolate {
namespace {

constexpr uint32_t kNone = std::numeric_limits<uint32_t>::max();

bool is_finite(const Vec3& v) {
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

// For each vertex, the first vertex at the same position.
std::vector<uint32_t> representatives(std::span<const Vec3> vertices) {
    struct Key {
        std::array<uint32_t, 3> position;
        uint32_t index;
        auto operator<=>(const Key&) const = default;
    };
    // Adding +0 turns -0 into +0 and leaves every other number alone.
    const auto bits = [](float coordinate) { return std::bit_cast<uint32_t>(coordinate + 0.0f); };
    std::vector<Key> keys(vertices.size());
    for (uint32_t i = 0; i < keys.size(); ++i)
        keys[i] = {{bits(vertices[i].x), bits(vertices[i].y), bits(vertices[i].z)}, i};
    std::sort(keys.begin(), keys.end());
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
    std::sort(sides.begin(), sides.end(), before);
    return sides;
}

void classify_edges(std::span<const Side> sides, MeshReport& report) {
    for (size_t i = 0; i < sides.size();) {
        size_t end = i;
        int64_t balance = 0;
        for (; end < sides.size() && !before(sides[i], sides[end]); ++end) balance += sides[end].sign;
        report.open_edges += balance != 0;
        report.non_manifold_edges += end - i >= 3;
        i = end;
    }
    report.closed = report.open_edges == 0;
}

// Does the segment or point of a triangle with a repeated corner lie in a triangle without one?
bool is_redundant(const Triangle& t, std::span<const Side> sides, const std::vector<bool>& is_corner) {
    const auto [low, high] = std::minmax({t[0], t[1], t[2]});
    if (low == high) return is_corner[low];
    return std::binary_search(sides.begin(), sides.end(), Side{low, high, 0}, before);
}

// Numbers the used vertices in order and drops the others.
void drop_unused(Mesh& mesh, MeshReport& report, std::span<const uint32_t> representative) {
    std::vector<uint32_t> number(mesh.vertices.size(), kNone);
    for (const Triangle& t : mesh.triangles)
        for (const uint32_t corner : t) number[corner] = 0;
    uint32_t used = 0;
    for (uint32_t i = 0; i < number.size(); ++i) {
        if (number[i] != kNone) {
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

Result<CleanMesh> clean_or_throw(MeshView input) {
    constexpr size_t kMost = kNone - 1;
    if (input.triangles.empty()) return Error{ErrorCode::bad_mesh, "the mesh has no triangles"};
    if (input.vertices.size() > kMost || input.triangles.size() > kMost)
        return Error{ErrorCode::bad_mesh, "the mesh has too many vertices or triangles (2^32 or more)"};
    for (size_t i = 0; i < input.vertices.size(); ++i)
        if (!is_finite(input.vertices[i])) return Error{ErrorCode::bad_mesh, "vertex coordinate is not finite", i};
    for (size_t i = 0; i < input.triangles.size(); ++i)
        for (const uint32_t corner : input.triangles[i])
            if (corner >= input.vertices.size())
                return Error{ErrorCode::bad_mesh, "triangle names a vertex that does not exist", i};

    CleanMesh out;
    MeshReport& report = out.report;
    report.input_vertices = static_cast<uint32_t>(input.vertices.size());
    report.input_triangles = static_cast<uint32_t>(input.triangles.size());

    const std::vector<uint32_t> representative = representatives(input.vertices);
    for (uint32_t i = 0; i < representative.size(); ++i) report.merged_vertices += representative[i] != i;
    std::vector<Triangle> welded(input.triangles.begin(), input.triangles.end());
    for (Triangle& t : welded)
        for (uint32_t& corner : t) corner = representative[corner];

    const std::vector<Side> sides = sorted_sides(welded);
    classify_edges(sides, report);
    std::vector<bool> is_corner(input.vertices.size());
    for (const Side& side : sides) is_corner[side.low] = is_corner[side.high] = true;

    for (const Triangle& t : welded) {
        const bool repeated = has_repeated_corner(t);
        report.degenerate_triangles += repeated || is_collinear(input.vertices, t);
        if (!repeated || !is_redundant(t, sides, is_corner)) out.mesh.triangles.push_back(t);
    }
    if (report.degenerate_triangles == report.input_triangles)
        return Error{ErrorCode::bad_mesh, "the mesh has no triangle with an area"};

    out.mesh.vertices.assign(input.vertices.begin(), input.vertices.end());
    // -0 and +0 were merged; which of them came first must not show in the result.
    for (Vec3& v : out.mesh.vertices) v = {v.x + 0.0f, v.y + 0.0f, v.z + 0.0f};
    drop_unused(out.mesh, report, representative);
    return out;
}

} // namespace

Result<CleanMesh> clean(MeshView mesh) {
    try {
        return clean_or_throw(mesh);
    } catch (const std::bad_alloc&) {
    } catch (const std::length_error&) {
    }
    return Error{ErrorCode::out_of_memory, "the mesh does not fit into memory"};
}

uint64_t hash(MeshView mesh) noexcept {
    return hash_bytes(std::as_bytes(mesh.triangles), hash_bytes(std::as_bytes(mesh.vertices)));
}

} // namespace prolate
