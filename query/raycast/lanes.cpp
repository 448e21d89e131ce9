#include "query/raycast/lanes.hpp"

#include <cmath>

namespace prolate::query {
namespace {

/// Far below the slack, in lattice steps.
constexpr float kLeastSpan = 0x1p-60f;
constexpr double kRoundUp = 1 + 0x1p-20; // also pays for the rounding of thickness |n|

} // namespace

LatticeRay lattice_ray(const double origin[3], const double span[3], double reach, double thickness) noexcept {
    LatticeRay out{};
    for (size_t i = 0; i < 3; ++i) {
        out.origin[i] = static_cast<float>(origin[i]), out.span[i] = static_cast<float>(span[i]);
        const bool still = std::abs(out.span[i]) < kLeastSpan;
        out.inverse[i] = 1 / (still ? std::copysign(kLeastSpan, out.span[i]) : out.span[i]);
        const bool forward = !(out.inverse[i] < 0);
        out.forward[i] = forward ? 1.0f : -1.0f;
        out.near_side[i] = forward ? kBlockBoxLow : kBlockBoxHigh,
        out.far_side[i] = forward ? kBlockBoxHigh : kBlockBoxLow;
    }
    out.thickness = static_cast<float>(thickness * kRoundUp);
    out.slack = ray_slack(out.origin, out.span, reach);
    return out;
}

} // namespace prolate::query
