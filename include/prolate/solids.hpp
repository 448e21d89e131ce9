// Do two *solids* meet, and how far apart are they? Answers about the meshes that trees were baked from, certain on
// both sides, from covers alone.
//
// Ellipsoids that cover a solid stick out of it, so covers that meet prove nothing. A tree that was baked with an inner
// cover (BuildOptions::inner, TreeView::inner()) has ellipsoids inside the solid, too:
//  - outer covers apart:   the solids are certainly apart;
//  - inner covers meeting: the solids certainly meet;
//  - neither:              the pose is within the *band*, whose width the bounds of distance_solids() tell. Whoever
//                          needs to know more asks exact trees. Most poses do not come so far.
// A solid is what a closed mesh encloses, or with BuildOptions::fill the filled one; of an open mesh it is the
// triangles. query.hpp says how verdicts, limits and scratch work.
//
// Which trees: of a tree without triangles, all levels are covers by themselves, and max_level chooses one of the outer
// and one of the inner cover. Without an inner cover, nothing is certain to meet or to be near. An exact tree is the
// solid itself, and max_level does not limit it: two of them are asked as collide() and distance() ask them; against a
// tree without triangles, an inner cover that it has stands for it where bodies meet. A prefix of an exact tree is no
// solid: undecided. The radius of a rounded() tree is part of the solid.
#pragma once

#include <prolate/distance.hpp>
#include <prolate/query.hpp>

#include <limits>

namespace prolate {

/// Limits of collide_solids().
struct SolidsOptions {
    uint32_t max_level = kMaxLevels;      ///< of either cover: 0 = the roots only
    uint64_t max_pair_tests = UINT64_MAX; ///< as QueryOptions has it, for both covers together
    float margin = 0;                     ///< solids at most this far apart count as meeting, metres
    /// The bodies may be displaced by so much against each other, metres, without the answer becoming wrong: what is
    /// not known of the poses. Of two exact trees, only *separated* keeps to it. Lengths are taken as
    /// QueryOptions::margin is.
    float uncertainty = 0;
};

/// Answer of collide_solids().
struct SolidsResult {
    /// separated: the solids are farther apart than the margin. overlapping: a point of one is certainly within the
    /// margin of a point of the other. undecided: within the band, or out of budget.
    Verdict verdict = Verdict::undecided;
    bool out_of_budget = false; ///< undecided only because max_pair_tests ended the search
    QueryStats stats;
};

/// Do the solids meet, or come within options.margin of each other? Symmetric but for the counters. Thread-safe on
/// shared trees. A pose that is not finite, or whose quaternion is zero, leaves the answer open. One collide() of the
/// outer covers, and if these meet, one of the inner ones.
SolidsResult collide_solids(const TreeView& a, const Pose& pose_a, const TreeView& b, const Pose& pose_b,
                            Scratch context, const SolidsOptions& options = {}) noexcept;

/// Answer of distance_solids().
struct SolidsDistance {
    /// As of collide_solids(), without a margin.
    Verdict verdict = Verdict::undecided;
    /// Certified: lower <= distance of the solids <= upper, metres; the distance of solids that meet is 0. What the
    /// tolerances of the options leave open is part of both. `upper` is infinite without inner covers.
    double lower = 0, upper = std::numeric_limits<double>::infinity();
    QueryStats stats;
};

/// How far apart are the solids? The lower bound is that of the outer covers, the upper one that of the inner covers.
/// Symmetric but for the counters and rounding. Thread-safe on shared trees. If the solids are certainly at least
/// options.max_distance apart, `upper` is not looked for.
SolidsDistance distance_solids(const TreeView& a, const Pose& pose_a, const TreeView& b, const Pose& pose_b,
                               Scratch context, const DistanceOptions& options = {}) noexcept;

} // namespace prolate
