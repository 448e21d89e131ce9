// All pairs of triangles of two leaves: the float lanes answer for most, the scalar tests for what these leave open.
// Compiled once for each instruction set; include it below <hwy/foreach_target.h>.
#if defined(PROLATE_QUERY_TRIANGLE_LEAVES_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef PROLATE_QUERY_TRIANGLE_LEAVES_INL
#undef PROLATE_QUERY_TRIANGLE_LEAVES_INL
#else
#define PROLATE_QUERY_TRIANGLE_LEAVES_INL
#endif

#include "query/triangle/distance_lanes-inl.hpp"
#include "query/triangle/fours-inl.hpp"
#include "query/triangle/leaves.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <bit>

HWY_BEFORE_NAMESPACE();
namespace prolate::query::HWY_NAMESPACE {

inline LeafResult test_leaf_pair(const TreeView& a, TriangleRange in_a, const TreeView& b, TriangleRange in_b,
                                 const RelativePose& b_to_a, double distance, const LaneMarginFactors& factors) {
    LeafResult result;
    any_four_pair(a, in_a, b, in_b, b_to_a, [&](const FourPair& fours, uint32_t first_a, uint32_t first_b) {
        const LaneMargins margins = fours.margins(distance, factors);
        for (uint32_t pair = 0; pair < fours.pairs(); pair += kLanes) {
            const auto left = std::min<uint32_t>(fours.pairs() - pair, kLanes);
            const LaneVerdicts verdicts =
                test_all_lanes([&](size_t lane) { return fours.lanes_a(pair + lane); },
                               [&](size_t lane) { return fours.lanes_b(pair + lane); }, margins, factors);
            for (uint32_t open = ~verdicts.apart & ((1u << left) - 1); open != 0; open &= open - 1) {
                const auto lane = static_cast<uint32_t>(std::countr_zero(open));
                const uint32_t i = first_a + fours.in_a(pair + lane), j = first_b + fours.in_b(pair + lane);
                if ((verdicts.meet >> lane & 1) == 0) {
                    ++result.exact_tests;
                    if (separated(query::place(a, i), query::place(b, j, b_to_a), distance)) continue;
                }
                result.pair_tests += lane + 1;
                result.meet = true, result.triangle_a = i, result.triangle_b = j;
                return true;
            }
            result.pair_tests += left;
        }
        return false;
    });
    return result;
}

inline uint32_t meetings_of_leaf_pair(const TreeView& a, TriangleRange in_a, const TreeView& b, TriangleRange in_b,
                                      const RelativePose& b_to_a, double distance) {
    static_assert(kFew == kFour);
    const LaneMarginFactors factors;
    uint32_t out = 0;
    any_four_pair(a, in_a, b, in_b, b_to_a, [&](const FourPair& fours, uint32_t first_a, uint32_t first_b) {
        const LaneMargins margins = fours.margins(distance, factors);
        for (uint32_t pair = 0; pair < fours.pairs(); pair += kLanes) {
            const auto left = std::min<uint32_t>(fours.pairs() - pair, kLanes);
            const LaneVerdicts verdicts =
                test_all_lanes([&](size_t lane) { return fours.lanes_a(pair + lane); },
                               [&](size_t lane) { return fours.lanes_b(pair + lane); }, margins, factors);
            uint32_t meet = ~verdicts.apart & ((1u << left) - 1);
            for (uint32_t open = meet & ~verdicts.meet; open != 0; open &= open - 1) {
                const auto lane = static_cast<uint32_t>(std::countr_zero(open));
                const uint32_t i = first_a + fours.in_a(pair + lane), j = first_b + fours.in_b(pair + lane);
                if (separated(query::place(a, i), query::place(b, j, b_to_a), distance)) meet &= ~(1u << lane);
            }
            out |= meet << pair;
        }
        return false;
    });
    return out;
}

inline LeafDistance distance_of_leaf_pair(const TreeView& a, TriangleRange in_a, const TreeView& b, TriangleRange in_b,
                                          const RelativePose& b_to_a, NearLimit limit, glm::dvec3 normal,
                                          const LaneMarginFactors& factors) {
    LeafDistance out;
    any_four_pair(a, in_a, b, in_b, b_to_a, [&](const FourPair& fours, uint32_t first_a, uint32_t first_b) {
        const LaneMargins margins = fours.margins(0, factors);
        const double scale = fours.scale();
        const auto metres = [scale](float x) { return scale > 0 ? double{x} / scale : 0; };
        for (uint32_t pair = 0; pair < fours.pairs(); pair += kLanes) {
            const auto count = std::min<uint32_t>(fours.pairs() - pair, kLanes);
            const TriangleBounds bounds =
                bound_all_lanes([&](size_t lane) { return fours.lanes_a(pair + lane); },
                                [&](size_t lane) { return fours.lanes_b(pair + lane); }, margins,
                                rounded_up(std::min(limit.distance * scale, double{kFarLimit})), count);
            out.pair_tests += count;
            for (uint32_t left = (1u << count) - 1; left != 0;) {
                auto lane = static_cast<uint32_t>(std::countr_zero(left)); // the nearest first
                for (uint32_t rest = left & (left - 1); rest != 0; rest &= rest - 1) {
                    const auto other = static_cast<uint32_t>(std::countr_zero(rest));
                    if (bounds.lower[other] < bounds.lower[lane]) lane = other;
                }
                left &= ~(1u << lane);
                const double lower = metres(bounds.lower[lane]);
                if (lower >= limit.distance) { // so are the rest
                    out.lower = std::min(out.lower, lower);
                    break;
                }
                const uint32_t i = first_a + fours.in_a(pair + lane), j = first_b + fours.in_b(pair + lane);
                const PlacedTriangle x = query::place(a, i), y = query::place(b, j, b_to_a);
                const double along = gap_along(x, y, normal);
                if (along >= limit.distance) {
                    out.lower = std::min(out.lower, along);
                    continue;
                }
                ++out.exact_tests;
                const TriangleDistance exact = distance(x, y);
                out.lower = std::min(out.lower, exact.lower);
                const bool meet = !(exact.lower > 0);
                if (exact.upper < out.nearest.upper || meet) {
                    out.nearest = exact, out.triangle_a = i, out.triangle_b = j;
                    limit.lower(exact.upper);
                    const glm::dvec3 between = exact.on_b - exact.on_a;
                    const double length = glm::length(between);
                    if (length > 0) normal = between / length;
                }
                if (meet) return true;
            }
        }
        return false;
    });
    return out;
}

} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
