// What a quality stands for, in the bake.
#pragma once

#include <prolate/tree.hpp>

#include <cstddef>
#include <cstdint>

namespace prolate {

/// How a set of ellipsoids is looked for.
struct Search {
    int starts;         ///< tried for each set; the best ones go on
    int iterations;     ///< of the descent from each start
    int cycles;         ///< shorter descents afterwards, each from the best state so far, that relocate again
    int finalists;      ///< that are polished: which one is the tightest is only known then
    int sweeps;         ///< of the polish
    double polish_step; ///< its first one, relative to the radii
    int trials = 0;     ///< per ellipsoid, in neighbourhoods of the set that a descent found
    int exchanges = 0;  ///< tried of sets of few ellipsoids, see exchange.hpp: each a shorter descent
};

struct Effort {
    uint32_t resolution; ///< voxels along the longest side, at least
    Search few;          ///< for sets of up to 16 ellipsoids
    Search search;       ///< for those of up to 64
    Search many;         ///< for larger ones, of which starts differ little and a large step of the polish gains more
    double distance_tolerance; ///< of measured distances: of the largest one, in diagonals
    uint32_t distance_samples; ///< for their mean and percentile
};

constexpr Effort effort_of(Quality quality) {
    constexpr Search fast{1, 300, 0, 1, 4, 0.01}, normal{2, 500, 0, 1, 8, 0.01}, few{3, 1500, 2, 1, 12, 0.1, 4, 24},
        best{3, 4000, 0, 1, 12, 0.1, 8};
    switch (quality) {
    case Quality::fast:
        return {64, fast, fast, {1, 300, 0, 1, 6, 0.05}, 1e-3, 2000};
    case Quality::normal:
        return {96, normal, normal, {1, 750, 0, 1, 16, 0.05}, 1e-4, 8000};
    case Quality::best:
        break;
    }
    return {192, few, best, {3, 1500, 2, 1, 12, 0.05}, 1e-4, 32000};
}

/// How an exact tree is looked for.
struct ExactEffort {
    size_t axes;            ///< along which parts of the binary tree may be cut, see BinaryTree
    size_t hull_directions; ///< whose extreme corners are candidates for a hull's points, at most 48
    double tolerance;       ///< of inner ellipsoids' radii
};

/// Quality::best is as normal: twice as many axes, all corners as candidates and a tenth of the tolerance gained 1 %.
constexpr ExactEffort exact_effort_of(Quality quality) {
    return quality == Quality::fast ? ExactEffort{3, 16, 1e-2} : ExactEffort{6, 48, 1e-3};
}

} // namespace prolate
