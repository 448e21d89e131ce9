// Two solids in the canonical order of their outer covers, and the questions that all queries of solids ask of these
// and of the inner covers.
#pragma once

#include "query/collide/search.hpp"

#include <prolate/solids.hpp>

#include <cstdint>

namespace prolate::query {

class SolidPair {
public:
    /// All arguments must outlive it.
    SolidPair(const Solid& a, const Pose& pose_a, const Solid& b, const Pose& pose_b, Scratch context,
              uint64_t budget) noexcept
        : bodies_(in_canonical_order(a.outer(), pose_a, b.outer(), pose_b)), first_(bodies_.exchanged ? b : a),
          second_(bodies_.exchanged ? a : b), context_(context), budget_(budget),
          b_to_a_(relative_pose(bodies_.place_a, bodies_.place_b)) {}

    /// Of others, nothing is known.
    bool may_be_asked() const noexcept;
    bool are_triangles() const noexcept { return bodies_.a.has_triangles() && bodies_.b.has_triangles(); }
    /// Something is known to lie in both, and the scratch suffices for it.
    bool have_inner() const noexcept;

    /// collide() of the outer covers.
    Verdict outer_meet(float margin) noexcept;
    /// What collide() of solids answers, whose outer covers come within margin + uncertainty, or not: `outer`.
    SolidsResult answer(Verdict outer, float margin, float uncertainty, DistanceCache* cache = nullptr) noexcept;
    /// Do the inner covers, or what takes their place, certainly come within the margin of each other, even if they are
    /// displaced by `uncertainty`? Both sound lengths. Undecided if the budget ended first. A cache names the leaves
    /// that are tested first, and gets those that meet.
    Verdict inner_meet(float margin, float uncertainty, DistanceCache* cache = nullptr) noexcept;
    /// Do the leaves that a cache names meet so? One test; false if it names none.
    bool still_meet(const DistanceCache& cache, float margin, float uncertainty) noexcept;
    /// Is what a query of the inner covers, in the order of the caller, calls overlapping certain to meet?
    bool certainly_meet(MeetingPair pair, bool enclosed) const noexcept;
    /// A certified lower bound of the depth, metres: that of the deepest pair of inner ellipsoids. 0 within the budget
    /// if none is found, or if one of the solids has no inner cover.
    double depth() noexcept;

    uint64_t left() const noexcept { return tests_left(budget_, stats.tests()); } ///< of the budget

    QueryStats stats;

private:
    const TreeView& inner_a() const { return *first_.inner(); }
    const TreeView& inner_b() const { return *second_.inner(); }
    /// How near is near enough, metres.
    double within(float margin, float uncertainty) const {
        return (double{margin} - double{uncertainty}) + (double{inner_a().radius()} + inner_b().radius());
    }
    bool come_within(const MeetingPair& pair, bool enclosed, double within) const;
    bool leaves_hold_ball(double radius) const;

    const OrderedBodies<Pose> bodies_; // the outer covers
    const Solid &first_, &second_;
    const Scratch context_;
    const uint64_t budget_;
    const RelativePose b_to_a_;
};

} // namespace prolate::query
