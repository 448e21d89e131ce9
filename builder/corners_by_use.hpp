// The corners of parts of a mesh that are consecutive in an order of its triangles, as the nodes of a tree are.
#pragma once

#include "builder/eigen.hpp"

#include <prolate/mesh.hpp>

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace prolate {

/// Numbers vertices as triangles first use them: then those of a part are some that follow one another, and a few along
/// its border that triangles before it have used. Thread-safe once it is made. O(triangles + vertices) to make.
class CornersByUse {
public:
    /// `triangles` in the order that parts refer to.
    CornersByUse(std::span<const Triangle> triangles, std::span<const Vec3> vertices);
    /// Corners of the triangles begin ... end - 1, each once. Linear but for sorting those along the border.
    std::vector<Vec> of(uint32_t begin, uint32_t end) const;

private:
    std::vector<Vec> vertices_;
    std::vector<Triangle> triangles_; // of these
    std::vector<uint32_t> used_;      // vertices used by the triangles before each, and before the end
};

} // namespace prolate
