// Two trees at N poses, as the runtime takes them: what collide, distance and contacts have in common.
#pragma once

#include "python/src/poses.hpp"
#include "python/src/tree.hpp"

#include <optional>

namespace prolate::python {

class Bodies {
public:
    Bodies(nb::handle tree_a, nb::handle poses_a, nb::handle tree_b, nb::handle poses_b, nb::handle order);

    const TreeView& a() const noexcept { return a_.view; }
    const TreeView& b() const noexcept { return b_.view; }
    size_t count() const noexcept { return count_; }
    bool single() const noexcept { return at_a_.single() && at_b_.single(); }

    /// Where the bodies of query `i` are.
    PlacedBodies placed(size_t i) const noexcept { return placed(i, a_.reach, b_.reach); }
    /// Of bodies that deform: how far they reach from their origins then.
    PlacedBodies placed(size_t i, double reach_a, double reach_b) const noexcept;
    /// Are they farther apart than `margin`? Said only if balls around them tell, in double precision, and never of
    /// poses that came as floats, which the runtime takes as they are.
    bool far_apart(size_t i, double margin) const noexcept;

private:
    Point ball_center_a(size_t i) const noexcept;
    Point ball_center_b(size_t i) const noexcept;

    const HeldTree &a_, &b_;
    Poses at_a_, at_b_;
    size_t count_;
    bool as_given_; ///< all poses came as floats
    // Of a single pose, what would be the same for all queries.
    std::optional<Frame> frame_;
    std::optional<Point> ball_a_, ball_b_;
};

} // namespace prolate::python
