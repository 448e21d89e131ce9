// Joint variational optimisation of a set of ellipsoids (paper, Algorithm 1, step 7; its reference [16] gives no
// details, so the method is ours).
//
// What is lowered is
//     J = weighted volume of (union \ solid) + kappa * volume of (solid \ union),
// over all centers and shapes at once, while kappa rises from 1 - the ellipsoids *approximate* the solid - to 18: they
// all but cover it. There are no assignments to get stuck in: who covers what follows from where the ellipsoids are.
//
// The gradient is a boundary integral (Hadamard's formula: a boundary that moves outwards by v sweeps v dS). In
// coordinates that make every ellipsoid the unit ball, c += L s and L += L G, a border point c + L u moves by
// L (s + G u), and the volume changes by
//     dV = |det L| * integral over the unit sphere of w(u) * (s . u + G : u u^T) du,
// with w = 0 where another ellipsoid covers the point, -kappa inside the solid, and outside it the weight of volume at
// the distance d that the point sticks out, beta + alpha (d / scale)^2: the first term is E_vol, the second takes the
// place of E_sur^3, the integral of 3 d^2 along the way out (paper, eqs. 1 - 4). The sphere is sampled; an evaluation
// touches no volume at all.
//
// Points of the surface that stay uncovered pull on the ellipsoid next to them with a multiplier that grows as long as
// they do (dual ascent): thin sheets have no volume that kappa could see.
#pragma once

#include "builder/distance_field.hpp"
#include "builder/fit.hpp"

#include <prolate/tree.hpp>

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

namespace prolate {

/// What the optimisation minimises, besides that the solid be covered (paper, eq. 3).
struct Objective {
    double alpha, beta;
    double scale; ///< metres: where alpha and beta weigh the same

    /// Weight of a piece of volume outside the solid, at the distance `d` >= 0 from it.
    double operator()(double d) const { return beta + alpha * (d / scale) * (d / scale); }
};

struct DescentOptions {
    Objective objective;
    Primitive primitive;
    int iterations;
    int directions;     ///< samples of an ellipsoid's border an iteration
    double min_radius;  ///< metres
    bool relocate;      ///< let ellipsoids that are of little use help where the error is worst
    double first_kappa; ///< 1 for a start from scratch; more to stay near the start
    double pull = 20;   ///< how fast the multipliers of uncovered points grow, times ellipsoids / points
    uint64_t seed;
    /// Empty, or a number for each ellipsoid: one helps only such as have the same.
    std::span<const uint32_t> family = {};
    /// Ellipsoids beside `fits` that stay as they are and hide what they hold. Not together with relocate.
    std::span<const Fit> fixed = {};
    std::function<void(double)> progress = {}; ///< called now and then with the share that is done
};

/// Lowers J. `points` on the surface are to be covered; owner[p] is an ellipsoid near points[p]. The result depends on
/// no number of threads. It covers nearly everything; polish() does the rest.
void descend(std::vector<Fit>& fits, const DistanceField& field, std::span<const Vec> points,
             std::vector<uint32_t> owner, const DescentOptions& options);

/// Nearest shape to `fit` that the primitive allows: the ball of the same volume for a sphere.
Fit as_primitive(const Fit& fit, Primitive primitive);

/// The ellipsoid after the step c += L s, L += L G, with G symmetric; within the caps.
Fit moved(const Fit& fit, const Vec& s, const Mat& g, double min_radius);

/// For each ellipsoid, those others whose boxes, enlarged by the factor `margin`, meet its own: in rising order.
std::vector<std::vector<uint32_t>> neighbours_of(std::span<const Fit> fits, double margin);

} // namespace prolate
