// Checking and hashing of BuildOptions, by themselves and for a mesh.
#include "builder/options.hpp"

#include "builder/effort.hpp"

#include "src/bytes.hpp"
#include "src/hash.hpp"

#include <prolate/version.hpp>

#include <algorithm>
#include <array>
#include <cmath>

namespace prolate {

Result<void> validate(const BuildOptions& o) {
    const auto bad = [](const char* what, uint64_t value) { return Error{ErrorCode::bad_options, what, value}; };
    if (o.degree < 2 || o.degree > kMaxDegree) return bad("degree must be 2 to 64", o.degree);
    const bool has_limit = o.tolerance != 0 || o.distance != 0 || o.clearance != 0 || o.keep_holes != 0;
    if (o.levels > 0 && (o.ellipsoids > 0 || has_limit))
        return bad("levels go with no other goal: give only one of levels, and ellipsoids or a closeness or both", 0);
    if (o.levels >= kMaxLevels) return bad("levels must be 1 to 31", o.levels);
    if (o.ellipsoids > 65536) return bad("ellipsoids must be 1 to 65536", o.ellipsoids);
    if (!std::isfinite(o.tolerance) || o.tolerance < 0) return bad("tolerance must be above 0", 0);
    if (!std::isfinite(o.distance) || o.distance < 0) return bad("distance must be above 0", 0);
    if (!std::isfinite(o.clearance) || o.clearance < 0) return bad("clearance must be a length above 0", 0);
    if (!std::isfinite(o.fill) || o.fill < 0) return bad("fill must be a radius above 0", 0);
    if (!std::isfinite(o.keep_holes) || o.keep_holes < 0) return bad("keep_holes must be a radius above 0", 0);
    if (o.fill > 0 && o.keep_holes > 0)
        return bad("fill closes holes that keep_holes is to leave free: give only one of them", 0);
    if (!std::isfinite(o.alpha) || o.alpha < 0) return bad("alpha must be 0 or above", 0);
    if (!std::isfinite(o.beta) || o.beta < 0) return bad("beta must be 0 or above", 0);
    if (o.alpha + o.beta <= 0) return bad("alpha and beta must not both be 0", 0);
    if (o.exact && (o.levels > 0 || o.ellipsoids > 0 || has_limit))
        return bad("an exact tree goes down to its triangles: give no levels, ellipsoids or closeness", 0);
    if (o.exact && o.fill > 0)
        return bad("an exact tree holds the mesh's triangles: it cannot fill what is between", 0);
    if (o.exact && o.primitive != Primitive::ellipsoid)
        return bad("an exact tree is made of ellipsoids", static_cast<uint64_t>(o.primitive));
    if (o.inner > 65536) return bad("inner ellipsoids must be 1 to 65536", o.inner);
    if (o.leaf_triangles < 1 || o.leaf_triangles > kMaxLeafTriangles)
        return bad("triangles in a leaf must be 1 to 127", o.leaf_triangles);
    if (!std::isfinite(o.weld)) return bad("the weld tolerance must be a length", 0);
    if (o.threads > 1024) return bad("threads must be 0 (all cores) to 1024", o.threads);
    return {};
}

double least_clearance(double diagonal, Quality quality) noexcept {
    return effort_of(quality).distance_tolerance * diagonal;
}

BallRange ball_range(double longest_side) noexcept {
    return {longest_side / 64, longest_side / 2}; // two or more cells of the lattices of fill.cpp and passages.cpp
}

double most_distance(const BuildOptions& o, double diagonal) noexcept {
    const double share = 0.01 * double{o.distance} * diagonal;
    return std::min(o.distance > 0 ? share : HUGE_VAL, o.clearance > 0 ? double{o.clearance} : HUGE_VAL);
}

Result<void> check_asked(const BuildOptions& o, const Vec& sides, bool closed) {
    if (o.inner > 0 && !closed)
        return Error{ErrorCode::bad_mesh,
                     "an open mesh has no inside for an inner cover; close it, or fill it, or bake without", 0};
    const double diagonal = sides.norm();
    if (most_distance(o, diagonal) < least_clearance(diagonal, o.quality) * (1 - 1e-6))
        return Error{ErrorCode::bad_options,
                     "the clearance or distance is finer than distances are measured; "
                     "ask for at least 0.01 % of the diagonal, with quality fast 0.1 %",
                     0};
    const BallRange range = ball_range(sides.maxCoeff());
    for (const float radius : {o.fill, o.keep_holes})
        if (radius > 0 && (double{radius} < range.least || double{radius} > range.most))
            return Error{ErrorCode::bad_options,
                         "the ball of fill or keep_holes is too small or too large for this mesh; "
                         "its radius may be 1/64 to 1/2 of the longest side of the mesh's box",
                         0};
    return {};
}

uint64_t hash(const BuildOptions& o) {
    std::array<std::byte, 68> bytes{};
    std::byte* to = bytes.data();
    const auto put = [&to](auto value) {
        store_le(to, value);
        to += sizeof value;
    };
    put(kBuilderVersion), put(uint32_t{o.inner > 0 ? kFormatVersion : kPlainFormatVersion});
    put(o.degree), put(o.levels), put(o.ellipsoids), put(o.tolerance), put(o.distance), put(o.clearance),
        put(o.keep_holes), put(o.fill);
    put(o.alpha), put(o.beta), put(o.seed), put(o.weld);
    put(static_cast<uint8_t>(o.method)), put(static_cast<uint8_t>(o.primitive)), put(static_cast<uint8_t>(o.quality));
    put(static_cast<uint8_t>(o.exact ? o.leaf_triangles : 0));
    put(o.inner);
    return hash_bytes(bytes);
}

} // namespace prolate
