// Generalized winding number of a triangle soup.
//
// Jacobson, Kavan, Sorkine-Hornung 2013 define it (the sum of signed solid angles over 4 pi: a whole number away from
// a closed surface, fractional around holes); Barill et al. 2018 evaluate it fast: a far cluster of triangles acts like
// the first two terms of its Taylor expansion, the sum of area * normal and its first moment. (One term is not enough:
// in a thin shell the normals of the two sides cancel, and the moment is all there is.) O(log n) a query for points
// away from the surface.
#pragma once

#include "builder/eigen.hpp"

#include <prolate/mesh.hpp>

#include <vector>

namespace prolate {

class Winding {
public:
    explicit Winding(MeshView mesh);

    /// Winding number at `p`. A cluster of radius r counts as far at a distance above `accuracy` * r. Thread-safe.
    double operator()(const Vec& p, double accuracy = 3) const;

private:
    struct Node {
        Vec center, dipole; // dipole: sum of area * unit normal
        Mat moment;         // sum of area * unit normal * transpose(centroid - center)
        double radius;
        uint32_t begin, end; // triangles, in order_
        uint32_t right;      // second child; the first follows the node; 0 for a leaf
    };
    void build(uint32_t begin, uint32_t end);

    std::vector<std::array<Vec, 3>> corners_;
    std::vector<Node> nodes_;
};

/// Signed solid angle of the triangle a, b, c seen from p, in (-2 pi, 2 pi] (Van Oosterom and Strackee 1983).
double solid_angle(const Vec& a, const Vec& b, const Vec& c, const Vec& p);

} // namespace prolate
