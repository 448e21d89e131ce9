// A deformed body's nodes, triangles and points, in its own frame, in double precision.
//
// Rounding, in the terms of query/ellipsoid/separation.hpp: u = 2^-53, S = all lengths that enter, |q_i d_i| and the
// growths and radii among them (`reach`). With M <= kMaxModes = 64 modes, a center c + s sum q_i d_i is wrong by at
// most (M + 3) u S, each product and each sum one rounding, and L (1 + sum |q_i| g_i) by (M + 3) u S; with what both
// bodies' poses cost, 83 u S, p - a - b is wrong by less than 83 u S + 67 u S, within the 256 u S that is demanded
// there. Triangles: 91 u S + 67 u S of 256 u S. Rays: 15 + 124 + 67 u S, and 67 u S more where the ray begins at a
// deformed point; of triangles 352 + 4 * 67 u S. Twice the margins of query/raycast/ray.hpp are taken. Bones
// (skinning.hpp) pay for what they add to nodes, and add 20 u S to points: 178 of 256 u S between triangles, 352 + 4 *
// 87 of 704 of rays.
#pragma once

#include "query/deform/skinning.hpp"
#include "query/ellipsoid/placed.hpp"
#include "query/triangle/placed.hpp"

#include <prolate/deform.hpp>

#include <cstdint>
#include <optional>
#include <span>

namespace prolate::query {

class Deformed {
public:
    /// `body` must outlive it. Nodes from level `max_level` on stand for what is below them.
    Deformed(const DeformedBody& body, uint32_t max_level) noexcept;

    /// Do the bounds hold for these coordinates?
    bool in_range() const noexcept { return in_range_; }
    const TreeView& tree() const noexcept { return body_.tree; }
    const Pose& pose() const noexcept { return body_.pose; }
    /// What lies inside of the body, beyond its leaf ellipsoids and triangles, belongs to it, too.
    bool encloses() const noexcept;

    /// What holds all that `node` stands for.
    Bound bound(uint32_t node) const noexcept;
    PlacedTriangle triangle(uint32_t t) const noexcept;
    /// Is it on level max_level, so that it is not to be opened?
    bool too_deep(uint32_t node) const noexcept { return node >= limit_from_; }
    bool ends_at(uint32_t node) const noexcept { return too_deep(node) || tree().is_leaf(node); }
    TriangleRange triangles(uint32_t node) const noexcept { return tree().triangles(node); }

    /// One point at least of each connected part of the surface; of a rigid tree without triangles there are none.
    uint32_t witness_count() const noexcept;
    PlacedPoint witness(uint32_t w) const noexcept;

private:
    PlacedPoint moved(const glm::dvec3& at_rest, uint32_t point) const noexcept;

    const DeformedBody& body_;
    std::optional<Deformation> modes_;
    std::optional<Skin> skin_;
    std::optional<Skinning> skinning_; ///< if there are matrices
    bool in_range_ = false;
    uint32_t limit_from_;
};

/// From B's frame to A's, as place() of query/ellipsoid/placed.hpp does.
Bound place(const Bound& of_b, const RelativePose& b_to_a) noexcept;
PlacedTriangle place(const PlacedTriangle& of_b, const RelativePose& b_to_a) noexcept;

} // namespace prolate::query
