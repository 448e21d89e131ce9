// Which of four triangles may a thin ray hit? In double precision, by the first tests of the scalar hit() (ray.cpp),
// operation by operation, so their rounding is worked out there; only tau is that of the whole tree, which is no less
// than a triangle's. What is left open hit() decides, so these lanes change no answer. Compiled once for each
// instruction set; include it below <hwy/foreach_target.h>.
//
// Cost: about 100 operations for four triangles. (Most leaves have one or two, and still this takes two thirds of what
// plain code takes for the first of them.)
#if defined(PROLATE_QUERY_RAY_TRIANGLE_LANES_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef PROLATE_QUERY_RAY_TRIANGLE_LANES_INL
#undef PROLATE_QUERY_RAY_TRIANGLE_LANES_INL
#else
#define PROLATE_QUERY_RAY_TRIANGLE_LANES_INL
#endif

#include "query/raycast/ray.hpp"
#include "query/triangle/fours-inl.hpp"

#include <prolate/tree.hpp>

#include <cstdint>

HWY_BEFORE_NAMESPACE();
namespace prolate::query::HWY_NAMESPACE {

/// Bit i: triangle `first` + i, of `count` <= kFour, may be hit at t <= `farthest`. `reach`: at least the triangles'.
HWY_INLINE uint32_t may_hit(const TreeView& tree, uint32_t first, uint32_t count, const PlacedRay& ray, double reach,
                            double farthest) {
    using Tag = hn::CappedTag<double, kFour>;
    using Lanes = hn::Vec<Tag>;
    const Tag d;
    const FourTriangles four(tree, first, count);
    const auto set = [&](double x) { return hn::Set(d, x); };
    const Lanes zero = set(0), scale = set(double{tree.scale()}), tau = set(kRayMargin * (ray.reach + reach)),
                end = set(farthest * ray.shear.per_t);
    uint32_t open = 0;
    for (size_t at = 0; at < kFour; at += hn::MaxLanes(d)) {
        Lanes x[3], y[3], z[3];
        for (size_t c = 0; c < 3; ++c) {
            const auto relative = [&](size_t axis) {
                const auto stored = hn::Load(hn::Rebind<float, Tag>(), four.stored(3 * c + axis) + at);
                return hn::PromoteTo(d, stored) * scale - set(ray.origin[static_cast<glm::length_t>(axis)]);
            };
            const Lanes depth = relative(ray.shear.k);
            x[c] = relative(ray.shear.i) - set(ray.shear.shear[0]) * depth;
            y[c] = relative(ray.shear.j) - set(ray.shear.shear[1]) * depth;
            z[c] = set(ray.shear.sign) * depth;
        }
        const auto least = [](const Lanes(&v)[3]) { return hn::Min(hn::Min(v[0], v[1]), v[2]); };
        const auto most = [](const Lanes(&v)[3]) { return hn::Max(hn::Max(v[0], v[1]), v[2]); };
        auto missed = least(x) > tau; // Min and Max of NaN are false here, or tell of the others
        const auto or_if = [&](auto mask) { missed = hn::Or(missed, mask); };
        or_if(most(x) < zero - tau), or_if(least(y) > tau), or_if(most(y) < zero - tau);
        or_if(most(z) < zero - tau), or_if(least(z) > end + tau);
        auto positive = zero > zero, negative = positive;
        for (size_t c = 0; c < 3; ++c) {
            const size_t a = (c + 1) % 3, b = (c + 2) % 3;
            const Lanes weight = x[a] * y[b] - y[a] * x[b];
            const Lanes bound = tau * ((hn::Abs(x[a]) + hn::Abs(y[a])) + (hn::Abs(x[b]) + hn::Abs(y[b])));
            positive = hn::Or(positive, weight > bound), negative = hn::Or(negative, weight < zero - bound);
        }
        or_if(hn::And(positive, negative));
        open |= bits(d, hn::Not(missed)) << at;
    }
    return open & ((1u << count) - 1);
}

} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
