// What bones do to a node and to a vertex, in the body's own frame, in double precision (skin.hpp says why that holds).
//
// Rounding: u = 2^-53, K bones, H = N X + t, N the largest norm of their matrices, X all lengths that enter before they
// do, t their longest translation. M's entries are wrong by (K + 1) u N, so M c and M L by (K + 9) u H, each |(T_b - M)
// y| by 4 (K + 9) u H, and the sum of spreads times these by as much for each 1 that the spreads add up to; a vertex's
// shares are wrong by 4 u each, which costs another 8 K u H. All that is paid by the radius, 16 (K + 32) u H (1 + sum
// s_b), so that the moved ellipsoid counts as exact, but for what went into X. Vertices have no radius: with at most 8
// bones they are wrong by 20 u H more, which body.hpp accounts for.
#pragma once

#include "query/ellipsoid/placed.hpp"

#include <prolate/skin.hpp>

#include <span>

namespace prolate::query {

/// All points within `radius` of an ellipsoid. The ellipsoid's reach counts it.
struct Bound {
    PlacedEllipsoid core;
    double radius;
};

/// Where modes took a node's corners: each by `shift`, and less than `spread` off it.
struct ModeShift {
    glm::dvec3 shift{0};
    double spread = 0;
};

/// Finite, and not so large that numbers leave a float's range?
bool are_sound(std::span<const BoneMatrix> bones) noexcept;

class Skinning {
public:
    /// `bones` must be sound, as many as the skin has, and outlive it. `scale`: of the tree.
    Skinning(const Skin& skin, std::span<const BoneMatrix> bones, double scale) noexcept
        : skin_(skin), bones_(bones), scale_(scale) {}

    /// What holds all that `node` stands for, `bound` before bones move it.
    Bound moved(uint32_t node, const Bound& bound, const ModeShift& by) const noexcept;
    /// Point `p` of the skin, at `point` before bones move it.
    PlacedPoint moved(uint32_t p, const PlacedPoint& point) const noexcept;

private:
    Skin skin_;
    std::span<const BoneMatrix> bones_;
    double scale_;
};

} // namespace prolate::query
