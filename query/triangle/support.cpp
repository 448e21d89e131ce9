#include "query/triangle/support.hpp"
#include "query/ellipsoid/separation.hpp"

namespace prolate::query {

double triangle_reach(const TreeView& tree) noexcept {
    return place(tree.root_bound(), tree.scale()).reach;
}

} // namespace prolate::query
