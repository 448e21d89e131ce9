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
#include <cstdint>
#include <span>
#include <vector>

namespace prolate {

class Voxels {
public:
    static constexpr uint32_t kNoCell = UINT32_MAX;

    /// `resolution` cells along the longest side of the mesh's box. No surface samples yet.
    Voxels(MeshView mesh, bool closed, const Winding& winding, uint32_t resolution);

    /// Replaces the surface samples by about `count` new ones (paper's P_s), area-uniform.
    void sample_surface(MeshView mesh, uint32_t count, uint64_t seed);

    /// Cells that hold a part of the solid: 0 ... cell_count() - 1, in raster order.
    uint32_t cell_count() const { return static_cast<uint32_t>(coordinates_.size()); }
    std::span<const Vec> points(uint32_t cell) const {
        return {points_.data() + point_begin_[cell], point_begin_[cell + 1] - point_begin_[cell]};
    }
    /// Surface samples in the cell.
    std::span<const Vec> samples(uint32_t cell) const {
        return {samples_.data() + sample_begin_[cell], sample_begin_[cell + 1] - sample_begin_[cell]};
    }
    /// Ball around the points.
    const Vec& center(uint32_t cell) const { return balls_[cell].center; }
    double radius(uint32_t cell) const { return balls_[cell].radius; }
    /// True if a part of the surface lies in the cell.
    bool on_surface(uint32_t cell) const { return on_surface_[cell]; }

    /// Those of `cells` that the convex hull of all their points rests on: the others are full and have all six face
    /// neighbours among `cells`, so their corners are their neighbours' too.
    std::vector<uint32_t> hull_cells(std::span<const uint32_t> cells) const;

    const std::array<int, 3>& coordinates(uint32_t cell) const { return coordinates_[cell]; }
    /// The cell at (i, j, k), or kNoCell; any integers.
    uint32_t cell_at(int i, int j, int k) const { return inside_grid(i, j, k) ? cell_of_[index(i, j, k)] : kNoCell; }

    // The grid, for sums over space.
    const Vec& origin() const { return origin_; }
    double pitch() const { return pitch_; }
    const std::array<int, 3>& size() const { return size_; }
    size_t index(int i, int j, int k) const {
        return (static_cast<size_t>(i) * static_cast<size_t>(size_[1]) + static_cast<size_t>(j)) *
                   static_cast<size_t>(size_[2]) +
               static_cast<size_t>(k);
    }
    bool inside_grid(int i, int j, int k) const {
        return i >= 0 && j >= 0 && k >= 0 && i < size_[0] && j < size_[1] && k < size_[2];
    }
    /// Share of the voxel at index() that is solid, 0 ... 1.
    float solid_fraction(size_t index) const { return solid_[index]; }
    /// Solid length, in cells, of the row (i, j) below the height `z`, in cells from the grid's floor.
    double solid_below(int i, int j, double z) const {
        const double clamped = std::clamp(z, 0.0, double(size_[2]));
        const int k = std::min(static_cast<int>(clamped), size_[2] - 1);
        const size_t v = index(i, j, k);
        return double{below_[v]} + (clamped - k) * double{solid_[v]};
    }
    /// Volume of the solid.
    double solid_volume() const { return solid_volume_; }

private:
    struct Ball {
        Vec center;
        double radius;
    };
    void clip_triangles(MeshView mesh, std::vector<std::pair<uint32_t, Vec>>& pieces) const;
    void measure_fractions(MeshView mesh, bool closed, const Winding& winding);
    void collect_cells(MeshView mesh, bool closed, const Winding& winding);

    Vec origin_;
    double pitch_ = 0;
    std::array<int, 3> size_{};
    double solid_volume_ = 0;
    std::vector<float> solid_;
    std::vector<float> below_; // running sum of solid_ along z, this voxel excluded
    std::vector<uint32_t> cell_of_;
    std::vector<std::array<int, 3>> coordinates_;
    std::vector<size_t> point_begin_, sample_begin_;
    std::vector<Vec> points_, samples_;
    std::vector<Ball> balls_;
    std::vector<bool> on_surface_;
};

} // namespace prolate
