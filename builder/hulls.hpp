// Hulls of the inner nodes of exact trees: a few points whose convex hull, with a share of the node's ellipsoid added,
// holds all triangles below the node. It fits far closer than the ellipsoid, and its support is quick to find.
#pragma once

#include "builder/eigen.hpp"
#include "src/hull.hpp"

#include <prolate/tree.hpp>

#include <array>
#include <cstddef>
#include <vector>

namespace prolate {

/// The hull records (src/FORMAT.md) of an exact tree, one for each block; the same for any number of threads.
std::vector<std::byte> hulls_of(const TreeView& tree);

/// A record, decoded: unit-ball coordinates of the node (Fit::radial).
struct Hull {
    explicit Hull(const std::byte* record);
    /// An upper bound on the distance of w from the hull of the points; close to it if it is above `enough`.
    double distance(const Vec& w, double enough) const;

    std::array<Vec, kHullPoints> points;
    double share; ///< of the ellipsoid; 0: nothing is known
};

} // namespace prolate
