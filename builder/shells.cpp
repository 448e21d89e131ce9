// Which shells are inside out?
//
// A shell is a set of triangles that hang together by edges; it counts if its own edges cancel. Across it the winding
// number jumps by one. Where shells do not meet, turning those between a negative number and one that is not positive
// makes the winding number its absolute value everywhere: the solid stays, and all its surface faces outwards. On the
// shell itself the winding number is the mean of both sides, so its sign tells (Jacobson et al. 2013 for the number).
//
// Where shells do meet, the sign changes along them. A shell of negative volume is then turned if any of it lies where
// there is no solid around to be cut out of, so that its part outside becomes solid; one of positive volume stays. This
// never takes anything from the solid.
#include "builder/shells.hpp"

#include "builder/job.hpp"
#include "builder/radix_sort.hpp"
#include "builder/winding.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <utility>

namespace prolate {
namespace {

constexpr size_t kSamples = 32;            // triangles of a shell that are asked
constexpr double kClearlyNegative = -0.25; // of -1/2, and its error
constexpr double kNoVolume = 1e-9;         // of the area's 3/2 power: flat, or as much in as out
constexpr double kOffSurface = 1e-3; // of the root of a triangle's area: a step to where the winding number is clear

struct ShellSide {
    uint32_t low, high, triangle;
    int32_t sign;
};

// For each triangle a number of its shell, 0 ... count - 1, and which shells are closed.
struct Shells {
    std::vector<uint32_t> of;
    std::vector<bool> closed;
};

Shells find_shells(std::span<const Triangle> triangles) {
    std::vector<ShellSide> sides;
    sides.reserve(3 * triangles.size());
    for (uint32_t t = 0; t < triangles.size(); ++t)
        for (size_t i = 0; i < 3; ++i) {
            const uint32_t from = triangles[t][i], to = triangles[t][(i + 1) % 3];
            if (from != to) sides.push_back({std::min(from, to), std::max(from, to), t, from < to ? 1 : -1});
        }
    radix_sort(sides, [](const ShellSide& s) { return uint64_t{s.low} << 32 | s.high; }); // triangles keep their order
    std::vector<uint32_t> parent(triangles.size());
    std::iota(parent.begin(), parent.end(), 0u);
    const auto root_of = [&](uint32_t t) {
        while (parent[t] != t) t = parent[t] = parent[parent[t]];
        return t;
    };
    std::vector<uint32_t> open; // triangles at edges that do not cancel
    for (size_t i = 0, end = 0; i < sides.size(); i = end) {
        int64_t balance = 0;
        for (end = i; end < sides.size() && sides[end].low == sides[i].low && sides[end].high == sides[i].high; ++end) {
            balance += sides[end].sign;
            parent[root_of(sides[end].triangle)] = root_of(sides[i].triangle);
        }
        if (balance != 0) open.push_back(sides[i].triangle);
    }
    Shells out;
    out.of.resize(triangles.size());
    std::vector<uint32_t> number(triangles.size());
    uint32_t count = 0;
    for (uint32_t t = 0; t < triangles.size(); ++t)
        if (root_of(t) == t) number[t] = count++;
    for (uint32_t t = 0; t < triangles.size(); ++t) out.of[t] = number[root_of(t)];
    out.closed.assign(count, true);
    for (const uint32_t t : open) out.closed[out.of[t]] = false;
    return out;
}

// How much a shell encloses.
struct ShellExtent {
    double volume = 0, area = 0;

    bool has_volume() const { return std::abs(volume) > kNoVolume * std::pow(area, 1.5); }
};

std::array<Vec, 3> corners_of(const Mesh& mesh, uint32_t t) {
    const auto corner = [&](size_t i) { return to_vec(mesh.vertices[mesh.triangles[t][i]]); };
    return {corner(0), corner(1), corner(2)};
}

// Volumes are taken around a point of each shell, so that they keep their digits far from (0, 0, 0).
std::vector<ShellExtent> extents(const Mesh& mesh, const Shells& shells) {
    constexpr uint32_t kNone = std::numeric_limits<uint32_t>::max();
    std::vector<uint32_t> first(shells.closed.size(), kNone);
    std::vector<ShellExtent> out(shells.closed.size());
    for (uint32_t t = 0; t < mesh.triangles.size(); ++t) {
        const uint32_t shell = shells.of[t];
        if (first[shell] == kNone) first[shell] = t;
        const auto [p, q, r] = corners_of(mesh, t);
        const Vec o = corners_of(mesh, first[shell])[0], a = p - o, b = q - o, c = r - o;
        out[shell].volume += a.dot(b.cross(c)) / 6;
        out[shell].area += (b - a).cross(c - a).norm() / 2;
    }
    return out;
}

} // namespace

TurnedShells turn_shells(Mesh& mesh) {
    const Shells shells = find_shells(mesh.triangles);
    const std::vector<ShellExtent> extent = extents(mesh, shells);
    const size_t count = extent.size();
    TurnedShells out;
    bool any_inward = false;
    for (size_t s = 0; s < count; ++s) {
        out.has_volume |= extent[s].has_volume();
        any_inward |= shells.closed[s] && extent[s].volume < 0 && extent[s].has_volume();
    }
    if (!any_inward) return out; // then nothing is negative around any other shell either

    std::vector<std::vector<uint32_t>> members(count);
    for (uint32_t t = 0; t < mesh.triangles.size(); ++t) members[shells.of[t]].push_back(t);
    const Winding winding(mesh.view());
    const auto is_negative = [&](uint32_t t) {
        const auto [a, b, c] = corners_of(mesh, t);
        const Vec p = (a + b + c) / 3;
        // Seen from itself a triangle counts for nothing; rounding makes it one side or the other.
        const double itself = solid_angle(a, b, c, p) / (4 * std::numbers::pi);
        return winding(p) - itself < kClearlyNegative;
    };
    std::vector<bool> turned(count);
    for (size_t s = 0; s < count; ++s) {
        if (!shells.closed[s] || !extent[s].has_volume()) continue;
        const size_t step = std::max<size_t>(1, members[s].size() / kSamples);
        size_t asked = 0, negative = 0;
        for (size_t i = 0; i < members[s].size(); i += step) {
            checkpoint();
            const auto [a, b, c] = corners_of(mesh, members[s][i]);
            if ((b - a).cross(c - a).norm() == 0) continue;
            ++asked, negative += is_negative(members[s][i]);
        }
        turned[s] = extent[s].volume < 0 ? negative > 0 : negative == asked && asked > 0;
    }
    for (uint32_t t = 0; t < mesh.triangles.size(); ++t)
        if (turned[shells.of[t]]) std::swap(mesh.triangles[t][1], mesh.triangles[t][2]);
    out.turned = static_cast<uint32_t>(std::count(turned.begin(), turned.end(), true));
    return out;
}

bool encloses_nothing(const Mesh& mesh) {
    const Winding winding(mesh.view());
    for (uint32_t t = 0; t < mesh.triangles.size(); ++t) {
        checkpoint();
        const auto [a, b, c] = corners_of(mesh, t);
        const Vec across = (b - a).cross(c - a);
        if (across.norm() == 0) continue;
        const Vec step = kOffSurface * std::sqrt(across.norm()) * across.normalized(), p = (a + b + c) / 3;
        for (const Vec& beside : {Vec(p + step), Vec(p - step)})
            if (winding.whole(beside).value_or(0) != 0) return false;
    }
    return true;
}

} // namespace prolate
