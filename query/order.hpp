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

inline bool before(const Pose& x, const Pose& y) {
    using Bits = std::array<uint32_t, 7>;
    return std::bit_cast<Bits>(x) < std::bit_cast<Bits>(y);
}
inline bool before(const TreeView& x, const TreeView& y) {
    const auto p = x.bytes(), q = y.bytes();
    if (p.size() != q.size()) return p.size() < q.size();
    return p.data() != q.data() && std::memcmp(p.data(), q.data(), p.size()) < 0;
}
/// Is body `b` to be taken first?
inline bool must_swap(const TreeView& a, const Pose& pose_a, const TreeView& b, const Pose& pose_b) {
    return pose_a == pose_b ? before(b, a) : before(pose_b, pose_a);
}

} // namespace prolate::query
