#include "query/node/tree_side.hpp"

namespace prolate::query {

TreeSide tree_side(const TreeView& tree, uint32_t max_level) noexcept {
    const uint32_t last = tree.level_count() - 1;
    const uint32_t limit = max_level < last ? tree.first_slot(max_level) : UINT32_MAX;
    return {tree, tree.lattice(), tree.first_slot(last), limit};
}

} // namespace prolate::query
