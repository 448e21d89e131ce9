// The inner cover: ellipsoids proved to lie inside the solid, as a file of its own.
#pragma once

#include <prolate/build.hpp>

#include <cstddef>
#include <functional>
#include <vector>

namespace prolate {

struct InnerOptions {
    uint32_t count; ///< of leaves, at most
    uint32_t degree;
    double margin; ///< metres; no point within it of a triangle may lie in an ellipsoid
    std::function<void(double)> progress;
};

/// Appends the inner cover of a closed `mesh` to the tree's whole file, as its section `INNR`. `tree` says how that was
/// baked. The inner nodes are the largest of the leaves below them. The same for any number of threads. Fails with
/// bad_mesh if the solid is too thin, or has a size that the format cannot hold.
Result<void> append_inner_cover(std::vector<std::byte>& file, MeshView mesh, const BakeInfo& tree,
                                const InnerOptions& options);

} // namespace prolate
