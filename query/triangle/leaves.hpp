// Two leaves of exact trees: does a triangle of one meet a triangle of the other, and how far are they apart? Float
// kernels answer for eight pairs at once; what they leave open the scalar tests of separation.hpp and
// distance.hpp decide.
#pragma once

#include "query/triangle/distance.hpp"
#include "query/triangle/lanes.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>

namespace prolate::query {

struct LeafResult {
    bool meet = false;                        // some two are not certainly more than `distance` apart
    uint32_t triangle_a = 0, triangle_b = 0;  // the first such two
    uint32_t pair_tests = 0, exact_tests = 0; // pairs up to these, and those of them that took the scalar test
};
/// Both trees have triangles, the ranges are not empty. Pairs are taken by fours of A's triangles, and for each by
/// fours of B's; among these in the order of B's, and of A's for each. `distance` >= 0.
LeafResult test_leaves(const TreeView& a, TriangleRange in_a, const TreeView& b, TriangleRange in_b,
                       const RelativePose& b_to_a, double distance = 0, const LaneMarginFactors& factors = {}) noexcept;

/// All such pairs of two leaves of at most kFew triangles each: bit i + in_a.count j, of A's i-th and B's j-th.
inline constexpr uint32_t kFew = 4;
uint32_t meetings_of_leaves(const TreeView& a, TriangleRange in_a, const TreeView& b, TriangleRange in_b,
                            const RelativePose& b_to_a, double distance) noexcept;

struct LeafDistance {
    double lower = std::numeric_limits<double>::infinity();                       // no two triangles are nearer
    TriangleDistance nearest{0, std::numeric_limits<double>::infinity(), {}, {}}; // of the nearest two that were found
    uint32_t triangle_a = 0, triangle_b = 0;                                      // these
    uint32_t pair_tests = 0, exact_tests = 0;
};
/// Which pairs matter.
struct NearLimit {
    double distance = std::numeric_limits<double>::infinity(); // those that are nearer, metres,
    double absolute = 0, relative = 0; // and than the nearest so far by this, or this share of its distance,
    double radii = 0;                  // which these count for nothing in, unless it is less
    /// Stays above 0: pairs that may meet always matter.
    void lower(double upper) {
        const double improving = upper - std::max(absolute, relative * (upper > radii ? upper - radii : upper));
        distance = std::min(distance, std::max(improving, std::numeric_limits<double>::min()));
    }
};
/// Pairs that do not matter may be left out: if all are, nearest.upper is infinite. Ends with the first pair whose
/// lower bound is 0, which is then `nearest`. `normal`, a unit vector or 0, in A's frame: along it the triangles may
/// well be apart.
LeafDistance distance_of_leaves(const TreeView& a, TriangleRange in_a, const TreeView& b, TriangleRange in_b,
                                const RelativePose& b_to_a, NearLimit limit = {}, const glm::dvec3& normal = {0, 0, 0},
                                const LaneMarginFactors& factors = {}) noexcept;

/// The kernels alone, for the tests and benchmarks: a call a vector costs more than they do.
LaneVerdicts test_lanes(const TriangleRows& a, const TriangleRows& b, const LaneMargins& margins,
                        const LaneMarginFactors& factors) noexcept;
TriangleBounds bound_lanes(const TriangleRows& a, const TriangleRows& b, const LaneMargins& margins,
                           float limit) noexcept;

} // namespace prolate::query
