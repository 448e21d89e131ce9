// How soon may the eight ellipsoids of a block come near a single one, all of them in motion? Per SIMD target; include
// it below hwy/foreach_target.h.
//
// Source: Zhang, Redon, Lee, Kim, "Continuous collision detection for articulated models using Taylor models and
// temporal culling" (2007), whose bound of the motion along a direction it is, and a second one beside it.
//
// X is the body of the block, Y that of the single; n the direction from the single to a lane along which there is a
// gap (query/node/distance_lanes-inl.hpp). A point with the lever r from the point that its body turns about moves
// along n with
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

HWY_INLINE void speed_lanes(const std::byte* block, int32_t step_exponent, const Single& one, const MotionFrame& frame,
                            const LaneBounds& bounds, LaneSpeeds& out) {
    float arm[3];
    double square = 0;
    for (size_t i = 0; i < 3; ++i) {
        const double x = one.exact[i] - frame.center_y[i];
        arm[i] = static_cast<float>(x), square += x * x;
    }
    const float lever = static_cast<float>(std::sqrt(square)) + one.size;
    const float constant = frame.speed + frame.spin_y_length * lever + frame.spin_x_length * kLargestCenter;
    for (size_t i = 0; i < kBlockLanes; i += kFloatLanes) {
        const LaneNodes e = load_nodes(block, i, step_exponent);
        const Float3 n = load(bounds.n, i), r = e.center - set(frame.center_x);
        const Float3 mx = cross(n, set(frame.spin_x)), my = cross(n, set(frame.spin_y));
        const Float lever_x = length(r) + load(bounds.size + i);
        const Float most_x = length(mx) * lever_x, most_y = length(my) * lever;
        const Float straight = dot(n, set(frame.velocity)) + kSpeedMargin * (constant + frame.spin_x_length * lever_x);
        const Float of_x = width(e, mx) - dot(mx, r), of_y = width(one, my) + dot(my, set(arm));
        store(straight + (of_x + of_y), out.rate + i);
        store(straight + (most_x + most_y), out.most_rate + i);
        store((most_x * frame.spin_x_length + most_y * frame.spin_y_length) * (1 + kSpeedMargin), out.curve + i);
    }
}

} // namespace prolate::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif // PROLATE_QUERY_SWEEP_LANES_INL_HPP
