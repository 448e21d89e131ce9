#include "query/node/tree_side.hpp"

namespace prolate::query {

TreeSide tree_side(const TreeView& tree, uint32_t max_level) noexcept {
    const uint32_t last = tree.level_count() - 1;
    return {.tree = tree,
            .lattice = tree.raw().lattice(),
            .blocks = tree.raw().block(0),
            .bounding_blocks = tree.raw().bounding_block(0),
            .hulls = tree.has_triangles() ? tree.raw().hull(0) : nullptr,
            .has_slabs = tree.raw().has_slabs(),
            .leaves_from = tree.first_slot(last),
            .limit_from = max_level < last ? tree.first_slot(max_level) : UINT32_MAX};
}

} // namespace prolate::query
