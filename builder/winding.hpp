// Generalized winding number of a triangle soup.
//
// Jacobson, Kavan, Sorkine-Hornung 2013 define it (the sum of signed solid angles over 4 pi: a whole number away from
// a closed surface, fractional around holes); Barill et al. 2018 evaluate it fast: a far cluster of triangles acts like
// the first two terms of its Taylor expansion, the sum of area * normal and its first moment. (One term is not enough:
// in a thin shell the normals of the two sides cancel, and the moment is all there is.) O(log n) a query for points
// away from the surface.
#pragma once

#include "builder/triangle_tree.hpp"

#include <optional>
#include <span>
#include <vector>

namespace prolate {

class Winding {
public:
    /// What a node of the tree looks like from afar: the first terms of a Taylor expansion around `center`, in
    /// N = area * unit normal. They are moments of the surface too, from which its integrals follow.
    struct Moments {
        Vec center;    // of area
        Vec dipole;    // sum of N
        Mat moment;    // sum of N * transpose(centroid - center)
        double radius; // of the ball around `center`
    };

    explicit Winding(MeshView mesh);

    /// Winding number at `p`. A cluster of radius r counts as far at a distance above `accuracy` * r. Thread-safe.
    double operator()(const Vec& p, double accuracy = 3) const;

    /// Winding number of a closed mesh, where it is whole; nothing if `p` is on the surface, for all that can be told
    /// quickly. Thread-safe.
    std::optional<double> whole(const Vec& p) const;

    const TriangleTree& tree() const { return tree_; }
    /// Of tree().nodes(), in the same order.
    std::span<const Moments> moments() const { return moments_; }

private:
    TriangleTree tree_;
    std::vector<Moments> moments_;
};

/// Signed solid angle of the triangle a, b, c seen from p, in (-2 pi, 2 pi] (Van Oosterom and Strackee 1983).
double solid_angle(const Vec& a, const Vec& b, const Vec& c, const Vec& p);

} // namespace prolate
