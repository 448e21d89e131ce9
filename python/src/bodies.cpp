#include "python/src/bodies.hpp"

namespace prolate::python {
namespace {

// The rounding of a rotation moves the smaller body least: the larger one's frame is that of both.
bool frame_is_a(const HeldTree& a, const HeldTree& b) noexcept {
    return a.reach >= b.reach;
}

double lengths(const DoublePose& pose, const Point& center) noexcept {
    return std::abs(pose.t[0]) + std::abs(pose.t[1]) + std::abs(pose.t[2]) + std::abs(center[0]) + std::abs(center[1]) +
           std::abs(center[2]);
}

} // namespace

Bodies::Bodies(nb::handle tree_a, nb::handle poses_a, nb::handle tree_b, nb::handle poses_b, nb::handle order)
    : a_(tree_of(tree_a, "a")), b_(tree_of(tree_b, "b")), at_a_(poses_a, "poses_a", order),
      at_b_(poses_b, "poses_b", order), count_(broadcast(at_a_, "poses_a", at_b_, "poses_b")),
      as_given_(at_a_.floats() && at_b_.floats()) {
    if (as_given_ || count_ == 1) return;
    if (at_a_.count() == 1) ball_a_ = ball_center_a(0);
    if (at_b_.count() == 1) ball_b_ = ball_center_b(0);
    const Poses& of_frame = frame_is_a(a_, b_) ? at_a_ : at_b_;
    if (of_frame.count() == 1) frame_.emplace(of_frame.at(0));
}

Point Bodies::ball_center_a(size_t i) const noexcept {
    return ball_a_ ? *ball_a_ : transformed(at_a_.at(i), a_.center);
}
Point Bodies::ball_center_b(size_t i) const noexcept {
    return ball_b_ ? *ball_b_ : transformed(at_b_.at(i), b_.center);
}

bool Bodies::far_apart(size_t i, double margin) const noexcept {
    if (as_given_) return false;
    const Point a = ball_center_a(i), b = ball_center_b(i);
    const double x = b[0] - a[0], y = b[1] - a[1], z = b[2] - a[2];
    // The last term is more than what double precision loses.
    const double near = (a_.radius + b_.radius + margin) * (1 + 1e-12) +
                        1e-13 * (lengths(at_a_.at(i), a_.center) + lengths(at_b_.at(i), b_.center));
    return x * x + y * y + z * z > near * near;
}

PlacedBodies Bodies::placed(size_t i, double reach_a, double reach_b) const noexcept {
    PlacedBodies out;
    if (as_given_) {
        out.a = at_a_.floats()[at_a_.index(i)];
        out.b = at_b_.floats()[at_b_.index(i)];
        return out;
    }
    const DoublePose pose_a = at_a_.at(i), pose_b = at_b_.at(i);
    if (holds_floats(pose_a) && holds_floats(pose_b)) {
        out.a = to_floats(pose_a);
        out.b = to_floats(pose_b);
        return out;
    }
    const bool in_a = frame_is_a(a_, b_);
    const Frame frame = frame_ ? *frame_ : Frame(in_a ? pose_a : pose_b);
    const RoundedPose other = in_frame(frame, in_a ? pose_b : pose_a, in_a ? reach_b : reach_a);
    out.in_frame = true;
    out.frame = frame.pose;
    (in_a ? out.b : out.a) = other.pose;
    out.slack = other.slack;
    return out;
}

} // namespace prolate::python
