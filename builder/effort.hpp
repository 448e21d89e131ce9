// What a quality stands for, in the bake.
#pragma once

#include <prolate/tree.hpp>

#include <cstdint>

namespace prolate {

struct Effort {
    uint32_t resolution;       ///< voxels along the longest side, at least
    int starts;                ///< tried for each set; the best one goes on
    int iterations;            ///< of the descent from each start
    int cycles;                ///< shorter descents afterwards, each from the best state so far, that relocate again
    int sweeps;                ///< of the polish
    double distance_tolerance; ///< of measured distances: of the largest one, in diagonals
    uint32_t distance_samples; ///< for their mean and percentile
};

constexpr Effort effort_of(Quality quality) {
    switch (quality) {
    case Quality::fast:
        return {64, 1, 300, 0, 4, 1e-3, 2000};
    case Quality::normal:
        return {96, 2, 500, 0, 8, 1e-4, 8000};
    case Quality::best:
        break;
    }
    return {192, 3, 1500, 2, 12, 1e-4, 32000};
}

} // namespace prolate
