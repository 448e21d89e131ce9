// Dividing a sub-volume among k ellipsoids (paper, Algorithm 1, steps 6 and 7).
#pragma once

#include "builder/outside_volume.hpp"

#include <atomic>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

namespace prolate {

/// A part of the solid, as cells, and an ellipsoid that covers the points of all of them.
struct Cluster {
    Fit fit;
    std::vector<uint32_t> cells;
};

struct SplitOptions {
    HybridError error;
    double min_radius; ///< metres; keeps flat parts from flat ellipsoids
    int sweeps;        ///< of the variational optimisation
    int trials;        ///< proposals an ellipsoid and sweep
    int starts;        ///< different starts that split() tries
    uint64_t seed;
    const std::atomic<bool>* cancelled;        ///< checked between sweeps; then the result is to be thrown away
    std::function<void(double)> progress = {}; ///< called after each sweep with the share that is done
};

/// Ellipsoid around the points of `cells`, to a tight tolerance: sketch, fit, and refit with what sticks out.
Fit fit_cells(const Voxels& voxels, std::span<const uint32_t> cells, double min_radius);

/// Step 6: m >> k connected blocks of cells, at most `pieces_per_child` * k, merged pairwise by the least growth of the
/// error until k are left. O(m log m) merges. Fewer than k clusters only if there are fewer cells.
std::vector<Cluster> merge_pieces(const Voxels& voxels, std::span<const uint32_t> cells, uint32_t k,
                                  uint32_t pieces_per_child, const SplitOptions& options);

/// Clusters that partition the cells of a node.
struct Split {
    std::vector<Cluster> clusters;
    double outside = 0; ///< volume of (union of their ellipsoids \ solid)
    double error = 0;   ///< hybrid error of the set
};

/// The cells that an ellipsoid may hold, as rising positions in a list of cells.
using Domain = std::span<const uint32_t>;

/// Step 7: lowers the error of `clusters`, which partition `cells`, by moving and reshaping one ellipsoid at a time.
/// The result partitions them too, cluster i within domains[i]; clusters that nothing is left for come back empty.
Split optimise(const Voxels& voxels, std::span<const uint32_t> cells, const std::vector<Cluster>& clusters,
               std::span<const Domain> domains, const SplitOptions& options);

/// Steps 6 and 7, from options.starts different numbers of pieces and seeds, of which the best is kept, because the
/// optimisation is local: up to k clusters, none empty.
Split split(const Voxels& voxels, std::span<const uint32_t> cells, uint32_t k, const SplitOptions& options);

} // namespace prolate
