// What growing makes: a tree of ellipsoids with the pieces that each stands for.
#pragma once

#include "builder/fit.hpp"

#include <cstdint>
#include <vector>

namespace prolate {

/// A node of the tree. The nodes of a level, and the leaves above it, together have all pieces.
struct GrownNode {
    Fit fit;
    std::vector<uint32_t> pieces; ///< that it holds and stands for
    uint32_t level = 0;
    uint32_t first_child = 0, child_count = 0; ///< indices into the same array
};

} // namespace prolate
