// From an approximate cover to a tight, certain one.
//
// Lloyd's idea, with cover as a hard constraint. In turn, each ellipsoid is freed from all pieces that another one
// holds too: only the pieces that it *alone* holds bind it. It then takes a step down the gradient of the volume that
// it adds (gradient_descent.hpp), as far as those pieces let it: a quadratic program in nine unknowns with one linear
// constraint a binding point. What no other ellipsoid needs any more is given free, and the next one profits.
#pragma once

#include "builder/gradient_descent.hpp"
#include "builder/intersection.hpp"
#include "builder/pieces.hpp"

namespace prolate {

struct PolishOptions {
    Objective objective;
    Primitive primitive;
    int sweeps;
    double first_step; ///< relative to the radii; later ones are smaller
    int directions;    ///< samples of an ellipsoid's border a step
    double min_radius;
    /// E_vol of an ellipsoid and its gradient, in closed form (the analytic method); empty: sampled on the distance
    /// field (the voxel method). What the other ellipsoids hide of it is sampled either way.
    std::function<EllipsoidVolume(const Fit&)> outside;
    /// Hybrid error of a set that covers, by a finer measure than the steps follow: the best set seen is kept.
    std::function<double(std::span<const Fit>)> error;
    uint64_t seed;
    std::function<void(double)> progress = {};
};

/// Cuts the pieces that no ellipsoid holds nearly or wholly, until one does or they are as small as
/// pieces get: seams between ellipsoids become fine, everything else stays coarse.
void refine_seams(Pieces& pieces, std::span<const Fit> fits);

/// Makes `fits` cover all pieces and lowers their error. Returns each piece's owner: the ellipsoid that holds it most
/// centrally. Ellipsoids that the others make redundant own nothing.
std::vector<uint32_t> polish(std::vector<Fit>& fits, const Pieces& pieces, const DistanceField& field,
                             const PolishOptions& options);

} // namespace prolate
