#include "query/triangle/support.hpp"
#include "query/ellipsoid/separation.hpp"
#include "src/bytes.hpp"
#include "src/layout.hpp"

#include <algorithm>
#include <cmath>

namespace prolate::query {
namespace {

template <class Index> double support_of(const TreeView& tree, const TriangleRange& range, const glm::dvec3& n) {
    const std::byte* index = tree.raw().triangles() + size_t{range.first} * 3 * sizeof(Index);
    double most = -HUGE_VAL;
    for (uint32_t i = 0; i < 3 * range.count; ++i, index += sizeof(Index)) {
        const std::byte* const x = tree.raw().vertices() + size_t{load_le<Index>(index)} * kVertexBytes;
        const auto at = [x](size_t k) { return double{load_le<float>(x + k * sizeof(float))}; };
        most = std::max(most, (n.x * at(0) + n.y * at(1)) + n.z * at(2));
    }
    return most * double{tree.scale()};
}

} // namespace

double triangle_support(const TreeView& tree, const TriangleRange& range, const glm::dvec3& n) noexcept {
    return tree.vertex_count() <= 0x10000 ? support_of<uint16_t>(tree, range, n) : support_of<uint32_t>(tree, range, n);
}

double triangle_reach(const TreeView& tree) noexcept {
    return place(tree.root_bound(), tree.scale()).reach;
}

} // namespace prolate::query
