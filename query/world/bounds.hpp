// Axis-aligned boxes around placed trees, certified; and how far a placed tree can have moved.
//
// A box is how far the tree reaches along the axes (reach.hpp). Between two poses, a point R (o + y) + t of a turned
// box in the tree's frame, |y| <= |h|, moves along an axis by at most that of R o + t, plus |R' - R| |h|. So a box
// needs not be computed again while that is less than the room around it.
//
// Rounding, in the terms and with the bounds of query/ellipsoid/separation.hpp, body A being the world (identity, so T
// = R). u = 2^-53.
//   box         t: 37 u |d|; its sum with what reach() says, and with the margin: 2 u (|d| + S + margin), of which the
//               part of S is paid by reach() and kSeparationMargin (|d| + margin), 256 u, is added
//   motion      of R o + t 75 u |o| + 37 u |d| for each pose, |R' - R| 136 u and its own rounding 4 u |R' - R|, at most
//               16 u: with |h|, less than 84 u (S + S'), S = |o| + |h| + |d|, of which 256 u are added: the rest pays
//               for its own rounding, and for that of the local box's o and h, 2 u (|o| + |h|)
// To float: round_down(x) = float(x - (2^-23 |x| + 2^-149)). Rounding to nearest moves y by at most 2^-24 |y| or, among
// subnormals, 2^-150, which is less than what was taken away; so the result is at most x. Beyond the range it is an
// infinity on the safe side, or the largest float if that is.
#pragma once

#include "query/world/reach.hpp"

#include <prolate/bounds.hpp>

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include <limits>

namespace prolate::query {

/// A box around a body in the tree's own frame: computed once, good for every pose.
struct LocalBounds {
    glm::dvec3 center, half;
    double radius, reach; // |half|, |center| + |half|
};
LocalBounds local_bounds(const TreeView& tree) noexcept;

/// bounds(), but not finite where that is infinite. `tolerance` and `rounding` are those of reach().
Bounds bounds_at(const TreeView& tree, const RelativePose& to_world, float margin, double tolerance = kReachTolerance,
                 double rounding = kSeparationMargin) noexcept;

/// Of the boxes of a World, small beside their slack: half as dear as those of bounds().
inline constexpr double kBoxTolerance = 0x1p-6;

/// Where a tree is, as far as motion is concerned.
struct Anchor {
    glm::dmat3 rotation{};
    glm::dvec3 center{}; // of the local box, turned
    double reach = 0;    // the body's S
};
Anchor anchor(const LocalBounds& local, const RelativePose& to_world) noexcept;

/// No point of the body moves farther than that along any axis. NaN if a pose is not finite.
double motion(const LocalBounds& local, const Anchor& from, const Anchor& to,
              double rounding = kSeparationMargin) noexcept;

/// Of all points: where nothing can be said.
inline constexpr float kInfiniteFloat = std::numeric_limits<float>::infinity();
inline constexpr Bounds kEverything{{-kInfiniteFloat, -kInfiniteFloat, -kInfiniteFloat},
                                    {kInfiniteFloat, kInfiniteFloat, kInfiniteFloat}};

bool is_finite(const Bounds& box) noexcept;
float round_down(double x) noexcept;
float round_up(double x) noexcept;

} // namespace prolate::query
