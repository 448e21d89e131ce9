// The canonical order of two bodies. collide(a, b) and collide(b, a) must agree bit for bit in spite of rounding, and
// different queries must give the same verdict, so every query of two bodies first puts them in one order, and
// exchanges them in its answer if need be. The order depends on the trees alone if these differ: poses change from step
// to step, and what follows from the order should not.
#pragma once

#include <prolate/collide.hpp>
#include <prolate/tree.hpp>
#include <prolate/types.hpp>

#include <algorithm>
#include <array>
#include <bit>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <utility>

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
/// Two bodies in their canonical order, each with its Pose or Motion.
template <class Placement> struct OrderedBodies {
    const TreeView &a, &b;
    const Placement &place_a, &place_b;
    bool exchanged; ///< the caller has them the other way round
};
/// All arguments must outlive what it returns. The header of a file, which has hashes of the rest, tells most trees
/// from each other; to read on would take long for copies of one.
template <class Placement>
OrderedBodies<Placement> in_canonical_order(const TreeView& a, const Placement& place_a, const TreeView& b,
                                            const Placement& place_b) {
    const auto order = [&] {
        constexpr size_t kHeader = 256;
        if (const auto by_header = compare(a, b, kHeader); by_header != 0) return by_header;
        if (a.scale() != b.scale())
            return a.scale() < b.scale() ? std::strong_ordering::less : std::strong_ordering::greater;
        if (const auto by_start = compare(start_of(place_a), start_of(place_b)); by_start != 0) return by_start;
        if (const auto by_bytes = compare(a, b, SIZE_MAX); by_bytes != 0) return by_bytes;
        return compare(place_a, place_b);
    }();
    if (order > 0) return {.a = b, .b = a, .place_a = place_b, .place_b = place_a, .exchanged = true};
    return {.a = a, .b = b, .place_a = place_a, .place_b = place_b, .exchanged = false};
}

/// A pair of nodes as the other order has it.
inline MeetingPair exchanged(const MeetingPair& pair) {
    return {pair.node_b, pair.node_a, pair.triangle_b, pair.triangle_a};
}
/// Exchanges the bodies of a DistanceResult or SweepResult.
template <class Result> void exchange_bodies(Result& result) {
    result.pair = exchanged(result.pair);
    std::swap(result.point_a, result.point_b);
    result.normal = {-result.normal.x, -result.normal.y, -result.normal.z};
}

} // namespace prolate::query
