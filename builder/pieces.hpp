// The solid as convex pieces, fine where it matters.
//
// A cover assigns whole pieces to ellipsoids, so a piece on the seam between two ellipsoids must fit into one of them:
// pieces are cut in eight there (refine()), down to a quarter of a voxel. Deep inside, voxels are joined to blocks.
#pragma once

#include "builder/fit.hpp"
#include "builder/voxels.hpp"

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace prolate {

class Pieces {
public:
    /// `resolution` voxels along the longest side of the mesh's box. Keeps `mesh`, for refine().
    Pieces(MeshView mesh, bool closed, const Winding& winding, uint32_t resolution);

    uint32_t size() const { return static_cast<uint32_t>(pieces_.size()); }
    /// Points whose convex hull contains the piece: an ellipsoid that contains them covers it.
    std::span<const Vec> points(uint32_t piece) const {
        return {points_.data() + pieces_[piece].first_point, pieces_[piece].point_count};
    }
    /// Ball around the points.
    const Vec& center(uint32_t piece) const { return pieces_[piece].center; }
    double radius(uint32_t piece) const { return pieces_[piece].radius; }
    /// True if a part of the surface lies in the piece.
    bool on_surface(uint32_t piece) const { return pieces_[piece].triangle_count > 0; }

    /// Calls visit(point) for those points that are corners of the mesh's triangles clipped to the piece's box: the
    /// others are corners of the box.
    template <class Visit> void for_each_surface_point(uint32_t piece, Visit&& visit) const {
        if (!on_surface(piece)) return;
        for (const Vec& p : points(piece)) {
            bool corner = true;
            for (size_t a = 0; a < 3; ++a) {
                const double low = origin_[int(a)] + step_ * pieces_[piece].low[a];
                const double high = origin_[int(a)] + step_ * (pieces_[piece].low[a] + pieces_[piece].side);
                corner = corner && (p[int(a)] == low || p[int(a)] == high);
            }
            if (!corner) visit(p);
        }
    }

    /// Cuts the piece along the middle planes of its box. The parts lie in the hull of its points. One keeps the
    /// piece's number, the others get the next free ones. False, and nothing changes, if the piece is as small as
    /// pieces get.
    bool refine(uint32_t piece);

    /// The piece that `piece` was a part of when it got its number; itself if it was one from the start. Never higher.
    uint32_t cut_from(uint32_t piece) const { return pieces_[piece].cut_from; }

    /// Calls visit(piece) for each piece whose box may meet `box`, in a fixed order.
    template <class Visit> void for_each_near(const Box& box, Visit&& visit) const {
        std::array<int, 3> low, high;
        for (size_t a = 0; a < 3; ++a) {
            const double step = kBlock * kParts * step_;
            const auto bucket = [&](double x) {
                return static_cast<int>(std::clamp(std::floor((x - origin_[int(a)]) / step), 0.0, buckets_[a] - 1.0));
            };
            low[a] = bucket(box.low[int(a)]), high[a] = bucket(box.high[int(a)]);
        }
        for (int i = low[0]; i <= high[0]; ++i)
            for (int j = low[1]; j <= high[1]; ++j)
                for (int k = low[2]; k <= high[2]; ++k)
                    for (const uint32_t piece : in_bucket_[bucket_index(i, j, k)]) visit(piece);
    }

private:
    static constexpr int kParts = 4; // of a voxel: the smallest pieces
    static constexpr int kBlock = 8; // voxels: the largest pieces

    struct Piece {
        std::array<int, 3> low; // of its box, in steps
        int side;               // of its box, in steps
        uint32_t point_count, triangle_count;
        size_t first_point, first_triangle;
        uint32_t cut_from;
        Vec center;
        double radius;
    };
    size_t bucket_index(int i, int j, int k) const {
        return (static_cast<size_t>(i) * static_cast<size_t>(buckets_[1]) + static_cast<size_t>(j)) *
                   static_cast<size_t>(buckets_[2]) +
               static_cast<size_t>(k);
    }
    size_t bucket_of(const Piece& piece) const {
        constexpr int side = kBlock * kParts;
        return bucket_index(piece.low[0] / side, piece.low[1] / side, piece.low[2] / side);
    }
    Pieces(MeshView mesh, bool closed, const Winding& winding, const Voxels& voxels);
    void add_voxels(const Voxels& voxels);
    void add_points(Piece& piece, std::vector<Vec>& points);
    bool inside(const std::array<int, 3>& at) const;
    bool between_corners(const Piece& whole, const std::array<int, 3>& at) const;
    Vec corner(const Piece& piece, size_t c) const;
    bool cut(const Piece& whole, const std::array<int, 3>& low, Piece& part);

    MeshView mesh_;
    bool closed_;
    Vec origin_;
    double step_ = 0; // width of the smallest pieces
    Columns columns_; // through all corners that pieces can have
    std::array<int, 3> buckets_{};
    std::vector<std::vector<uint32_t>> in_bucket_;
    std::vector<Piece> pieces_;
    std::vector<Vec> points_;
    std::vector<uint32_t> triangles_;
};

/// Minimum-volume ellipsoid around the points of `pieces`, to a tight tolerance: around a support sketch first, then
/// again with what sticks out.
Fit fit_pieces(const Pieces& pieces, std::span<const uint32_t> members, double min_radius);

/// Largest radial coordinate of any point of these pieces: `fit` scaled by it holds them. 0 for no pieces.
double reach_of(const Fit& fit, const Pieces& pieces, std::span<const uint32_t> members);

} // namespace prolate
