#include "src/slab.hpp"

#include "src/bytes.hpp"
#include "src/hull.hpp"

#include <cmath>

namespace prolate {

bool has_slab(const std::byte* record) noexcept {
    return (record[kHullNormal] | record[kHullNormal + 1] | record[kHullNormal + 2]) != std::byte{0};
}

Slab plane_of(const TreeView& tree, uint32_t triangle) noexcept {
    const Triangle t = tree.triangle(triangle);
    const Vec3 p = tree.vertex(t[0]), q = tree.vertex(t[1]), r = tree.vertex(t[2]);
    const double a[3] = {double{q.x} - p.x, double{q.y} - p.y, double{q.z} - p.z};
    const double b[3] = {double{r.x} - p.x, double{r.y} - p.y, double{r.z} - p.z};
    const double n[3] = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
    const double length = std::sqrt((n[0] * n[0] + n[1] * n[1]) + n[2] * n[2]);
    const double scale = tree.scale();
    return {{n[0] / length, n[1] / length, n[2] / length}, {scale * p.x, scale * p.y, scale * p.z}, 0, 0};
}

Slab slab_of(const TreeView& tree, const std::byte* record) noexcept {
    Slab slab = plane_of(tree, load_le<uint32_t>(record + kHullPlane));
    const double scale = tree.scale();
    slab.low = scale * load_le<float>(record + kHullLow), slab.high = scale * load_le<float>(record + kHullHigh);
    return slab;
}

} // namespace prolate
