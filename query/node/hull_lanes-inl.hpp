// Hulls of exact trees' inner nodes (src/hull.hpp) along the direction that a lane found: a closer look at a pair of
// nodes that an ellipsoid, and boxes, could not separate. Per SIMD target; include it below hwy/foreach_target.h.
// The tests have a scalar reference.
//
// With the terms of lanes-inl.hpp the nodes are separated if
//     p - A - B > 0,   A = max v.w_i + share |v|, v = L1^T n,   B likewise with v = -L2^T n
// for what the two hulls reach from their ellipsoids' centers: A <= a and B <= b but for rounding. |w| <= 1, so
//   A         v is wrong by 14 u |n| |L1| as in a; 3 products and 2 sums, two rounded factors, their products and the
//             last sum add 12 u |n| |L1|; B likewise
//   gap + (a - A) + (b - B)      4 u |n| (|r| + |L1| + |L2|)
// which the margin in `gap`, 32 u of each, pays for. The share of the ellipsoid is rounded up, and the points as stored
// are exact: the builder measures what sticks out of their hull.
//
// Cost: about 40 vector operations a hull.
#include "query/node/lanes-inl.hpp"

// clang-format off
#if defined(PROLATE_QUERY_HULL_LANES_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef PROLATE_QUERY_HULL_LANES_INL_HPP
#undef PROLATE_QUERY_HULL_LANES_INL_HPP
#else
#define PROLATE_QUERY_HULL_LANES_INL_HPP
#endif
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace prolate::query::HWY_NAMESPACE {

/// A hull record (src/hull.hpp), or none.
struct HullRows {
    Float3 points[kHullPoints / kFloatLanes];
    float share; ///< 0: nothing is known

    /// How far what it describes reaches from its node's center along n: v = {x, y, z} = L^T n, width = |v|. If nothing
    /// is known, `width`.
    HWY_INLINE float reach(float x, float y, float z, float width) const {
        const Float3 v{set(x), set(y), set(z)};
        Float most = dot(points[0], v);
        for (size_t i = 1; i < kHullPoints / kFloatLanes; ++i) most = max(most, dot(points[i], v));
        const float reach =
            hn::GetLane(hn::MaxOfLanes(FloatTag(), most)) * kPerHullUnit + share * kPerHullShare * width;
        return share > 0 ? reach : width;
    }
};
/// `hull` may be null.
HWY_INLINE HullRows load_hull(const std::byte* hull) {
    HullRows out{};
    if (hull == nullptr) return out;
    for (size_t i = 0; i < kHullPoints / kFloatLanes; ++i) {
        const auto row = [&](size_t k) {
            return load_integers<int8_t>(hull + kHullPoint + kHullPoints * k + kFloatLanes * i);
        };
        out.points[i] = {row(0), row(1), row(2)};
    }
    out.share = static_cast<float>(load_le<uint8_t>(hull + kHullShare));
    return out;
}

/// The reach of a record.
HWY_INLINE float hull_reach(const std::byte* hull, float x, float y, float z, float width) {
    return load_hull(hull).reach(x, y, z, width);
}

} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif // PROLATE_QUERY_HULL_LANES_INL_HPP
