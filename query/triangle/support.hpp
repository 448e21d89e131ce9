// How far the triangles of a leaf reach along a direction, in double precision: the cheapest way to tell that two
// leaves are separated, if one knows along which direction to look.
//
// With n from A to B, of length 1 but for rounding, the triangles are apart by at least
//     n.t - support(A, n) - support(B, -R^T n),     x_A = R x_B + t.
// The terms of its error are those of separation.hpp: there B's corners are turned, here the direction, with the same
// error, so kSeparationMargin S pays for it; S = triangle_reach(A) + triangle_reach(B) + |t|.
#pragma once

#include "src/bytes.hpp"
#include "src/layout.hpp"

#include <prolate/tree.hpp>

#include <glm/vec3.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace prolate::query {

template <class Index>
inline double stored_support(const TreeView& tree, const TriangleRange& range, const glm::dvec3& n) noexcept {
    const std::byte* index = tree.raw().triangles() + size_t{range.first} * 3 * sizeof(Index);
    const std::byte* const end = index + size_t{range.count} * 3 * sizeof(Index);
    double most = -HUGE_VAL;
    for (; index != end; index += sizeof(Index)) {
        const std::byte* const x = tree.raw().vertices() + size_t{load_le<Index>(index)} * kVertexBytes;
        const auto at = [x](size_t k) { return double{load_le<float>(x + k * sizeof(float))}; };
        most = std::max(most, (n.x * at(0) + n.y * at(1)) + n.z * at(2));
    }
    return most;
}
/// The greatest n.x of the corners x of some triangles, body frame.
inline double triangle_support(const TreeView& tree, const TriangleRange& range, const glm::dvec3& n) noexcept {
    return double{tree.scale()} * (tree.vertex_count() <= 0x10000 ? stored_support<uint16_t>(tree, range, n)
                                                                  : stored_support<uint32_t>(tree, range, n));
}

/// Bounds the distance of an exact tree's corners, or of another's ellipsoids, from its frame's origin: they lie in the
/// root's bounding volume.
double triangle_reach(const TreeView& tree) noexcept;

} // namespace prolate::query
