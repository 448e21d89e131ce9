// One sweep() query: what the vectorised traversal (search.cpp) and the decisions at its leaves (leaves.cpp) share.
#pragma once

#include "query/node/lattice.hpp"
#include "query/node/limits.hpp"
#include "query/node/order.hpp"
#include "query/node/scratch.hpp"
#include "query/node/tree_side.hpp"
#include "query/sweep/motion.hpp"
#include "query/sweep/motion_frame.hpp"

#include <prolate/sweep.hpp>

#include <glm/vec3.hpp>

#include <cstdint>

namespace prolate::query {

/// Of the present time: a shorter step is none, because an entry of the search does not keep it.
inline constexpr double kLeastStep = 0x1p-46;

struct SweepSearch {
    TreeSide a, b;
    const PairMotion motion;
    const SweepOptions options; // sound
    Scratch::Entry* const entries;
    const uint32_t room; ///< for entries that wait in the heap
    QueryStats stats;

    double target;        ///< pairs are advanced until they are so near, metres: margin and half of the tolerance
    double reached;       ///< pairs not farther apart meet: margin and tolerance
    double overshoot = 1; ///< of each step; above 1 it is wrong: so the tests can show that they notice

    double time = -1; ///< what `now` and the frames are of
    Instant now{};
    MotionFrame frame_a{}, frame_b{};

    /// At the start, does one body hold a part of the other? Settled before the traversal, as in
    /// query/distance/state.hpp.
    Verdict enclosure = Verdict::separated;
    bool complete = false; ///< no budget ran out
    double open = 1;       ///< pairs that were not looked at keep apart until then
    /// The earliest meeting found, or 1.
    double horizon = 1;
    bool found = false;
    double distance = 0; ///< at the horizon
    MeetingPair witness;
    glm::dvec3 on_a{0, 0, 0}, on_b{0, 0, 0}, normal{0, 0, 0}; ///< then, in A's frame

    SweepSearch(const OrderedBodies<Motion>& bodies, Scratch context, const SweepOptions& sweep_options) noexcept;

    void move_to(double t) noexcept;

    /// Time, not before the present one, until which two leaves keep apart, at most `horizon`. If they meet now, takes
    /// the meeting and returns the present time. `as_covers`: what covers the nodes stands for what is
    /// below them.
    double advance(uint32_t node_a, uint32_t node_b, bool as_covers) noexcept;
    /// Tests of triangles that advance() takes, at most.
    uint64_t triangle_tests(uint32_t node_a, uint32_t node_b, bool as_covers) const noexcept;
    /// Tests left of the budget.
    uint64_t left() const { return tests_left(options.max_pair_tests, stats.tests()); }

private:
    template <class X, class Y>
    bool advance_pair(const X& x, const Y& y, const MeetingPair& pair, glm::dvec3& n, double& least) noexcept;
    template <class X, class Y>
    double safe_time(const X& x, const Y& y, const glm::dvec3& n, double limit) const noexcept;
};

/// Time in which a gap > 0 may close, if it closes by at most rate t + curve t^2 / 2, and by at most most_rate t.
double closing_time(double gap, double rate, double curve, double most_rate) noexcept;

/// The traversal: finds the earliest meeting, or how long the bodies keep apart.
void traverse(SweepSearch& search) noexcept;

} // namespace prolate::query
