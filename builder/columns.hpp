// The solid as intervals along a lattice of z-columns.
//
// A column (x, y) meets the surface at a sorted list of heights; between two of them the winding number is constant (a
// closed mesh) or nearly so (an open one). Along z the solid is therefore exact, and a volume is a quadrature in x and
// y only. O(triangles + crossings).
#pragma once

#include "builder/eigen.hpp"
#include "builder/winding.hpp"

#include <prolate/mesh.hpp>

#include <span>
#include <vector>

namespace prolate {

struct Interval {
    double low, high;
};

/// Columns at (x0 + i * dx, y0 + j * dy), 0 <= i < nx, 0 <= j < ny.
struct ColumnLattice {
    double x0, y0, dx, dy;
    int nx, ny;
};

class Columns {
public:
    /// Casts the columns. The solid is where |winding number| >= 1/2: an inverted shell is solid too. For a closed
    /// mesh the winding number is counted along the column, for an open one it is `winding` halfway between crossings.
    Columns(MeshView mesh, bool closed, const Winding& winding, const ColumnLattice& lattice);

    /// Solid intervals of column (i, j), disjoint, in rising order.
    std::span<const Interval> column(int i, int j) const {
        const size_t c = static_cast<size_t>(i) * static_cast<size_t>(lattice_.ny) + static_cast<size_t>(j);
        return {intervals_.data() + begin_[c], begin_[c + 1] - begin_[c]};
    }
    const ColumnLattice& lattice() const { return lattice_; }
    /// Volume of the solid by these columns.
    double volume() const;

private:
    ColumnLattice lattice_;
    std::vector<size_t> begin_;
    std::vector<Interval> intervals_;
};

/// Volumes of a union of ellipsoids against the solid.
struct CoverVolume {
    double solid = 0;   ///< of the solid
    double whole = 0;   ///< of the union
    double outside = 0; ///< of the union less the solid
};

/// Measures the union of `ellipsoids` against the solid on columns_across x columns_across columns over all of it: a
/// lattice of its own, so that figures are not read off the grid that was optimised.
CoverVolume measure_cover(MeshView mesh, bool closed, const Winding& winding, std::span<const Ellipsoid> ellipsoids,
                          int columns_across);

} // namespace prolate
