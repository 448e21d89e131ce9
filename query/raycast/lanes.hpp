// What the ray tests of lanes-inl.hpp take.
#pragma once

#include "query/inside/axis_lanes.hpp"
#include "query/node/lanes.hpp"
#include "src/block_box.hpp"

#include <prolate/tree.hpp>

#include <cstddef>
#include <cstdint>

namespace prolate::query {

/// The part of a ray that may meet a tree, in the tree's lattice coordinates: origin + s span, 0 <= s <= 1. A fourth
/// number means nothing. All are finite.
struct LatticeRay {
    alignas(16) float origin[4], span[4];
    /// 1 / span; of a span that is (nearly) 0, one of the same sign that moves less than rounding.
    alignas(16) float inverse[4];
    alignas(16) float margin[4]; ///< (thickness + slack) / |span|: in the ray's parameter, what no block adds to
    alignas(16) int32_t near_side[4],
        far_side[4]; ///< of a block's boxes, where it enters and leaves: kBlockBoxLow, -High
    float thickness; ///< nodes that come as near to the ray as this are met, too; 0, or rounded up
    float slack;     ///< ray_slack()
};

} // namespace prolate::query
