// Forward kinematics: the frames of a robot's links, for eight configurations at a time, in double precision.
#pragma once

#include "python/src/arrays.hpp"
#include "python/src/poses.hpp"
#include "python/src/robot_lanes.hpp"

#include <array>
#include <vector>

namespace prolate::python {

/// Where a link is, in each of eight configurations.
struct alignas(64) LinkFrames {
    Doubles3 t;     ///< its origin, in the root's frame, metres
    Doubles q[4];   ///< its rotation, x y z w, of length 1 but for rounding
    Doubles extent; ///< the sum of all lengths that led there: its origin is no farther from the root's
    Doubles steps;  ///< how many joints did, and the sum of their angles
};

enum class JointKind : uint8_t { fixed, revolute, continuous, prismatic, planar, ball, floating };

/// One joint, as python/prolate/robots/_model.py has it.
struct ChainJoint {
    JointKind kind = JointKind::fixed;
    uint32_t parent = 0, child = 0;    ///< links
    size_t coordinate = 0;             ///< index into q, of the joint that it mimics if it does
    double multiplier = 1, offset = 0; ///< the joint moves by multiplier q + offset
    Point arm{}, anchor{}, axis{};     ///< the anchor in the parent's frame and in the child's; the axis in the child's
    std::array<Point, 3> across{};     ///< two directions across the axis, and the axis, in the parent's frame
    std::array<double, 4> at_0{}, turn{}; ///< rotation = at_0 cos(angle / 2) + turn sin(angle / 2)
    double length = 0;                    ///< no less than what the joint adds to LinkFrames::extent while it is at 0
};

inline bool has_quaternion(const ChainJoint& joint) noexcept {
    return joint.kind == JointKind::ball || joint.kind == JointKind::floating;
}

class Chain {
public:
    /// What Python hands over, checked there: an array for each column, and a row for each joint.
    Chain(nb::handle kinds, nb::handle parents, nb::handle children, nb::handle coordinates, nb::handle origins,
          nb::handle axes, nb::handle anchors, nb::handle scales, size_t link_count, size_t nq);

    size_t link_count() const noexcept { return link_count_; }
    size_t nq() const noexcept { return nq_; }
    const std::vector<ChainJoint>& joints() const noexcept { return joints_; }
    /// The joint that `link` hangs on; none for the root.
    const ChainJoint* joint_of(size_t link) const noexcept {
        return joint_of_[link] < 0 ? nullptr : &joints_[static_cast<size_t>(joint_of_[link])];
    }
    /// The frames of all links, into `out`, of the configurations q[lane * nq() ...], all finite.
    void frames(const double* const (&q)[kLanes], LinkFrames* out) const noexcept;

private:
    size_t link_count_, nq_;
    std::vector<ChainJoint> joints_; ///< parents first
    std::vector<int64_t> joint_of_;
};

/// Configurations of a call: shape (N, nq) or (nq,), finite; quaternions of balls and floating bases are no zeros.
Rows<double> configurations(nb::handle q, const char* name, const Chain& chain);

PROLATE_ROBOT_INLINE Doubles3 rotated(const Doubles (&q)[4], const Doubles3& v) {
    const Doubles3 u = {q[0], q[1], q[2]}, twice = cross(u, v) * 2.0;
    return v + twice * q[3] + cross(u, twice);
}
PROLATE_ROBOT_INLINE Doubles3 rotated(const Doubles (&q)[4], const Point& p) {
    const Doubles zero{};
    return rotated(q, Doubles3{zero + p[0], zero + p[1], zero + p[2]});
}
/// By how much rounding in double precision may have moved a point that is `reach` from the link's origin. A joint
/// costs a product of quaternions, two rotated vectors, and the rounding of its angle: less than 64 roundings of all
/// lengths so far, and one for each radian.
inline double rounding_in(const LinkFrames& frames, size_t lane, double reach) noexcept {
    return 0x1p-47 * (frames.steps[lane] + 1) * (frames.extent[lane] + reach);
}
/// The pose in one lane.
DoublePose pose_in(const LinkFrames& frames, size_t lane) noexcept;

} // namespace prolate::python
