// From flat sets, one a level, to a tree: who is below whom.
//
// Queries descend by bounding volumes, which hold all ellipsoids below a node (src/bounding.hpp), and a cut at a level
// covers by itself. So any tree is right; a good one keeps together what is near, for small bounding volumes. From the
// root downwards, the ellipsoids of all deeper levels are shared between a node's children, none of which takes more
// than the degree allows: in turn, each goes to a child by the likelihood that a Gaussian around what the child has
// gives it, and the Gaussians follow (expectation maximisation with hard assignments, Celeux and Govaert 1992). That
// makes the product of the volumes about what the children have small.
#pragma once

#include "builder/flat_set.hpp"
#include "builder/grown.hpp"

#include <span>
#include <vector>

namespace prolate {

/// A tree of `sets`, breadth-first: the first one's only part is the root, and each level has as many parts as the one
/// above at least, and at most `degree` times as many. Takes the sets' pieces.
std::vector<GrownNode> stack(std::span<FlatSet> sets, uint32_t degree);

} // namespace prolate
