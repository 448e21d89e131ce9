// Where the optimisation starts: clusters of voxels (paper, Algorithm 1, steps 5 and 6). No start is the best for every
// shape and count, so there are two kinds, and the builder tries several.
#pragma once

#include "builder/distance_field.hpp"
#include "builder/fit.hpp"
#include "builder/voxels.hpp"

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

namespace prolate {

/// Some cells and an ellipsoid for them.
struct Cluster {
    Fit fit;
    std::vector<uint32_t> cells; ///< rising
};

/// Step 6, the "Ellipsoids Merge Algorithm" of the paper's reference [16], whose text gives no details; m, the cost and
/// the neighbourhood are ours. m >> k connected blocks of cells, at most pieces_per_cluster * k, merged pairwise by the
/// least growth of E_vol until k are left; only touching ones, as long as there are any. A cluster keeps a support
/// sketch, so that an ellipsoid around a union costs the same whatever its size. O(m log m) merges. `cells` rising.
/// Fewer than k clusters only if there are fewer cells. Follows limbs; good for few ellipsoids.
std::vector<Cluster> merge_start(const Voxels& voxels, std::span<const uint32_t> cells, uint32_t k,
                                 uint32_t pieces_per_cluster, double min_radius,
                                 const std::function<double(const Fit&)>& outside);

/// The same for things that are given by their sketches: returns `k` groups of their numbers, rising, of at most `most`
/// each if that can be. `neighbours` say which touch.
std::vector<std::vector<uint32_t>> merge_groups(std::span<const Sketch> sketches,
                                                std::span<const std::vector<uint32_t>> neighbours, uint32_t k,
                                                size_t most, double min_radius,
                                                const std::function<double(const Fit&)>& outside);

/// E_vol of the ellipsoid (paper, eq. 2), by sampling its inside: without what `others` hold, too.
double sampled_outside_volume(const Fit& fit, const DistanceField& field, std::span<const Fit* const> others = {});

/// k cells far from each other, then Lloyd's algorithm. Spreads evenly; good for many ellipsoids.
std::vector<Cluster> spread_start(const Voxels& voxels, std::span<const uint32_t> cells, uint32_t k, uint64_t seed,
                                  double min_radius);

} // namespace prolate
