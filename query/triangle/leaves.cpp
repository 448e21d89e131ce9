#include "query/simd/targets.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "query/triangle/leaves.cpp"
#include <hwy/foreach_target.h>

#include "query/triangle/leaves-inl.hpp"

#if HWY_ONCE
namespace prolate::query {

HWY_EXPORT(test_rows);
HWY_EXPORT(test_leaf_pair);
HWY_EXPORT(meetings_of_leaf_pair);
HWY_EXPORT(bound_rows);
HWY_EXPORT(distance_of_leaf_pair);

LaneVerdicts test_lanes(const TriangleRows& a, const TriangleRows& b, const LaneMargins& margins,
                        const LaneMarginFactors& factors) noexcept {
    return HWY_DYNAMIC_DISPATCH(test_rows)(a, b, margins, factors);
}

LeafResult test_leaves(const TreeView& a, TriangleRange in_a, const TreeView& b, TriangleRange in_b,
                       const RelativePose& b_to_a, double distance, const LaneMarginFactors& factors) noexcept {
    return HWY_DYNAMIC_DISPATCH(test_leaf_pair)(a, in_a, b, in_b, b_to_a, distance, factors);
}

uint32_t meetings_of_leaves(const TreeView& a, TriangleRange in_a, const TreeView& b, TriangleRange in_b,
                            const RelativePose& b_to_a, double distance) noexcept {
    return HWY_DYNAMIC_DISPATCH(meetings_of_leaf_pair)(a, in_a, b, in_b, b_to_a, distance);
}

TriangleBounds bound_lanes(const TriangleRows& a, const TriangleRows& b, const LaneMargins& margins,
                           float limit) noexcept {
    return HWY_DYNAMIC_DISPATCH(bound_rows)(a, b, margins, limit);
}

LeafDistance distance_of_leaves(const TreeView& a, TriangleRange in_a, const TreeView& b, TriangleRange in_b,
                                const RelativePose& b_to_a, NearLimit limit, const glm::dvec3& normal,
                                const LaneMarginFactors& factors) noexcept {
    return HWY_DYNAMIC_DISPATCH(distance_of_leaf_pair)(a, in_a, b, in_b, b_to_a, limit, normal, factors);
}

} // namespace prolate::query
#endif
