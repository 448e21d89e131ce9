// Slabs: two parallel planes that hold all triangles below a node of an exact tree (T. L. Kay, J. T. Kajiya, "Ray
// Tracing Complex Scenes", SIGGRAPH 1986). Ellipsoids, boxes and hulls are quantised outwards, so of a flat face they
// are never as thin as the face is. A slab is: its normal is that of a triangle of the face, in double precision, and
// its heights are floats around 0. So bounds along it are as good as equal to the distance of flat faces that are
// parallel, and of all that is equally near nothing more need be looked at.
#pragma once

#include <prolate/tree.hpp>

#include <cstddef>

namespace prolate {

/// {x : low <= normal . x <= high}, body frame, metres. Computed in double precision: a corner's height over the plane
/// is wrong by less than kSlabRounding (|x| + |origin|), norms of sums of absolute values.
struct Slab {
    double normal[3]; ///< of length 1 but for rounding
    double origin[3]; ///< a point of the plane
    double low, high; ///< heights over the plane

    /// Height of a point over the plane.
    double height(const double x[3]) const {
        return (normal[0] * (x[0] - origin[0]) + normal[1] * (x[1] - origin[1])) + normal[2] * (x[2] - origin[2]);
    }
};
inline constexpr double kSlabRounding = 0x1p-49;

// Of a scaled tree, the normal is that of the triangle as stored, to the bit: the heights were measured along it.

/// Does a hull record have a slab?
bool has_slab(const std::byte* record) noexcept;

/// The plane of a triangle as a slab of no thickness. Its normal is NaN if the triangle has no area.
Slab plane_of(const TreeView& tree, uint32_t triangle) noexcept;

/// The slab of a hull record that has one.
Slab slab_of(const TreeView& tree, const std::byte* record) noexcept;

} // namespace prolate
