// Bounding volumes of the inner nodes of a tree without triangles: for each a small ellipsoid, and the box, that hold
// all ellipsoids below it. Its own, which approximates the solid, does not: those below stick out by a third of its
// size.
#pragma once

#include "src/format.hpp"

#include <cstddef>
#include <span>
#include <vector>

namespace prolate::format {

class Bounding {
public:
    Bounding(std::span<const PackedLevel> levels, const Lattice& lattice);

    /// The node, with the bounding ellipsoid and box in place of its own if it has children. Holds for what decodes.
    /// O(nodes below), for an inner node of a last level but one about a millisecond.
    PackedNode node(size_t level, size_t index) const;

private:
    std::vector<Ellipsoid> below(size_t level, size_t index) const;

    const std::span<const PackedLevel> levels_;
    const Lattice lattice_;
    std::vector<std::vector<size_t>> first_child_; // by levels; one more than there are nodes
    std::vector<std::vector<Ellipsoid>> ellipsoids_;
};

} // namespace prolate::format
