// The voxelised solid (paper, section 4, steps 1 and 2): which part of the solid lies in which cell.
//
// A cell's *piece* is (solid ∩ cell), given by points whose convex hull contains it: the corners of the mesh's
// triangles clipped to the cell, and the cell's own corners inside the solid. Those are all the extreme points that the
// polyhedron (solid ∩ cell) can have, so an ellipsoid - it is convex - that contains the points contains the piece.
// Every cover in the builder is a cover of points for that reason, and sheets thinner than a cell are covered like the
// rest.
#pragma once

#include "builder/columns.hpp"
#include "builder/eigen.hpp"

#include <prolate/mesh.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

namespace prolate {

class Voxels {
public:
    static constexpr uint32_t kNoCell = UINT32_MAX;

    /// `resolution` cells along the longest side of the mesh's box.
    Voxels(MeshView mesh, bool closed, const Winding& winding, uint32_t resolution);

    /// Cells that hold a part of the solid: 0 ... cell_count() - 1, in raster order.
    uint32_t cell_count() const { return static_cast<uint32_t>(coordinates_.size()); }
    std::span<const Vec> points(uint32_t cell) const {
        return {points_.data() + point_begin_[cell], point_begin_[cell + 1] - point_begin_[cell]};
    }
    /// Triangles that a part of the surface in the cell belongs to; none if the cell lies wholly inside the solid.
    std::span<const uint32_t> triangles(uint32_t cell) const {
        return {triangles_.data() + triangle_begin_[cell], triangle_begin_[cell + 1] - triangle_begin_[cell]};
    }

    const std::array<int, 3>& coordinates(uint32_t cell) const { return coordinates_[cell]; }
    /// The cell at (i, j, k), or kNoCell; any integers.
    uint32_t cell_at(int i, int j, int k) const { return inside_grid(i, j, k) ? cell_of_[index(i, j, k)] : kNoCell; }
    /// The cell around `p`, or kNoCell.
    uint32_t cell_at(const Vec& p) const {
        const Vec q = (p - origin_) / pitch_;
        if (!(q.array() >= 0).all() || !(q.array() < 1e9).all()) return kNoCell;
        return cell_at(static_cast<int>(q.x()), static_cast<int>(q.y()), static_cast<int>(q.z()));
    }

    /// Box of the cell's points.
    Box box(uint32_t cell) const {
        Box out;
        for (const Vec& p : points(cell)) out.add(p);
        return out;
    }
    /// Calls visit(cell) for each cell that meets `region`, in raster order.
    template <class Visit> void for_each_in(const Box& region, Visit&& visit) const {
        std::array<int, 3> low, high;
        for (int a = 0; a < 3; ++a) {
            const auto at = [&](double x) {
                const double last = size_[static_cast<size_t>(a)] - 1;
                return static_cast<int>(std::clamp(std::floor((x - origin_[a]) / pitch_), 0.0, last));
            };
            low[static_cast<size_t>(a)] = at(region.low[a]), high[static_cast<size_t>(a)] = at(region.high[a]);
        }
        for (int i = low[0]; i <= high[0]; ++i)
            for (int j = low[1]; j <= high[1]; ++j)
                for (int k = low[2]; k <= high[2]; ++k)
                    if (const uint32_t cell = cell_of_[index(i, j, k)]; cell != kNoCell) visit(cell);
    }

    // Cell (i, j, k) is the box from origin() + pitch() * (i, j, k), pitch() wide.
    const Vec& origin() const { return origin_; }
    double pitch() const { return pitch_; }
    const std::array<int, 3>& size() const { return size_; }

private:
    size_t index(int i, int j, int k) const {
        return (static_cast<size_t>(i) * static_cast<size_t>(size_[1]) + static_cast<size_t>(j)) *
                   static_cast<size_t>(size_[2]) +
               static_cast<size_t>(k);
    }
    bool inside_grid(int i, int j, int k) const {
        return i >= 0 && j >= 0 && k >= 0 && i < size_[0] && j < size_[1] && k < size_[2];
    }
    template <class Visit> void clip_triangles(MeshView mesh, Visit&& visit) const;
    void collect_cells(MeshView mesh, bool closed, const Winding& winding);

    Vec origin_;
    double pitch_ = 0;
    std::array<int, 3> size_{};
    std::vector<uint32_t> cell_of_;
    std::vector<std::array<int, 3>> coordinates_;
    std::vector<size_t> point_begin_, triangle_begin_;
    std::vector<Vec> points_;
    std::vector<uint32_t> triangles_;
};

} // namespace prolate
