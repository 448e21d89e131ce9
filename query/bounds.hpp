// Axis-aligned boxes around placed trees, certified; and how far a placed tree can have moved.
//
// Three boxes hold the solid, and so does what they have in common:
//   that of the root ellipsoid: along a unit axis, {c + L u} reaches |L^T axis| to either side of c;
//   that of the nodes of level 1, all together; this is where the time goes;
//   that of a box in the tree's frame, around the deepest cut of at most kMostNodes nodes: half extents |R| h.
// Between two poses, a point R (o + y) + t of the turned box, |y| <= |h|, moves along an axis by at most that of
// R o + t, plus |R' - R| |h|. So a box needs not be computed again while that is less than the room around it.
//
// Rounding, in the terms and with the bounds of separation.hpp, body A being the world (identity, so T = R). u = 2^-53.
//   ellipsoid   center 75 u |c| + 37 u |d|; row of L' 74 u |L|, its norm 78 u |L|; center -+ norm -+ margin: two more
//               roundings, 2 u S, S = |c| + |L| + |d| + margin: in all less than 84 u S
//   turned box  R o: 75 u |o| + 37 u |d|, |R| h: 71 u |h|, S = |o| + |h| + |d| + margin: less than 84 u S
//   motion      of R o + t 75 u |o| + 37 u |d| for each pose, |R' - R| 136 u and its own rounding 4 u |R' - R|, at most
//               16 u: with |h|, less than 84 u (S + S')
// kSeparationMargin S, 256 u S, is added on each side; the rest pays for its own rounding, and for that of the local
// box's o and h, 2 u (|o| + |h|).
// To float: round_down(x) = float(x - (2^-23 |x| + 2^-149)). Rounding to nearest moves y by at most 2^-24 |y| or, among
// subnormals, 2^-150, which is less than what was taken away; so the result is at most x. Beyond the range it is an
// infinity on the safe side, or the largest float if that is.
#pragma once

#include "query/separation.hpp"

#include <prolate/bounds.hpp>

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include <limits>
#include <span>

namespace prolate::query {

/// What bounds a tree in its own frame: computed once, good for every pose.
struct LocalBounds {
    Ellipsoid root;
    glm::dvec3 center, half; // a box around a cut
    double radius, reach;    // |half|, |center| + |half|
};
LocalBounds local_bounds(const TreeView& tree) noexcept;

/// The box, given the nodes of level 1 (or none: it may be larger then). The last argument is there only so that the
/// tests can show that a wrong one is caught. Not finite if the pose is not.
Bounds bounds_at(const LocalBounds& local, std::span<const Ellipsoid> level_1, const RelativePose& to_world,
                 float margin, double rounding = kSeparationMargin) noexcept;
Bounds bounds_at(const TreeView& tree, const LocalBounds& local, const RelativePose& to_world, float margin) noexcept;

/// Where a tree is, as far as motion is concerned.
struct Anchor {
    glm::dmat3 rotation{};
    glm::dvec3 center{}; // of the turned box
    double reach = 0;    // the body's S
};
Anchor anchor(const LocalBounds& local, const RelativePose& to_world) noexcept;

/// No point of the solid moves farther than that along any axis. NaN if a pose is not finite.
double motion(const LocalBounds& local, const Anchor& from, const Anchor& to,
              double rounding = kSeparationMargin) noexcept;

/// Of all points: where nothing can be said.
inline constexpr float kInfinity = std::numeric_limits<float>::infinity();
inline constexpr Bounds kEverything{{-kInfinity, -kInfinity, -kInfinity}, {kInfinity, kInfinity, kInfinity}};

bool is_finite(const Bounds& box) noexcept;
float round_down(double x) noexcept;
float round_up(double x) noexcept;

} // namespace prolate::query
