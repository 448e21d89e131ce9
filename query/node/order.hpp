// Swapped arguments must give the same answer in spite of rounding, and different queries the same verdict, so all
// queries of two bodies work in one fixed order of them. It depends on the trees alone if these differ: poses change
// from step to step, and what follows from the order should not.
#pragma once

#include <prolate/tree.hpp>
#include <prolate/types.hpp>

#include <algorithm>
#include <array>
#include <bit>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <cstring>

namespace prolate::query {

/// Of a Pose or Motion, which are floats throughout.
template <class Placement> std::strong_ordering compare(const Placement& x, const Placement& y) {
    using Bits = std::array<uint32_t, sizeof(Placement) / sizeof(float)>;
    return std::bit_cast<Bits>(x) <=> std::bit_cast<Bits>(y);
}
/// By size, and by their first bytes, at most `most` of them.
inline std::strong_ordering compare(const TreeView& x, const TreeView& y, size_t most) {
    const auto p = x.bytes(), q = y.bytes();
    if (p.size() != q.size()) return p.size() <=> q.size();
    if (p.data() == q.data()) return std::strong_ordering::equal;
    return std::memcmp(p.data(), q.data(), std::min(p.size(), most)) <=> 0;
}
inline const Pose& start_of(const Pose& pose) {
    return pose;
}
template <class Motion> const Pose& start_of(const Motion& motion) {
    return motion.start;
}
/// Is body `b` to be taken first? The header, which has hashes of the rest, tells most trees apart; to read on would
/// take long for copies of one.
template <class Placement>
bool must_swap(const TreeView& a, const Placement& place_a, const TreeView& b, const Placement& place_b) {
    constexpr size_t kHeader = 256;
    if (const auto order = compare(b, a, kHeader); order != 0) return order < 0;
    if (const auto order = compare(start_of(place_b), start_of(place_a)); order != 0) return order < 0;
    if (const auto order = compare(b, a, SIZE_MAX); order != 0) return order < 0;
    return compare(place_b, place_a) < 0;
}

} // namespace prolate::query
