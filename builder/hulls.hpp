// Hulls of the inner nodes of exact trees: a few points whose convex hull, with a share of the node's ellipsoid added,
// holds all triangles below the node. It fits far closer than the ellipsoid, and its support is quick to find.
#pragma once

#include "builder/effort.hpp"
#include "builder/eigen.hpp"
#include "builder/hull_distance.hpp"

#include "src/hull.hpp"

#include <prolate/tree.hpp>

#include <array>
#include <cstddef>
#include <vector>

namespace prolate {

/// The hull records (src/FORMAT.md) of an exact tree, one for each block; the same for any number of threads.
std::vector<std::byte> hulls_of(const TreeView& tree, const ExactEffort& effort);

/// A record, decoded.
class Hull {
public:
    explicit Hull(const std::byte* record);
    /// HullDistance of w, in unit-ball coordinates of the node (Fit::radial).
    double distance(const Vec& w, double enough);

    double share; ///< of the ellipsoid; 0: nothing is known

private:
    HullDistance points_; // in units of 1 / kHullUnit, which floats hold
    // Corners that are asked for one after the other are often near the same faces, or those of a moment ago.
    Combination last_;
    std::array<Simplex, 4> near_;
    size_t oldest_ = 0;
};

} // namespace prolate
