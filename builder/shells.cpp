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

#include "builder/winding.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <utility>

namespace prolate {
namespace {

constexpr size_t kSamples = 32;            // triangles of a shell that are asked
constexpr double kClearlyNegative = -0.25; // of -1/2, and its error
constexpr double kNoVolume = 1e-9;         // of the area's 3/2 power: flat, or as much in as out

struct Side {
    uint32_t low, high, triangle;
    int32_t sign;
};

// For each triangle a number of its shell, 0 ... count - 1, and which shells are closed.
struct Shells {
    std::vector<uint32_t> of;
    std::vector<bool> closed;
};

Shells find_shells(std::span<const Triangle> triangles) {
    std::vector<Side> sides;
    sides.reserve(3 * triangles.size());
    for (uint32_t t = 0; t < triangles.size(); ++t)
        for (size_t i = 0; i < 3; ++i) {
            const uint32_t from = triangles[t][i], to = triangles[t][(i + 1) % 3];
            if (from != to) sides.push_back({std::min(from, to), std::max(from, to), t, from < to ? 1 : -1});
        }
    std::sort(sides.begin(), sides.end(), [](const Side& a, const Side& b) {
        return a.low != b.low ? a.low < b.low : a.high != b.high ? a.high < b.high : a.triangle < b.triangle;
    });
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

} // namespace

uint32_t turn_shells(Mesh& mesh) {
    const Shells shells = find_shells(mesh.triangles);
    const size_t count = shells.closed.size();
    // Volumes around a point of each, so that they keep their digits far from (0, 0, 0).
    std::vector<double> volume(count), area(count);
    std::vector<std::vector<uint32_t>> members(count);
    const auto corner = [&](uint32_t t, size_t i) { return to_vec(mesh.vertices[mesh.triangles[t][i]]); };
    for (uint32_t t = 0; t < mesh.triangles.size(); ++t) {
        std::vector<uint32_t>& shell = members[shells.of[t]];
        shell.push_back(t);
        const Vec o = corner(shell.front(), 0), a = corner(t, 0) - o, b = corner(t, 1) - o, c = corner(t, 2) - o;
        volume[shells.of[t]] += a.dot(b.cross(c)) / 6;
        area[shells.of[t]] += (b - a).cross(c - a).norm() / 2;
    }
    const auto has_volume = [&](size_t s) { return std::abs(volume[s]) > kNoVolume * std::pow(area[s], 1.5); };
    const auto is_inward = [&](size_t s) { return shells.closed[s] && volume[s] < 0 && has_volume(s); };
    bool any = false;
    for (size_t s = 0; s < count; ++s) any |= is_inward(s);
    if (!any) return 0; // then nothing is negative around any other shell either

    const Winding winding(mesh.view());
    const auto is_negative = [&](uint32_t t) {
        const Vec a = corner(t, 0), b = corner(t, 1), c = corner(t, 2), p = (a + b + c) / 3;
        // Seen from itself a triangle counts for nothing; rounding makes it one side or the other.
        const double itself = solid_angle(a, b, c, p) / (4 * std::numbers::pi);
        return winding(p) - itself < kClearlyNegative;
    };
    std::vector<bool> turned(count);
    for (size_t s = 0; s < count; ++s) {
        if (!shells.closed[s] || !has_volume(s)) continue;
        const size_t step = std::max<size_t>(1, members[s].size() / kSamples);
        size_t asked = 0, negative = 0;
        for (size_t i = 0; i < members[s].size(); i += step) {
            const uint32_t t = members[s][i];
            if ((corner(t, 1) - corner(t, 0)).cross(corner(t, 2) - corner(t, 0)).norm() == 0) continue;
            ++asked, negative += is_negative(t);
        }
        turned[s] = volume[s] < 0 ? negative > 0 : negative == asked && asked > 0;
    }
    for (uint32_t t = 0; t < mesh.triangles.size(); ++t)
        if (turned[shells.of[t]]) std::swap(mesh.triangles[t][1], mesh.triangles[t][2]);
    return static_cast<uint32_t>(std::count(turned.begin(), turned.end(), true));
}

} // namespace prolate
