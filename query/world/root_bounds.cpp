// A vector v of a body at the pose (t, q), q = (u, w), is turned to v + 2 / |q|^2 (w (u x v) + u x (u x v)). All is
// counted from A's origin. Spheres decide first, then, with M = R L the turned factors and d between the centers,
//     gap along n = n.d - |Ma^T n| - |Mb^T n| - margin |n|
// for n = d and then for n = (Ma Ma^T / |Ma^T d| + Mb Mb^T / |Mb^T d|)^-1 d: where ellipsoids just touch, the normal of
// the plane between them solves that with n in the place of d on the right (K. Perram and M. Wertheim, "Statistical
// mechanics of hard ellipsoids", 1985). Any n costs decisions, never correctness; of horses of which 98.7 % are apart
// this one leaves 0.1 % of what any could decide. It is scaled to a length near 1, so that no square is lost to
// underflow; where it cannot be, it is NaN and decides nothing.
//
// Rounding, double precision, S the lengths that enter: the difference of the centers is wrong by less than 2^-45 S, as
// that of collide() (query/ellipsoid/separation.hpp), which takes 2^-45 S more off; turning the factors and the
// products lose less than 40 u |n| S, u = 2^-53. Four times 2^-45 S is taken off, so what is separated here is so by
// enough for every other test to tell, too. The inverse is the adjugate, so nothing is divided by a determinant.
//
// Cost: about 70 operations for as many poses as a vector has doubles, and some 15 a pose to fetch it; where spheres do
// not decide some 400.
#include "query/world/root_bounds.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "query/world/root_bounds.cpp"
#include "query/simd/targets.hpp" // before foreach_target.h

#include <hwy/foreach_target.h>

#include "query/ellipsoid/placed.hpp"
#include "query/ellipsoid/separation.hpp"
#include "query/simd/vector-inl.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>

HWY_BEFORE_NAMESPACE();
namespace prolate::query::HWY_NAMESPACE {
namespace {

using Double3 = Vector3<Double>;

class Rotation {
public:
    Rotation(const Double3& u, Double w) : u_(u), w_(w), share_(2 / (dot(u, u) + w * w)) {}
    Double3 operator*(const Double3& v) const {
        const Double3 t = cross(u_, v);
        return v + (t * w_ + cross(u_, t)) * share_;
    }

private:
    Double3 u_;
    Double w_, share_;
};

Double3 in_lanes(double x, double y, double z) {
    return {broadcast<Double>(x), broadcast<Double>(y), broadcast<Double>(z)};
}

// The columns of M = R L.
struct Factor {
    Double3 column[3];

    Factor(const double (&l)[6], const Rotation& r)
        : column{r * in_lanes(l[0], l[1], l[3]), r * in_lanes(0, l[2], l[4]), r * in_lanes(0, 0, l[5])} {}
    // |M^T n|
    Double reach(const Double3& n) const {
        return length(Double3{dot(column[0], n), dot(column[1], n), dot(column[2], n)});
    }
    // Rows of M M^T, times a number, added to those of another such matrix.
    void add_shape(Double factor, Double3 (&rows)[3]) const {
        for (const Double3& c : column) {
            const Double3 f = c * factor;
            rows[0] = rows[0] + c * f.x, rows[1] = rows[1] + c * f.y, rows[2] = rows[2] + c * f.z;
        }
    }
};

// Poses, one a lane; row k is number k of a Pose.
class PoseLanes {
public:
    PoseLanes(std::span<const Pose> poses, uint32_t first, uint32_t count) {
        static_assert(sizeof(Pose) == 7 * sizeof(float));
        for (uint32_t i = 0; i < kPosesAtOnce; ++i) {
            const Pose& pose = poses[poses.size() == 1 ? 0 : first + std::min(i, count - 1)];
            const auto numbers = std::bit_cast<std::array<float, 7>>(pose);
            for (size_t k = 0; k < 7; ++k) rows_[k][i] = numbers[k];
        }
    }
    Double3 translation(size_t lane) const { return {row(0, lane), row(1, lane), row(2, lane)}; }
    Rotation rotation(size_t lane) const { return {{row(3, lane), row(4, lane), row(5, lane)}, row(6, lane)}; }

private:
    Double row(size_t k, size_t lane) const {
        return hn::PromoteTo(DoubleTag(), hn::Load(hn::Rebind<float, DoubleTag>(), rows_[k] + lane));
    }

    alignas(64) float rows_[7][kPosesAtOnce];
};

// Lanes whose ellipsoids have a gap.
hn::Mask<DoubleTag> have_gap(const Factor& a, const Factor& b, const Double3& between, Double margin) {
    const auto scaled = [](const Double3& n) { return n * (1 / max_norm(n)); };
    const Double3 along = scaled(between);
    const Double reach_a = a.reach(along), reach_b = b.reach(along);
    const auto first = dot(along, between) - (reach_a + reach_b) > margin * length(along);
    if (hn::AllTrue(DoubleTag(), first)) return first;
    Double3 shape[3] = {in_lanes(0, 0, 0), in_lanes(0, 0, 0), in_lanes(0, 0, 0)};
    a.add_shape(reach_b, shape), b.add_shape(reach_a, shape);
    const Double3 n = scaled({dot(cross(shape[1], shape[2]), along), dot(cross(shape[2], shape[0]), along),
                              dot(cross(shape[0], shape[1]), along)});
    return hn::Or(first, dot(n, between) - (a.reach(n) + b.reach(n)) > margin * length(n));
}

uint32_t roots_apart_target(const RootBounds& roots, std::span<const Pose> poses_a, std::span<const Pose> poses_b,
                            uint32_t first, uint32_t count) {
    const PoseLanes at_a(poses_a, first, count), at_b(poses_b, first, count);
    uint32_t out = 0;
    for (size_t lane = 0; lane < kPosesAtOnce; lane += kDoubleLanes) {
        const Rotation turn_a = at_a.rotation(lane), turn_b = at_b.rotation(lane);
        const auto &a = roots.a.center, &b = roots.b.center;
        const Double3 d = at_b.translation(lane) - at_a.translation(lane);
        const Double3 between = d + (turn_b * in_lanes(b[0], b[1], b[2]) - turn_a * in_lanes(a[0], a[1], a[2]));
        const Double slack = 4 * kSeparationMargin * (roots.reach + roots.margin + one_norm(d));
        const Double least = (roots.spheres + slack) * (1 + 0x1p-40);
        auto apart = dot(between, between) > least * least;
        if (!hn::AllTrue(DoubleTag(), apart))
            apart = hn::Or(apart,
                           have_gap({roots.a.factor, turn_a}, {roots.b.factor, turn_b}, between, slack + roots.margin));
        out |= bits(DoubleTag(), apart) << lane;
    }
    return out & ((1u << count) - 1);
}

} // namespace
} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace prolate::query {

RootBounds root_bounds(const TreeView& a, const TreeView& b, float margin) noexcept {
    const PlacedEllipsoid root_a = place(a.root_bound(), a.scale()), root_b = place(b.root_bound(), b.scale());
    const auto side = [](const PlacedEllipsoid& e) -> RootBounds::Side {
        const glm::dmat3& l = e.factor; // by columns
        return {.center = {e.center.x, e.center.y, e.center.z},
                .factor = {l[0][0], l[0][1], l[1][1], l[0][2], l[1][2], l[2][2]}};
    };
    return {.a = side(root_a),
            .b = side(root_b),
            .spheres = root_a.size + root_b.size + double{margin},
            .margin = double{margin},
            .reach = root_a.reach + root_b.reach};
}

HWY_EXPORT(roots_apart_target);
uint32_t roots_apart(const RootBounds& roots, std::span<const Pose> poses_a, std::span<const Pose> poses_b,
                     uint32_t first, uint32_t count) noexcept {
    return HWY_DYNAMIC_DISPATCH(roots_apart_target)(roots, poses_a, poses_b, first, count);
}

} // namespace prolate::query
#endif // HWY_ONCE
