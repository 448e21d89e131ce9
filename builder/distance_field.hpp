// Signed distance to the surface of the solid, on a lattice.
//
// The optimiser asks for it millions of times: is this point of an ellipsoid's border inside the solid, and if not, how
// far does it stick out? Trilinear interpolation puts the surface where it is to a small part of a lattice step. The
// field only guides: no cover and no reported figure depends on it.
#pragma once

#include "builder/columns.hpp"
#include "builder/eigen.hpp"

#include <prolate/mesh.hpp>

#include <array>
#include <vector>

namespace prolate {

class DistanceField {
public:
    /// `resolution` steps along the longest side of the mesh's box. Distances next to the surface are exact, farther
    /// ones come from propagated closest points (Danielsson 1980). The inside is that of Columns.
    DistanceField(MeshView mesh, bool closed, const Winding& winding, uint32_t resolution);

    /// Distance from the solid, metres, negative inside. Beyond the lattice an estimate from its border. Thread-safe.
    double operator()(const Vec& p) const {
        const double q[3] = {(p.x() - origin_.x()) * per_pitch_, (p.y() - origin_.y()) * per_pitch_,
                             (p.z() - origin_.z()) * per_pitch_};
        double beyond = 0, part[3];
        int at[3];
        for (size_t a = 0; a < 3; ++a) {
            const double inside = std::clamp(q[a], 0.0, size_[a] - 1.001);
            beyond += (q[a] - inside) * (q[a] - inside);
            at[a] = static_cast<int>(inside), part[a] = inside - at[a];
        }
        const Corners &low = corners_[index(at[0], at[1], at[2])], &high = *(&low + 1);
        const auto mix = [](double a, double b, double t) { return a + t * (b - a); };
        double d[4];
        for (size_t c = 0; c < 4; ++c) d[c] = mix(low[c], high[c], part[2]);
        const double value = mix(mix(d[0], d[1], part[1]), mix(d[2], d[3], part[1]), part[0]) * unit_;
        return beyond > 0 ? value + std::sqrt(beyond) * pitch_ : value;
    }

    // The lattice itself, for sums over space: nodes at origin() + pitch() * (i, j, k).
    const Vec& origin() const { return origin_; }
    double pitch() const { return pitch_; }
    const std::array<int, 3>& size() const { return size_; }
    size_t index(int i, int j, int k) const {
        return (static_cast<size_t>(i) * static_cast<size_t>(size_[1]) + static_cast<size_t>(j)) *
                   static_cast<size_t>(size_[2]) +
               static_cast<size_t>(k);
    }
    /// Distances by index().
    std::span<const float> values() const { return distance_; }

private:
    void seed(MeshView mesh);
    void propagate();
    void sign(MeshView mesh, bool closed, const Winding& winding);
    void gather_corners();

    Vec origin_;
    double pitch_ = 0, per_pitch_ = 0, unit_ = 0;
    std::array<int, 3> size_{};
    std::vector<float> distance_;
    // Distances at (i, j, k), (i, j + 1, k), (i + 1, j, k), (i + 1, j + 1, k), in units: with the next ones, all
    // corners of a cell in 16 bytes. Points come in no order, and time goes into cache lines.
    using Corners = std::array<int16_t, 4>;
    std::vector<Corners> corners_;
    std::vector<Eigen::Vector3f> closest_; // of each node; emptied after the construction
};

} // namespace prolate
