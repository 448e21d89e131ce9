// A tree upwards from its leaves: those merge that fit together best.
#pragma once

#include "builder/flat_set.hpp"
#include "builder/grown.hpp"

#include <vector>

namespace prolate {

/// A tree whose root is the part of `root` and whose leaves are those of `leaves`, two or more, about as high as the
/// degree needs. Inner nodes are the least ellipsoids around what their leaves hold. Breadth-first.
std::vector<GrownNode> tree_above(const FlatSet& leaves, const Fit& root, const Pieces& pieces,
                                  const FlatSetMaker& sets, uint32_t degree, double min_radius);

} // namespace prolate
