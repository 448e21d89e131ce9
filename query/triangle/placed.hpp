// Triangles of a tree in the frame of one body, in double precision. What their rounding costs is worked out in
// query/triangle/separation.hpp.
#pragma once

#include "query/ellipsoid/placed.hpp"
#include "src/bytes.hpp"
#include "src/layout.hpp"

#include <prolate/tree.hpp>

#include <cstddef>
#include <cstdint>

namespace prolate::query {

/// TreeView::vertex(), inline.
inline glm::dvec3 stored_vertex(const TreeView& tree, uint32_t vertex) {
    const std::byte* const at = tree.raw().vertices() + size_t{vertex} * kVertexBytes;
    return {load_le<float>(at), load_le<float>(at + 4), load_le<float>(at + 8)};
}
/// A vertex as queries see it, metres: exact, whatever the tree's scale.
inline glm::dvec3 position(const TreeView& tree, uint32_t vertex) {
    return stored_vertex(tree, vertex) * double{tree.scale()};
}

/// A triangle placed in A's frame.
struct PlacedTriangle {
    glm::dvec3 corner[3];
    double reach; // largest |corner|, and |t2 - t1| if of body B: its share of S
};
PlacedTriangle place(const TreeView& tree, uint32_t triangle) noexcept;                             // of body A
PlacedTriangle place(const TreeView& tree, uint32_t triangle, const RelativePose& b_to_a) noexcept; // of body B

/// Of any length; outwards, if the triangle belongs to a closed mesh.
glm::dvec3 face_normal(const PlacedTriangle& triangle) noexcept;
/// The greatest n.x of its points x.
double support(const PlacedTriangle& triangle, const glm::dvec3& n) noexcept;

} // namespace prolate::query
