// From the solid to a tree of ellipsoids (paper, Algorithm 1).
//
// A level is optimised as a whole, as a set: start, descent, polish. Levels are grown downwards when levels are asked
// for - the ellipsoids of a level then see those above as limits, see EllipsoidSet - and upwards from the leaves when a
// number of leaves, a tolerance or a distance is. Some solids have no use for a few ellipsoids, but for many: no eight
// ellipsoids fit a shell better than one, and 64 do. There a level is grown downwards and those between upwards; so is
// the whole tree where its limits cost the leaves too much.
//
// Sets are compared by the volume of their union outside the solid. Of a mesh without an inside, that is all of it.
#pragma once

#include "builder/columns.hpp"
#include "builder/polish.hpp"
#include "builder/start.hpp"

#include <prolate/build.hpp>

#include <functional>
#include <vector>

namespace prolate {

/// What a quality stands for.
struct Effort {
    uint32_t resolution; ///< voxels along the longest side, at least
    int starts;          ///< tried for each set; the best one goes on
    int iterations;      ///< of the descent from each start
    int cycles;          ///< shorter descents afterwards, each from the best state so far, that relocate again
    int sweeps;          ///< of the polish
};
Effort effort_of(Quality quality);

/// A node of the tree.
struct GrownNode {
    Fit fit;
    std::vector<uint32_t> pieces; ///< its sub-volume
    uint32_t level = 0;
    uint32_t parent = 0;                       ///< of the root: itself
    uint32_t first_child = 0, child_count = 0; ///< indices into the same array
};

struct GrowOptions {
    BuildOptions build;
    Effort effort;
    double min_radius; ///< metres
    double diagonal;   ///< of the mesh's box, metres
    /// Called now and then with the share of the work done and the number of nodes.
    std::function<void(double, uint32_t)> progress;
};

struct Grown {
    std::vector<GrownNode> nodes; ///< the root first; children of a node are consecutive
    bool goal_reached = true;     ///< false: more ellipsoids made nothing better before the goal was met
    std::vector<double> seconds;  ///< wall time by level
};

/// Everything about the solid that growing needs.
struct Solid {
    Pieces& pieces;      ///< refined along the way
    const Voxels& cells; ///< coarser: to start from
    const DistanceField& field;
    const Columns& columns; ///< to compare covers
    double area;            ///< of the surface, square metres
    /// E_vol of an ellipsoid and its gradient, in closed form; empty for the voxel method.
    std::function<EllipsoidVolume(const Fit&)> outside;
    /// One-sided Hausdorff distance of a cover, metres.
    std::function<double(std::span<const Ellipsoid>)> distance;
};

/// The same for any number of threads. After a cancellation the result is incomplete.
Grown grow(const Solid& solid, const GrowOptions& options);

} // namespace prolate
