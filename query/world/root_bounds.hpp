// Two bodies at many poses, several at once: bounding ellipsoids of their roots tell of most that they are apart.
#pragma once

#include <prolate/tree.hpp>
#include <prolate/types.hpp>

#include <cstdint>
#include <span>

namespace prolate::query {

/// Of two trees, in their own frames.
struct RootBounds {
    struct Side {
        double center[3];
        double factor[6]; ///< l11, l21, l22, l31, l32, l33
    } a, b;
    double spheres; ///< radii of the spheres around both, and the margin
    double margin;
    double reach; ///< their share of S (query/ellipsoid/separation.hpp)
};
RootBounds root_bounds(const TreeView& a, const TreeView& b, float margin) noexcept;

inline constexpr uint32_t kPosesAtOnce = 8;

/// Bit i: with `a` at poses_a[first + i] and `b` at poses_b[first + i], i < count <= kPosesAtOnce, the bounds are
/// certainly farther apart than the margin. A span of one pose stands for that pose at all i. Of a pose that is not
/// finite, the bit is 0.
uint32_t roots_apart(const RootBounds& roots, std::span<const Pose> poses_a, std::span<const Pose> poses_b,
                     uint32_t first, uint32_t count) noexcept;

} // namespace prolate::query
