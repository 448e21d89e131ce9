// Sets next to a set of few ellipsoids that no descent reaches from it: two of them become one, and a third becomes
// two.
//
// A descent ends in the nearest minimum, and how many ellipsoids a limb has is decided by where it starts. The
// exchanges are ranked by estimates: what an ellipsoid around the cells of two sticks out more than they do, less what
// one around each of two clusters of a third's cells sticks out less than it does (compare split and merge of Gaussian
// mixtures: Ueda, Nakano, Ghahramani and Hinton 2000).
#pragma once

#include "builder/fit.hpp"
#include "builder/voxels.hpp"

#include <functional>
#include <span>
#include <vector>

namespace prolate {

/// At most `most` sets of as many ellipsoids as `fits`, the most promising one first. `shares` says which cells each of
/// `fits` has, rising; outside(fit) is E_vol. O(n^2) fits to sketches, for n fits.
std::vector<std::vector<Fit>> exchanges(std::span<const Fit> fits, std::span<const std::vector<uint32_t>> shares,
                                        const Voxels& cells, double min_radius,
                                        const std::function<double(const Fit&)>& outside, size_t most);

} // namespace prolate
