// Holes that a cover must leave free: a ball of a given radius that passes through the mesh's passes the cover's, too.
//
// Where a ball that is somewhat larger fits around the mesh, its center has places on a lattice (free_space.hpp).
// These are thinned to a skeleton: places are taken away, nearest to the surface first, as long as this changes neither
// holes nor parts nor cavities of what is left (simple points; Bertrand and Malandain 1994), but never those on the
// lattice's border. What remains is the border, a curve through each hole, in its middle, and a sheet between parts
// that the ball passes between. If the cover keeps so far away from each place of the skeleton that the ball is free
// there and half a step around, the ball travels along it, through every hole.
#pragma once

#include "builder/triangle_tree.hpp"

#include <prolate/mesh.hpp>
#include <prolate/types.hpp>

#include <span>
#include <vector>

namespace prolate {

class Passages {
public:
    /// Of the mesh, for a ball of `radius` metres, in the ball_range() of its box (build.hpp). The same for any number
    /// of threads. Throws Cancelled.
    Passages(MeshView mesh, double radius);

    /// Places of the ball's center, a step of the lattice apart.
    std::span<const Vec> skeleton() const { return skeleton_; }
    /// Is there a hole at all, or a gap between parts, that the ball passes?
    bool any() const { return any_; }
    /// How far from each place of the skeleton the cover has to be, metres.
    double needed() const { return needed_; }

    struct Nearest {
        double distance; ///< of the place that the cover is nearest to: a lower bound, 0 if it holds the place
        Vec place;
    };
    Nearest nearest(std::span<const Ellipsoid> cover) const;

private:
    std::vector<Vec> skeleton_;
    bool any_ = false;
    double needed_, rounding_;
};

} // namespace prolate
