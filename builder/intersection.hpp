// Exact volume of (solid ∩ ellipsoid) and its gradient: the paper's analytical method (section 3.2.2), without its
// eight configurations.
//
// In the coordinates y = L^-1 (x - center) the ellipsoid is the unit ball, and the divergence theorem gives for the
// part of the solid in it
//     3 V = sigma + sum of h A,                                                                              (1)
// where sigma is the area of the sphere inside the solid and, for each triangle, A is the area of (triangle ∩ ball) and
// h the height of its plane above the origin. The boundary of that part of the sphere consists of the arcs in which the
// triangles cut it, so that by Stokes, for any point d of the sphere that lies on no arc,
//     sigma = 4 pi w(d) - sum over arcs, counter-clockwise about their triangles' normals, of I_d,           (2)
// where w is the winding number and I_d the area that the arc sweeps as seen from the antipode of d. The triangles that
// lie inside need not be looked at: whole subtrees enter (1) by their moments. What costs time is the triangles across
// the ellipsoid's surface. (The sum over solid angles at the center, of which the paper's is a variant, is (1) with
// sigma written as solid angles; it needs every triangle inside.)
//
// The gradient comes from the same terms. Under center += L s and L += L G the sphere moves outwards by n.s + n.G n:
//     dV/ds = integral of n = -sum of A n_t,   dV/dG = integral of n n^T = V 1 - sum of (integral of y) n_t^T,      (3)
// the integrals over the sphere inside the solid on the left, over (triangle ∩ ball) with normal n_t on the right, all
// of them times |det L|.
#pragma once

#include "builder/fit.hpp"
#include "builder/winding.hpp"

namespace prolate {

/// A volume that depends on an ellipsoid {center + L u : |u| <= 1}, and its derivatives in affine-invariant
/// coordinates: center += L s, L += L G changes it by d_center . s + (d_shape : G).
///
/// By the elements of Fit: dV/dcenter = L^-T d_center and dV/dL = lower triangle of L^-T d_shape.
/// By the paper's nine parameters, center, radii r and rotation R with L L^T = R diag(r)^2 R^T: let
/// B = diag(r)^-1 R^T (L d_shape L^T) R diag(r)^-1, which is d_shape for the factor R diag(r); then dV/dr_i = B_ii /
/// r_i, and a turn about axis k changes V by B_ij (r_i / r_j - r_j / r_i) per radian, (i, j, k) in cyclic order.
struct EllipsoidVolume {
    double volume = 0;
    Vec d_center = Vec::Zero();
    Mat d_shape = Mat::Zero(); ///< symmetric
};

/// Integral of the winding number over the ellipsoid: its volume inside the solid if the winding number is 1 in the
/// solid, and the negative of that if the mesh is inside out. Columns::winding_defect tells whether it is either; where
/// shells overlap, their volume counts more than once. The mesh must be closed: of an open one comes a finite number
/// that means little, and slowly.
///
/// Rounding errors are about 1e-15 of the ellipsoid's volume, times the axis ratio, times the size of the largest
/// triangle that it meets in units of its smallest radius if that is above 1. O(log n + triangles across the
/// ellipsoid's surface). Thread-safe.
EllipsoidVolume inside_volume(const Fit& ellipsoid, const Winding& winding);

/// What is left of the ellipsoid (the paper's EOTV summed, E_vol), its part inside given.
EllipsoidVolume outside_volume(const Fit& ellipsoid, const EllipsoidVolume& inside);

} // namespace prolate
