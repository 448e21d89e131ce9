// What the ray tests of lanes-inl.hpp take.
#pragma once

#include "query/inside/axis_lanes.hpp"
#include "query/node/lanes.hpp"
#include "src/block_box.hpp"

#include <prolate/tree.hpp>

#include <cmath>
#include <cstddef>
#include <cstdint>

namespace prolate::query {

/// The part of a ray that may meet a tree, in the tree's lattice coordinates: origin + s span, 0 <= s <= 1.
struct LatticeRay {
    float origin[3], span[3];
    float inverse[3]; ///< 1 / span; of a span that is (nearly) 0, one of the same sign that moves less than rounding
    float thickness;  ///< nodes that come as near to the ray as this are met, too; 0, or rounded up
    float slack;      ///< ray_slack()
};
/// From doubles in lattice coordinates that are right within 2^-44 reach.
LatticeRay lattice_ray(const double origin[3], const double span[3], double reach, double thickness = 0) noexcept;

/// A ray as a block's boxes see it, in box steps: it passes the side of a box at x where s = (x - near) inverse, or
/// with `far` for the sides that it leaves through.
struct BoxRay {
    float near[3], far[3], inverse[3];
    size_t near_side[3], far_side[3]; ///< which of the block's sides they are: kBlockBoxLow or kBlockBoxHigh
};
inline BoxRay box_ray(const std::byte* block, const LatticeRay& ray) {
    const BlockBoxes boxes(block);
    BoxRay out;
    for (size_t i = 0; i < 3; ++i) {
        const float per_step = boxes.per_step(i);
        const auto origin = static_cast<float>(ray.origin[i] - static_cast<double>(boxes.origin(i)));
        const float wider = ray.thickness + (ray.slack + kLaneMargin * std::abs(origin));
        const bool forward = !(ray.inverse[i] < 0);
        out.near[i] = (forward ? origin + wider : origin - wider) * per_step;
        out.far[i] = (forward ? origin - wider : origin + wider) * per_step;
        out.inverse[i] = ray.inverse[i] * boxes.step(i);
        out.near_side[i] = forward ? kBlockBoxLow : kBlockBoxHigh;
        out.far_side[i] = forward ? kBlockBoxHigh : kBlockBoxLow;
    }
    return out;
}

} // namespace prolate::query
