// How soon may the eight ellipsoids of a block come near a single one, all of them in motion? Per SIMD target; include
// it below hwy/foreach_target.h.
//
// Source: Zhang, Redon, Lee, Kim, "Continuous collision detection for articulated models using Taylor models and
// temporal culling" (2007), whose bound of the motion along a direction it is, and a second one beside it.
//
// X is the body of the block, Y that of the single; n the direction from the single to a lane along which there is a
// gap (distance_lanes-inl.hpp). A point with the lever r from the point that its body turns about moves along n with
//     n.(v + w x r) = n.v + m.r,   m = n x w,
// and this changes by at most |m| |w| |r| in unit time, for |r|, v, w and n stay. So the gap closes in time t by no
// more than rate t + curve t^2 / 2, where
//     rate  = n.(v_Y - v_X) + max over Y of m_Y.r + max over X of -m_X.r        (supports of the ellipsoids)
//     curve = |m_Y| |w_Y| |r_Y| + |m_X| |w_X| |r_X|,
// nor by more than most_rate t, where most_rate has |m| |r| in place of the maxima: better for large angles.
//
// Rounding: u = 2^-24. n is of length 1 within 8 u, levers are rounded by u of the coordinates that enter, m by 3 u, a
// product and sum by 5 u, a support by 15 u: less than 50 u of all speeds together. kSpeedMargin, 64 u, of them is
// added (and to `curve` as a factor). NaN fails every comparison of the caller.
#include "query/node/distance_lanes-inl.hpp"
#include "query/sweep/motion_frame.hpp"

// clang-format off
#if defined(PROLATE_QUERY_SWEEP_LANES_INL_HPP) == defined(HWY_TARGET_TOGGLE)
#ifdef PROLATE_QUERY_SWEEP_LANES_INL_HPP
#undef PROLATE_QUERY_SWEEP_LANES_INL_HPP
#else
#define PROLATE_QUERY_SWEEP_LANES_INL_HPP
#endif
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace prolate::query::HWY_NAMESPACE {

inline constexpr float kSpeedMargin = 0x1p-18f;

/// Of each lane, in steps of the block's lattice.
struct LaneSpeeds {
    alignas(64) float rate[kBlockLanes], most_rate[kBlockLanes], curve[kBlockLanes];
};

HWY_INLINE LaneVector cross(const LaneVector& n, const float (&w)[3]) {
    const LaneTag d;
    const Lanes x = hn::Set(d, w[0]), y = hn::Set(d, w[1]), z = hn::Set(d, w[2]);
    return {minor(n.y, z, n.z, y), minor(n.z, x, n.x, z), minor(n.x, y, n.y, x)};
}

HWY_INLINE void speed_lanes(const std::byte* block, int32_t step_exponent, const Single& one, const MotionFrame& frame,
                            const LaneBounds& bounds, LaneSpeeds& out) {
    const LaneTag d;
    const auto set = [d](float value) { return hn::Set(d, value); };
    const auto length = [](const LaneVector& v) { return hn::Sqrt(sum_of_squares(v.x, v.y, v.z)); };
    float arm[3];
    double square = 0;
    for (size_t i = 0; i < 3; ++i) {
        const double x = one.exact[i] - frame.center_y[i];
        arm[i] = static_cast<float>(x), square += x * x;
    }
    const float lever = static_cast<float>(std::sqrt(square)) + one.size;
    const float constant = frame.speed + frame.spin_y_length * lever + frame.spin_x_length * kLargestCenter;
    for (size_t i = 0; i < kBlockLanes; i += hn::Lanes(d)) {
        const LaneNodes e = load_nodes(block, i, step_exponent);
        const LaneVector n{hn::Load(d, bounds.x + i), hn::Load(d, bounds.y + i), hn::Load(d, bounds.z + i)};
        const LaneVector r{hn::Sub(e.x, set(frame.center_x[0])), hn::Sub(e.y, set(frame.center_x[1])),
                           hn::Sub(e.z, set(frame.center_x[2]))};
        const LaneVector mx = cross(n, frame.spin_x), my = cross(n, frame.spin_y);
        const Lanes lever_x = hn::Add(length(r), hn::Load(d, bounds.size + i)), lever_y = set(lever);
        const Lanes most_x = hn::Mul(length(mx), lever_x), most_y = hn::Mul(length(my), lever_y);
        const Lanes straight =
            hn::Add(dot(n.x, n.y, n.z, set(frame.velocity[0]), set(frame.velocity[1]), set(frame.velocity[2])),
                    hn::Mul(set(kSpeedMargin), hn::Add(set(constant), hn::Mul(set(frame.spin_x_length), lever_x))));
        const Lanes of_x = hn::Sub(width(e, mx), dot(mx.x, mx.y, mx.z, r.x, r.y, r.z));
        const Lanes of_y = hn::Add(width(one, my), dot(my.x, my.y, my.z, set(arm[0]), set(arm[1]), set(arm[2])));
        hn::Store(hn::Add(straight, hn::Add(of_x, of_y)), d, out.rate + i);
        hn::Store(hn::Add(straight, hn::Add(most_x, most_y)), d, out.most_rate + i);
        const Lanes curve =
            hn::Add(hn::Mul(most_x, set(frame.spin_x_length)), hn::Mul(most_y, set(frame.spin_y_length)));
        hn::Store(hn::Mul(curve, set(1 + kSpeedMargin)), d, out.curve + i);
    }
}

} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif // PROLATE_QUERY_SWEEP_LANES_INL_HPP
