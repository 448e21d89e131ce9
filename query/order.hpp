// Swapped arguments must give the same answer in spite of rounding, so each query of two bodies works in one fixed
// order of them.
#pragma once

#include <prolate/tree.hpp>
#include <prolate/types.hpp>

#include <array>
#include <bit>
#include <cstdint>
#include <cstring>

namespace prolate::query {

/// Of a Pose or Motion, which are floats throughout.
template <class Placement> bool before(const Placement& x, const Placement& y) {
    using Bits = std::array<uint32_t, sizeof(Placement) / sizeof(float)>;
    return std::bit_cast<Bits>(x) < std::bit_cast<Bits>(y);
}
inline bool before(const TreeView& x, const TreeView& y) {
    const auto p = x.bytes(), q = y.bytes();
    if (p.size() != q.size()) return p.size() < q.size();
    return p.data() != q.data() && std::memcmp(p.data(), q.data(), p.size()) < 0;
}
/// Is body `b` to be taken first?
template <class Placement>
bool must_swap(const TreeView& a, const Placement& place_a, const TreeView& b, const Placement& place_b) {
    return place_a == place_b ? before(b, a) : before(place_b, place_a);
}

} // namespace prolate::query
