// Proof that the bounding volumes of a tree without triangles hold what queries look for below them.
#pragma once

#include <prolate/tree.hpp>

#include <cstdint>
#include <optional>

namespace prolate {

/// A node whose ellipsoid or box, as queries take them (TreeView::bounding_block), does not hold all leaf ellipsoids
/// and others below it, or of a leaf its own: the first; none if all do. A prefix of an exact tree has no such volumes.
std::optional<uint32_t> find_unbounded(const TreeView& tree);

} // namespace prolate
