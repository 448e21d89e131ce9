// Where does a thin ray hit four triangles? In double precision, by the scalar hit() (ray.cpp), operation by operation,
// so their rounding is worked out there; only tau is that of the whole tree, and one bound serves all edges, which are
// no less than a triangle's and an edge's. What is certain with them hit() says as well, to the bit; what lies in doubt
// hit() decides. So these lanes change no answer.
// Compiled once for each instruction set; include it below <hwy/foreach_target.h>.
//
// Cost: about 60 loads and shuffles and 130 operations for four triangles. (One in plain code takes longer.)
#if defined(PROLATE_QUERY_RAY_TRIANGLE_LANES_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef PROLATE_QUERY_RAY_TRIANGLE_LANES_INL
#undef PROLATE_QUERY_RAY_TRIANGLE_LANES_INL
#else
#define PROLATE_QUERY_RAY_TRIANGLE_LANES_INL
#endif

#include "query/raycast/ray.hpp"
#include "query/simd/vector-inl.hpp"
#include "src/bytes.hpp"
#include "src/layout.hpp"

#include <prolate/tree.hpp>

#include <bit>
#include <cstddef>
#include <cstdint>
#include <limits>

HWY_BEFORE_NAMESPACE();
namespace prolate::query::HWY_NAMESPACE {

/// Triangles of a tree, one a lane.
struct RayTriangles {
    static constexpr size_t kLanes = 4;
    uint32_t index[2 * kLanes] = {};   ///< the first of them; there is room to write four more
    alignas(16) float rows[9][kLanes]; ///< of load_corners(): coordinate i % 3 of corner i / 3, as stored
};

HWY_INLINE void transpose_corners(const std::byte* const (&from)[4], float (*rows)[4]) {
#if HWY_TARGET == HWY_SCALAR
    for (size_t i = 0; i < 3; ++i)
        for (size_t lane = 0; lane < 4; ++lane) rows[i][lane] = load_le<float>(from[lane] + sizeof(float) * i);
#else
    const QuadTag d;
    // Behind the vertices there are at least the 6 bytes of a triangle.
    const auto corner = [&](size_t lane) { return hn::BitCast(d, load_stored<uint32_t>(d, from[lane])); };
    const Quad first = corner(0), second = corner(1), third = corner(2), fourth = corner(3);
    const Quad low_odd = hn::InterleaveLower(d, first, third), low_even = hn::InterleaveLower(d, second, fourth);
    const Quad high_odd = hn::InterleaveUpper(d, first, third), high_even = hn::InterleaveUpper(d, second, fourth);
    store(hn::InterleaveLower(d, low_odd, low_even), rows[0]);
    store(hn::InterleaveUpper(d, low_odd, low_even), rows[1]);
    store(hn::InterleaveLower(d, high_odd, high_even), rows[2]);
#endif
}

template <class Index> HWY_INLINE void load_corners(const TreeView& tree, RayTriangles& triangles) {
    const std::byte* const vertices = tree.raw().vertices();
    for (size_t corner = 0; corner < 3; ++corner) {
        const auto at = [&](size_t lane) {
            const std::byte* const index =
                tree.raw().triangles() + (size_t{triangles.index[lane]} * 3 + corner) * sizeof(Index);
            return vertices + size_t{load_le<Index>(index)} * kVertexBytes;
        };
        transpose_corners({at(0), at(1), at(2), at(3)}, triangles.rows + 3 * corner);
    }
}

struct FourHits {
    double t;      ///< of the placed ray, the first certain hit, as hit() says; infinite if there is none
    uint32_t lane; ///< of that hit
    uint32_t open; ///< bit i: for hit() to decide
};

using FourTag = hn::CappedTag<double, RayTriangles::kLanes>;
using Four = hn::Vec<FourTag>;

/// Of the triangles from lane `at` on, the corners as the ray sees them.
struct SeenCorners {
    Four x[3], y[3], z[3];
};
HWY_INLINE void see(const RayTriangles& triangles, size_t at, const PlacedRay& ray, double scale, SeenCorners& out) {
    const FourTag d;
    const double origin[] = {ray.origin.x, ray.origin.y, ray.origin.z}; // glm's own [] branches
    const RayShear& shear = ray.shear;
    const auto relative = [&](size_t corner, size_t axis, double sign) { // times the sign, which costs no rounding
        const auto stored = hn::Load(hn::Rebind<float, FourTag>(), triangles.rows[3 * corner + axis] + at);
        return hn::PromoteTo(d, stored) * hn::Set(d, scale * sign) - hn::Set(d, origin[axis] * sign);
    };
    for (size_t c = 0; c < 3; ++c) {
        out.z[c] = relative(c, shear.k, shear.sign);
        out.x[c] = relative(c, shear.i, 1) - hn::Set(d, shear.shear[0] * shear.sign) * out.z[c];
        out.y[c] = relative(c, shear.j, 1) - hn::Set(d, shear.shear[1] * shear.sign) * out.z[c];
    }
}

/// Hits at t <= `farthest`. `reach`: at least the triangles'.
HWY_INLINE FourHits hit_four(const TreeView& tree, RayTriangles& triangles, const PlacedRay& ray, double reach,
                             double farthest) {
    if (index_bytes(tree.vertex_count()) == sizeof(uint16_t))
        load_corners<uint16_t>(tree, triangles);
    else
        load_corners<uint32_t>(tree, triangles);
    const FourTag d;
    const auto set = [&](double x) { return hn::Set(d, x); };
    const Four zero = set(0), never = set(std::numeric_limits<double>::infinity()),
               tau = set(kRayMargin * (ray.reach + reach)), end = set(farthest * ray.shear.per_t);
    alignas(32) double hit_at[RayTriangles::kLanes];
    Four first_hit = never;
    FourHits out{.t = std::numeric_limits<double>::infinity(), .lane = 0, .open = 0};
    bool some_certain = false; // perhaps
    for (size_t at = 0; at < RayTriangles::kLanes; at += hn::MaxLanes(d)) {
        SeenCorners seen;
        see(triangles, at, ray, double{tree.scale()}, seen);
        const auto& [x, y, z] = seen;
        // Min and Max of NaN make comparisons false here, or tell of the others.
        const auto least = [](const Four(&v)[3]) { return hn::Min(hn::Min(v[0], v[1]), v[2]); };
        const auto most = [](const Four(&v)[3]) { return hn::Max(hn::Max(v[0], v[1]), v[2]); };
        const Four low = least(z), high = most(z);
        const Four left = least(x), right = most(x), bottom = least(y), top = most(y);
        const Four beside = hn::Max(hn::Max(left, bottom), hn::Neg(hn::Min(right, top)));
        // No corner is farther from the axis, in either coordinate.
        const Four widest = hn::Max(hn::Max(right, top), hn::Neg(hn::Min(left, bottom)));
        Four weight[3];
        for (size_t c = 0; c < 3; ++c) weight[c] = x[(c + 1) % 3] * y[(c + 2) % 3] - y[(c + 1) % 3] * x[(c + 2) % 3];
        const Four bound = set(4) * tau * widest; // no less than that of each edge
        const Four least_weight = least(weight), most_weight = most(weight);
        const auto some_above = most_weight > bound, some_below = hn::Neg(least_weight) > bound;
        const auto missed =
            hn::Or(hn::Or(beside > tau, hn::And(some_above, some_below)), hn::Or(hn::Neg(high) > tau, low > end + tau));
        hn::Store(never, d, hit_at + at);
        if (hn::AllTrue(d, missed)) continue; // as every other time
        const auto one_sided = hn::Or(least_weight > bound, hn::Neg(most_weight) > bound);
        // All weights have the same sign for certain; it cancels.
        const Four mean =
                       (weight[0] * z[0] + weight[1] * z[1] + weight[2] * z[2]) / (weight[0] + weight[1] + weight[2]),
                   depth = hn::Min(hn::Max(mean, low), high);
        const auto certain = hn::AndNot(missed, hn::And(one_sided, hn::And(depth >= zero, depth <= end)));
        const Four t = hn::Min(depth / set(ray.shear.per_t), set(ray.length));
        const Four hit = hn::IfThenElse(certain, t, never);
        hn::Store(hit, d, hit_at + at);
        first_hit = hn::Min(first_hit, hit);
        some_certain = true;
        out.open |= bits(d, hn::Not(hn::Or(certain, missed))) << at;
    }
    if (!some_certain) return out;
    first_hit = hn::MinOfLanes(d, first_hit);
    uint32_t first = 0;
    for (size_t at = 0; at < RayTriangles::kLanes; at += hn::MaxLanes(d))
        first |= bits(d, hn::Load(d, hit_at + at) == first_hit) << at;
    out.t = hn::GetLane(first_hit), out.lane = static_cast<uint32_t>(std::countr_zero(first)) % RayTriangles::kLanes;
    return out;
}

} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
